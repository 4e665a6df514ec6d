//! From bounds to rows: which bound is violated most, and what it looks like in terms of the
//! normalised deviations v. Rows are formed only when they are violated.

use crate::model::Scalar;
use crate::ocp::{Bounds, Ocp, Penalty, SoftBounds, Stage, Terminal};
use crate::products::{are_in_vectors, in_vectors};
use crate::riccati::StageFactor;
use crate::small_matrix::{add_product, product, transposed, transposed_times};
use crate::solution::{ActiveRow, BoundId, Part, Quantity, Side};
use crate::working_set::{Row, Terms, first};
use nalgebra::{SVector, convert};

/// A trajectory of the problem: x_1.. and u_0..
pub(crate) struct Trajectory<'a, T, const NX: usize, const NU: usize> {
    pub x: &'a [SVector<T, NX>],
    pub u: &'a [SVector<T, NU>],
}

impl<T: Scalar, const NX: usize, const NU: usize> Trajectory<'_, T, NX, NU> {
    /// x_`stage`, from 0 to the horizon.
    pub fn state(&self, ocp: &Ocp<T, NX, NU>, stage: usize) -> SVector<T, NX> {
        let later = stage.checked_sub(1).and_then(|before| self.x.get(before));
        *later.unwrap_or(&ocp.x0)
    }
}

/// A bound's value beside its limit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Candidate<T> {
    pub bound: BoundId,
    pub part: Part,
    pub soft: Option<Penalty<T>>,
    /// Distance inside the bound; negative outside.
    pub slack: T,
    /// Lower and upper limit.
    pub limits: (T, T),
    /// `-slack` in units of the bound's room: by what candidates are ranked.
    pub rank: T,
}

impl<T: Scalar> Candidate<T> {
    /// `-slack` in units of the bound's own size: what is compared with the tolerance.
    pub fn violation(&self) -> T {
        self.slack.abs() / size_of_bound(self.limits.0, self.limits.1)
    }
}

/// The size by which violations are ranked: half the width of the bound, which does not depend on
/// where zero is; where one side is infinite, the bound's own size.
fn room_of_bound<T: Scalar>(lower: T, upper: T) -> T {
    let half = (upper - lower) * convert::<f64, T>(0.5);
    if half > T::zero() && half.is_finite() {
        half
    } else {
        size_of_bound(lower, upper)
    }
}

/// Limits of this magnitude, and of so many times the other one, stand for none.
const FAR: f64 = 1e10;
/// And of this one, whatever the other is: programs without infinity write none as 1e20 or 1e30.
const NONE: f64 = 1e20;

/// Whether what is bounded stops at this limit.
pub(crate) fn is_limit<T: Scalar>(limit: T) -> bool {
    limit.abs() < convert(NONE)
}

/// The size against which a violation is measured: the larger limit, or 1, but for one that is so far away that it
/// stands for none.
pub(crate) fn size_of_bound<T: Scalar>(lower: T, upper: T) -> T {
    let (lower, upper) = (lower.abs(), upper.abs());
    let (near, far) = (lower.min(upper), lower.max(upper));
    let counts = far < near.max(T::one()) * convert(FAR) && far.is_finite();
    let size = if counts { far } else { near };
    match size > T::zero() && size.is_finite() {
        true => size,
        false => T::one(),
    }
}

/// Offers every violated side of `bounds` at `value` to `visit`. NaN counts as violated.
#[inline(always)]
fn violated_sides<T: Scalar, const K: usize>(
    bounds: &Bounds<T, K>,
    soft: &SoftBounds<T, K>,
    value: &SVector<T, K>,
    stage: usize,
    quantity: fn(usize) -> Quantity,
    visit: &mut impl FnMut(Candidate<T>),
) {
    // Most hold, which is not worth a call.
    if !bounds.hold_at(value) {
        visit_violated(bounds, soft, value, stage, quantity, visit);
    }
}

#[inline(never)]
fn visit_violated<T: Scalar, const K: usize>(
    bounds: &Bounds<T, K>,
    soft: &SoftBounds<T, K>,
    value: &SVector<T, K>,
    stage: usize,
    quantity: fn(usize) -> Quantity,
    visit: &mut impl FnMut(Candidate<T>),
) {
    // As arrays, whose loop is a fraction of one over the vectors' own iterators.
    let (lower, upper, value) = (
        &bounds.lower.data.0[0],
        &bounds.upper.data.0[0],
        &value.data.0[0],
    );
    let sides = lower.iter().zip(upper);
    for (index, ((v, (lower, upper)), soft)) in value.iter().zip(sides).zip(soft).enumerate() {
        violated_side(*v, (*lower, *upper), soft, stage, quantity, index, visit);
    }
}

