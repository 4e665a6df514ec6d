//! Outputs of a plant that cost something or are bounded: y = g(x, u), nonlinear as a rule.
//!
//! In a program they are linear about the plan: their weights become those of state and input (the
//! Gauss-Newton matrices; Nocedal and Wright, Numerical Optimization, ch. 10.3), their bounds
//! general rows. The merit of a descent has the outputs themselves.

use crate::by_stage::CostByStage;
use crate::cost::excess;
use crate::model::Scalar;
use crate::ocp::{Common, GeneralRow, Penalty};
use crate::workspace::half;
use core::fmt;
use nalgebra::{SVector, convert};

/// Outputs y = g(x, u) that a sample is told of, with what each is to do: follow a reference, keep
/// within bounds, or both. A nonlinear constraint h(x, u) <= 0 is an output with the upper bound 0.
///
/// `NX` states, `NU` inputs. Numbers in units of the output, prices and weights in the unit of the cost J.
pub trait Outputs<T, const NX: usize, const NU: usize>: fmt::Debug {
    /// How many there are, the same number at every stage.
    fn count(&self) -> usize;

    /// The first so many of them may have bounds. Each takes a row of the workspace at every stage, as
    /// [general rows](crate::Capacity::with_general_rows) do, and is named as one of them
    /// ([`Quantity::Row`](crate::Quantity::Row)), before the others.
    fn bounded(&self) -> usize;

    /// Whether the output `j` depends on the input. Bounds of one that does not count nothing at stage 0,
    /// where the state is given; of one that does, nothing at the end, where there is no input.
    fn depends_on_input(&self, j: usize) -> bool;

    /// What the output `j` is to do at stage `i`.
    fn goal(&self, i: usize, j: usize) -> OutputGoal<T>;

    /// Calls `visit(j, y_j)` for each output at stage `i` with the state `x` and the input `u` (zero at
    /// the end, where only outputs that do not depend on it are looked at).
    fn values(
        &self,
        i: usize,
        x: &SVector<T, NX>,
        u: &SVector<T, NU>,
        visit: &mut dyn FnMut(usize, T),
    );

    /// The same with the derivatives: calls `visit(j, y_j, dy_j/dx, dy_j/du)`.
    fn tangents(
        &self,
        i: usize,
        x: &SVector<T, NX>,
        u: &SVector<T, NU>,
        visit: &mut VisitTangent<'_, T, NX, NU>,
    );
}

/// Takes the number of an output, its value, and its derivatives with respect to state and input.
pub type VisitTangent<'a, T, const NX: usize, const NU: usize> =
    dyn FnMut(usize, T, &SVector<T, NX>, &SVector<T, NU>) + 'a;

/// What an output is to do at a stage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutputGoal<T> {
    /// Its weight w, at least 0: w (y - reference)^2 at the stages 0 to N - 1.
    pub weight: T,
    /// Where it is to be.
    pub reference: T,
    /// The least value, at the stages 0 to N; minus infinity for none.
    pub lower: T,
    /// The largest value; infinity for none.
    pub upper: T,
    /// The price of exceeding them; hard without.
    pub soft: Option<Penalty<T>>,
}

impl<T: Scalar> OutputGoal<T> {
    /// Nothing to do.
    pub fn none() -> Self {
        let infinity: T = convert(f64::INFINITY);
        Self {
            weight: T::zero(),
            reference: T::zero(),
            lower: -infinity,
            upper: infinity,
            soft: None,
        }
    }
}

/// An output that is linear: y = `value` + x'(x - x_0) + u'(u - u_0).
struct Linear<'a, T, const NX: usize, const NU: usize> {
    /// Its value at x = 0, u = 0.
    constant: T,
    x: &'a SVector<T, NX>,
    u: &'a SVector<T, NU>,
}

impl<'a, T: Scalar, const NX: usize, const NU: usize> Linear<'a, T, NX, NU> {
    fn about(
        (x, u): (&SVector<T, NX>, &SVector<T, NU>),
        value: T,
        by_x: &'a SVector<T, NX>,
        by_u: &'a SVector<T, NU>,
    ) -> Self {
        Self {
            constant: without_rounding([value, -by_x.dot(x), -by_u.dot(u)]),
            x: by_x,
            u: by_u,
        }
    }

    fn at(&self, x: &SVector<T, NX>, u: &SVector<T, NU>) -> T {
        self.constant + self.x.dot(x) + self.u.dot(u)
    }
}

/// Their sum, which is zero where they cancel but for rounding: a limit of that size could not be met to a part of it.
fn without_rounding<T: Scalar, const K: usize>(terms: [T; K]) -> T {
    let zero = T::zero();
    let (sum, size) = { terms.iter() }.fold((zero, zero), |(sum, size), term| {
        (sum + *term, size + term.abs())
    });
    let rounding = size * T::default_epsilon() * convert(8.0);
    match sum.abs() <= rounding && size.is_finite() {
        true => zero,
        false => sum,
    }
}

/// Whether the bounds of the output `j` count at stage `i`.
fn counts<T, const NX: usize, const NU: usize>(
    outputs: &dyn Outputs<T, NX, NU>,
    j: usize,
    beginning: bool,
    end: bool,
) -> bool {
    j < outputs.bounded()
        && if outputs.depends_on_input(j) {
            !end
        } else {
            !beginning
        }
}

/// Calls `visit` with each output at a stage: itself, or linear `about` a state and an input.
pub(crate) fn each<T: Scalar, const NX: usize, const NU: usize>(
    outputs: &dyn Outputs<T, NX, NU>,
    i: usize,
    (x, u): (&SVector<T, NX>, &SVector<T, NU>),
    about: Option<(&SVector<T, NX>, &SVector<T, NU>)>,
    visit: &mut dyn FnMut(usize, T),
) {
    match about {
        None => outputs.values(i, x, u, visit),
        Some(about) => outputs.tangents(i, about.0, about.1, &mut |j, y, by_x, by_u| {
            visit(j, Linear::about(about, y, by_x, by_u).at(x, u));
        }),
    }
}