/// Offers each side to `visit` beyond which `value` is.
#[inline(always)]
fn violated_side<T: Scalar>(
    value: T,
    (lower, upper): (T, T),
    soft: &Option<Penalty<T>>,
    stage: usize,
    quantity: fn(usize) -> Quantity,
    index: usize,
    visit: &mut impl FnMut(Candidate<T>),
) {
    if value >= lower && value <= upper {
        return;
    }
    for (side, slack) in [(Side::Lower, value - lower), (Side::Upper, upper - value)] {
        if slack >= T::zero() {
            continue;
        }
        visit(Candidate {
            bound: BoundId {
                stage,
                quantity: quantity(index),
                side,
            },
            part: Part::Hard,
            soft: *soft,
            slack,
            limits: (lower, upper),
            rank: -slack / room_of_bound(lower, upper),
        });
    }
}

/// Offers every violated bound of the problem on the trajectory to `visit`.
pub(crate) fn violated_bounds<T: Scalar, const NX: usize, const NU: usize>(
    ocp: &Ocp<T, NX, NU>,
    trajectory: &Trajectory<'_, T, NX, NU>,
    visit: &mut impl FnMut(Candidate<T>),
) {
    let n = ocp.length();
    let mut x = &ocp.x0;
    let steps = first(trajectory.x, n).iter().zip(trajectory.u);
    for (i, (x_next, u)) in steps.enumerate() {
        let bounds = ocp.common_at(i);
        if i > 0 {
            violated_sides(&bounds.x, &bounds.soft_x, x, i, Quantity::State, visit);
        }
        violated_sides(&bounds.u, &[None; NU], u, i, Quantity::Input, visit);
        violated_rows(ocp, i, x, Some(u), visit);
        x = x_next;
    }
    let Terminal {
        x: bounds, soft_x, ..
    } = &ocp.terminal;
    violated_sides(bounds, soft_x, x, n, Quantity::State, visit);
    violated_rows(ocp, n, x, None, visit);
}

/// Offers every violated side of the general rows of a stage to `visit`.
#[inline(always)]
fn violated_rows<T: Scalar, const NX: usize, const NU: usize>(
    ocp: &Ocp<T, NX, NU>,
    stage: usize,
    x: &SVector<T, NX>,
    u: Option<&SVector<T, NU>>,
    visit: &mut impl FnMut(Candidate<T>),
) {
    // Most programs have none, which is not worth a call.
    if ocp.rows_per_stage > 0 {
        visit_violated_rows(ocp, stage, x, u, visit);
    }
}

#[inline(never)]
fn visit_violated_rows<T: Scalar, const NX: usize, const NU: usize>(
    ocp: &Ocp<T, NX, NU>,
    stage: usize,
    x: &SVector<T, NX>,
    u: Option<&SVector<T, NU>>,
    visit: &mut impl FnMut(Candidate<T>),
) {
    for (j, row) in ocp.rows_of(stage).iter().enumerate() {
        let sides = (row.lower, row.upper);
        violated_side(
            row.value(x, u),
            sides,
            &row.soft,
            stage,
            Quantity::Row,
            j,
            visit,
        );
    }
}

/// The bound's normal: d(value)/dx and d(value)/du at its stage.
pub(crate) fn normal<T: Scalar, const NX: usize, const NU: usize>(
    ocp: &Ocp<T, NX, NU>,
    bound: &BoundId,
) -> (SVector<T, NX>, SVector<T, NU>) {
    match bound.quantity {
        Quantity::State(j) => (unit(j), SVector::zeros()),
        Quantity::Input(j) => (SVector::zeros(), unit(j)),
        Quantity::Row(j) => {
            let row = ocp.row(bound.stage, j);
            let (x, u) = row.map_or((SVector::zeros(), SVector::zeros()), |row| (row.x, row.u));
            let at_end = bound.stage >= ocp.length();
            (x, if at_end { SVector::zeros() } else { u })
        }
    }
}

fn unit<T: Scalar, const K: usize>(j: usize) -> SVector<T, K> {
    SVector::from_fn(|i, _| if i == j { T::one() } else { T::zero() })
}

/// The bound's slack on the trajectory; for an equality, value - target.
pub(crate) fn slack<T: Scalar, const NX: usize, const NU: usize>(
    ocp: &Ocp<T, NX, NU>,
    trajectory: &Trajectory<'_, T, NX, NU>,
    bound: &BoundId,
) -> T {
    let x = trajectory.state(ocp, bound.stage);
    let u = trajectory.u.get(bound.stage);
    let value = match bound.quantity {
        Quantity::State(j) => x.get(j).copied(),
        Quantity::Input(j) => u.and_then(|u| u.get(j)).copied(),
        Quantity::Row(j) => {
            let u = u.filter(|_| bound.stage < ocp.length());
            ocp.row(bound.stage, j).map(|row| row.value(&x, u))
        }
    };
    let value = value.unwrap_or(T::zero());
    let (lower, upper) = limits(ocp, bound);
    match bound.side {
        Side::Lower | Side::Equality => value - lower,
        Side::Upper => upper - value,
    }
}

/// The size against which a violation of `bound` is measured.
pub(crate) fn size<T: Scalar, const NX: usize, const NU: usize>(
    ocp: &Ocp<T, NX, NU>,
    bound: &BoundId,
) -> T {
    let (lower, upper) = limits(ocp, bound);
    size_of_bound(lower, upper)
}

/// The size by which a violation of `bound` is ranked.
pub(crate) fn room<T: Scalar, const NX: usize, const NU: usize>(
    ocp: &Ocp<T, NX, NU>,
    bound: &BoundId,
) -> T {
    let (lower, upper) = limits(ocp, bound);
    room_of_bound(lower, upper)
}

/// Lower and upper limit of the bounded quantity, both the target for an equality.
pub(crate) fn limits<T: Scalar, const NX: usize, const NU: usize>(
    ocp: &Ocp<T, NX, NU>,
    bound: &BoundId,
) -> (T, T) {
    if let (Side::Equality, Quantity::State(j), Some(target)) =
        (bound.side, bound.quantity, &ocp.terminal.equality)
    {
        return component(target, target, j);
    }
    let bounds = ocp.common_at(bound.stage);
    let at_end = bound.stage >= ocp.length();
    match bound.quantity {
        Quantity::State(j) => {
            let x = if at_end { &ocp.terminal.x } else { &bounds.x };
            component(&x.lower, &x.upper, j)
        }
        Quantity::Input(_) if at_end => unlimited(),
        Quantity::Input(j) => component(&bounds.u.lower, &bounds.u.upper, j),
        Quantity::Row(j) => {
            let row = ocp.row(bound.stage, j);
            row.map_or_else(unlimited, |row| (row.lower, row.upper))
        }
    }
}

fn component<T: Scalar, const K: usize>(
    lower: &SVector<T, K>,
    upper: &SVector<T, K>,
    j: usize,
) -> (T, T) {
    match (lower.get(j), upper.get(j)) {
        (Some(lower), Some(upper)) => (*lower, *upper),
        _ => unlimited(),
    }
}

fn unlimited<T: Scalar>() -> (T, T) {
    let infinity: T = convert(f64::INFINITY);
    (-infinity, infinity)
}

/// Writes the row of `bound` to `row`: one backward pass through the closed loop.
pub(crate) fn form_row<T: Scalar, const NX: usize, const NU: usize>(
    ocp: &Ocp<T, NX, NU>,
    factors: &[StageFactor<T, NX, NU>],
    bound: BoundId,
    part: Part,
    soft: Option<Penalty<T>>,
    row: &mut Row<T, NU>,
) {
    let (normal_x, normal_u) = normal(ocp, &bound);
    let sign = match bound.side {
        Side::Upper => -T::one(),
        Side::Lower | Side::Equality => T::one(),
    };
    let mut costate = normal_x * sign;
    row.alpha.fill(SVector::zeros());
    row.support = bound.stage.min(row.alpha.len());
    if let (Some(factor), Some(alpha)) = (factors.get(bound.stage), row.alpha.get_mut(bound.stage))
        && bound.stage < ocp.length()
    {
        *alpha = factor.inverse_factor * normal_u * sign;
        costate += factor.feedback.tr_mul(&normal_u) * sign;
        row.support += 1;
    }
    in_vectors(
        are_in_vectors(NX),
        #[inline(always)]
        || {
            let stages = ocp.stages.iter().zip(factors).zip(row.alpha.iter_mut());
            for ((stage, factor), alpha) in stages.take(bound.stage).rev() {
                *alpha = step_back(stage, factor, &mut costate);
            }
        },
    );
    let infinity: T = convert(f64::INFINITY);
    let (cap, compliance) = match (part, soft) {
        (Part::Linear, Some(penalty)) => (penalty.linear, T::zero()),
        (Part::Quadratic, Some(penalty)) => (infinity, T::one() / penalty.quadratic),
        _ => (infinity, T::zero()),
    };
    row.terms = Terms {
        cap,
        compliance,
        equality: bound.side == Side::Equality,
        active: ActiveRow {
            bound,
            part,
            ..ActiveRow::empty()
        },
        ..Terms::empty()
    };
}