/// What the outputs of stage `i` cost, prices apart.
pub(crate) fn cost<T: Scalar, const NX: usize, const NU: usize>(
    outputs: &dyn Outputs<T, NX, NU>,
    i: usize,
    (x, u): (&SVector<T, NX>, &SVector<T, NU>),
) -> T {
    let mut total = T::zero();
    each(outputs, i, (x, u), None, &mut |j, y| {
        total += weighted(&outputs.goal(i, j), y);
    });
    total
}

/// w (y - reference)^2; nothing without weight, whatever y.
fn weighted<T: Scalar>(goal: &OutputGoal<T>, y: T) -> T {
    let error = y - goal.reference;
    if goal.weight > T::zero() {
        goal.weight * error * error
    } else {
        T::zero()
    }
}

/// What the outputs of stage `i` cost with the price of their bounds, `hard` that of hard ones. There is no input
/// at the end.
pub(crate) fn merit<T: Scalar, const NX: usize, const NU: usize>(
    outputs: &dyn Outputs<T, NX, NU>,
    i: usize,
    (x, u): (&SVector<T, NX>, Option<&SVector<T, NU>>),
    about: Option<(&SVector<T, NX>, &SVector<T, NU>)>,
    hard: Penalty<T>,
) -> T {
    let mut total = T::zero();
    let still = SVector::zeros();
    let motion = (x, u.unwrap_or(&still));
    each(outputs, i, motion, about, &mut |j, y| {
        let goal = outputs.goal(i, j);
        if u.is_some() {
            total += weighted(&goal, y);
        }
        if counts(outputs, j, i == 0, u.is_none()) {
            let beyond = excess(y, goal.lower, goal.upper);
            // Negated, so that an output that is none has a price.
            if !(beyond == T::zero()) {
                total += goal.soft.unwrap_or(hard).of(beyond);
            }
        }
    });
    total
}

/// Calls `visit` with the value and the bounds of each output at stage `i` that has hard ones. There is no input at the end.
pub(crate) fn hard_bounds<T: Scalar, const NX: usize, const NU: usize>(
    outputs: &dyn Outputs<T, NX, NU>,
    i: usize,
    (x, u): (&SVector<T, NX>, Option<&SVector<T, NU>>),
    visit: &mut dyn FnMut(usize, T, T, T),
) {
    let still = SVector::zeros();
    let motion = (x, u.unwrap_or(&still));
    each(outputs, i, motion, None, &mut |j, y| {
        let goal = outputs.goal(i, j);
        if goal.soft.is_none() && counts(outputs, j, i == 0, u.is_none()) {
            visit(j, y, goal.lower, goal.upper);
        }
    });
}

/// Adds the outputs of stage `i`, linear about `motion`, to the quadratic and the linear cost of a program.
pub(crate) fn add_costs<T: Scalar, const NX: usize, const NU: usize>(
    outputs: &dyn Outputs<T, NX, NU>,
    i: usize,
    motion: (&SVector<T, NX>, &SVector<T, NU>),
    common: &mut Common<T, NX, NU>,
    (linear_x, linear_u): (&mut SVector<T, NX>, &mut SVector<T, NU>),
) {
    outputs.tangents(i, motion.0, motion.1, &mut |j, y, by_x, by_u| {
        let goal = outputs.goal(i, j);
        if !(goal.weight > T::zero()) {
            return;
        }
        let linear = Linear::about(motion, y, by_x, by_u);
        let (of_x, of_u) = (by_x * goal.weight, by_u * goal.weight);
        common.q += of_x * by_x.transpose();
        common.r += of_u * by_u.transpose();
        common.s += of_u * by_x.transpose();
        let error = linear.constant - goal.reference;
        *linear_x += of_x * error;
        *linear_u += of_u * error;
    });
}

/// Writes the bounds of the outputs of stage `i`, linear about `motion`, to the first of its general `rows`; those
/// without a price have the `elastic` one, if there is one.
pub(crate) fn write_rows<T: Scalar, const NX: usize, const NU: usize>(
    outputs: &dyn Outputs<T, NX, NU>,
    i: usize,
    motion: (&SVector<T, NX>, &SVector<T, NU>),
    end: bool,
    elastic: Option<Penalty<T>>,
    rows: &mut [GeneralRow<T, NX, NU>],
) {
    outputs.tangents(i, motion.0, motion.1, &mut |j, y, by_x, by_u| {
        let Some(row) = rows.get_mut(j) else { return };
        if !counts(outputs, j, i == 0, end) {
            return;
        }
        let goal = outputs.goal(i, j);
        let constant = Linear::about(motion, y, by_x, by_u).constant;
        // Negated, so that what is not finite is no row: the cost of such a plan is none either.
        if !constant.is_finite() {
            *row = GeneralRow::default();
            return;
        }
        *row = GeneralRow {
            x: *by_x,
            u: *by_u,
            lower: without_rounding([goal.lower, -constant]),
            upper: without_rounding([goal.upper, -constant]),
            soft: goal.soft.or(elastic).map(half),
        };
    });
}

/// How many rows the outputs take at each stage.
pub(crate) fn rows<T: Scalar, const NX: usize, const NU: usize, D: CostByStage<T, NX, NU>>(
    own: &D,
) -> usize {
    let outputs = own.outputs();
    outputs.map_or(0, |outputs| outputs.bounded().min(outputs.count()))
}