/// Takes the derivative in the state behind a stage to the one in front of it, under the stage's policy;
/// returns the derivative in the stage's normalised deviation.
#[inline(always)]
pub(crate) fn step_back<T: Scalar, const NX: usize, const NU: usize>(
    stage: &Stage<T, NX, NU>,
    factor: &StageFactor<T, NX, NU>,
    costate: &mut SVector<T, NX>,
) -> SVector<T, NU> {
    let input = transposed_times(&stage.b, costate);
    *costate = transposed_times(&stage.a, costate);
    // In vectors a transposed matrix is gathered number by number.
    if are_in_vectors(NX) {
        *costate += transposed_times(&factor.feedback, &input);
    } else {
        add_product(costate, &transposed(&factor.feedback), &input);
    }
    product(&factor.inverse_factor, &input)
}

/// The gradient that the rows `active` at a stage add to the state and the input.
pub(crate) fn gradient<T: Scalar, const NX: usize, const NU: usize>(
    ocp: &Ocp<T, NX, NU>,
    active: impl Iterator<Item = ActiveRow<T>>,
) -> (SVector<T, NX>, SVector<T, NU>) {
    let mut gradient = (SVector::zeros(), SVector::zeros());
    for row in active {
        let (normal_x, normal_u) = normal(ocp, &row.bound);
        let factor = match row.bound.side {
            Side::Upper => row.multiplier,
            Side::Lower | Side::Equality => -row.multiplier,
        };
        gradient.0 += normal_x * factor;
        gradient.1 += normal_u * factor;
    }
    gradient
}

/// At which stages rows may be active, modulo 32: most stages have none, and need not be looked through.
#[derive(Clone, Copy, Default)]
pub(crate) struct Places(u32);

impl Places {
    pub fn add(&mut self, stage: usize) {
        self.0 |= 1 << (stage % 32);
    }

    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    pub fn may_be_at(self, stage: usize) -> bool {
        self.0 >> (stage % 32) & 1 == 1
    }
}

/// v -= sum of multiplier * alpha over the rows that are active at each stage, in one backward pass.
pub(crate) fn subtract<
    T: Scalar,
    const NX: usize,
    const NU: usize,
    Active: Iterator<Item = ActiveRow<T>>,
>(
    ocp: &Ocp<T, NX, NU>,
    factors: &[StageFactor<T, NX, NU>],
    places: Places,
    active_at: impl Fn(usize) -> Active,
    v: &mut [SVector<T, NU>],
) {
    let n = ocp.length();
    let mut costate = SVector::zeros();
    for i in (0..=n).rev() {
        let stage = ocp.stages.get(i).zip(factors.get(i)).filter(|_| i < n);
        let mut here = stage.zip(v.get_mut(i));
        if let Some(((stage, factor), v)) = &mut here {
            **v += step_back(stage, factor, &mut costate);
        }
        if places.may_be_at(i) {
            let (rows_x, rows_u) = gradient(ocp, active_at(i));
            costate += rows_x;
            if let Some(((_, factor), v)) = &mut here {
                **v += factor.inverse_factor * rows_u;
                costate += factor.feedback.tr_mul(&rows_u);
            }
        }
    }
}

/// The price of exceeding `bound`, if it is soft; a terminal equality is not, whatever the bound of its state is.
pub(crate) fn soft_price<T: Scalar, const NX: usize, const NU: usize>(
    ocp: &Ocp<T, NX, NU>,
    bound: &BoundId,
) -> Option<Penalty<T>> {
    if bound.side == Side::Equality {
        return None;
    }
    let at_end = bound.stage >= ocp.length();
    match bound.quantity {
        Quantity::State(j) if at_end => ocp.terminal.soft_x.get(j).copied().flatten(),
        Quantity::State(j) => ocp.common_at(bound.stage).soft_x.get(j).copied().flatten(),
        Quantity::Row(j) => ocp.row(bound.stage, j)?.soft,
        Quantity::Input(_) => None,
    }
}
