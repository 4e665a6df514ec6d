//! Plans as policies, their rollouts on the nonlinear model, and what a rollout costs.

use crate::by_stage::CostByStage;
use crate::controller::Reference;
use crate::cost::{excess, price};
use crate::list::List;
use crate::model::Scalar;
use crate::ocp::{Bounds, Penalty};
use crate::outputs;
use crate::settings::{ControllerSettings, TerminalIngredient, Weights};
use crate::small_matrix::product;
use crate::soft_bounds::SoftPrices;
use crate::solution::{ActiveSet, Quantity, Side};
use nalgebra::{SMatrix, SVector, convert};

/// What a sample's cost draws state and input to.
pub(crate) struct Aim<'a, T, const NX: usize, const NU: usize, D> {
    /// As it was given.
    pub reference: &'a Reference<'a, T, NX>,
    /// The steady state in its place, where it is the same at all stages.
    pub rest: Option<SVector<T, NX>>,
    /// The input that costs nothing, but where a stage has one of its own.
    pub u_ref: SVector<T, NU>,
    /// What the stages have of their own.
    pub own: D,
}

impl<T, const NX: usize, const NU: usize, D> Aim<'_, T, NX, NU, D>
where
    T: Scalar,
    D: CostByStage<T, NX, NU>,
{
    /// x_ref at stage `i`.
    #[inline(always)]
    pub fn at(&self, i: usize) -> &SVector<T, NX> {
        self.rest.as_ref().unwrap_or_else(|| self.reference.at(i))
    }

    /// u_ref at stage `i`.
    #[inline(always)]
    pub fn u_ref(&self, i: usize) -> &SVector<T, NU> {
        let own = if self.own.any() {
            self.own.u_ref(i)
        } else {
            None
        };
        own.unwrap_or(&self.u_ref)
    }

    /// What state and input cost at stage `i`, prices apart, with the `weights` of a stage that has
    /// none of its own.
    #[inline(always)]
    pub fn cost(
        &self,
        i: usize,
        (x, u): (&SVector<T, NX>, &SVector<T, NU>),
        weights: &Weights<T, NX, NU>,
    ) -> T {
        let (error, input) = (x - self.at(i), u - self.u_ref(i));
        let Weights { q, r } = self.own.weights(i).unwrap_or(weights);
        let cost = squared(q, &error) + squared(r, &input);
        if !self.own.any() {
            return cost;
        }
        let cross = self.own.cross(i).map(|s| input.dot(&(s * error)));
        let cross = cross.map_or(T::zero(), |half| half + half);
        cost + cross + self.linear_cost(i, x, Some(u))
    }

    /// The linear part of the cost of stage `i`; at the end of the horizon there is no input.
    pub fn linear_cost(&self, i: usize, x: &SVector<T, NX>, u: Option<&SVector<T, NU>>) -> T {
        let of_x = self.own.linear_x(i).map(|price| price.dot(x));
        let of_u = u.and_then(|u| self.own.linear_u(i).map(|price| price.dot(u)));
        of_x.unwrap_or_else(T::zero) + of_u.unwrap_or_else(T::zero)
    }

    /// The linear terms of stage `i` in a program, whose cost is half of J.
    pub fn linear_terms(
        &self,
        i: usize,
        weights: &Weights<T, NX, NU>,
    ) -> (SVector<T, NX>, SVector<T, NU>) {
        let Weights { q, r } = self.own.weights(i).unwrap_or(weights);
        let (x_ref, u_ref) = (self.at(i), self.u_ref(i));
        let (mut of_x, mut of_u) = (-product(q, x_ref), -product(r, u_ref));
        if let Some(s) = self.own.cross(i) {
            of_x -= s.tr_mul(u_ref);
            of_u -= s * x_ref;
        }
        let half: T = convert(0.5);
        of_x += self
            .own
            .linear_x(i)
            .map_or(SVector::zeros(), |price| price * half);
        of_u += self
            .own
            .linear_u(i)
            .map_or(SVector::zeros(), |price| price * half);
        (of_x, of_u)
    }

    /// x_ref at the end of the horizon.
    #[inline(always)]
    pub fn end(&self) -> &SVector<T, NX> {
        self.rest.as_ref().unwrap_or(&self.reference.terminal)
    }
}

/// How a plan is followed: stage i has the input u_i + K_i (x - x_i). The states x_i are the
/// controller's rollout.
#[derive(Debug)]
#[cfg_attr(feature = "alloc", derive(Clone))]
pub(crate) struct Policy<T: 'static, const NX: usize, const NU: usize> {
    /// u_0 to u_{N-1}.
    pub u: List<SVector<T, NU>>,
    /// K_0 to K_{N-1}.
    pub feedback: List<SMatrix<T, NU, NX>>,
    /// The merit of the plan.
    pub cost: T,
    /// Extra cost of (u - u_i)^2 in the next program along the plan.
    pub damping: T,
    /// Whether the embedding has turns: since the plan was begun, none of its programs has brought
    /// nothing. Once one has, the plan is too near for it.
    pub far: bool,
}

impl<T: Scalar, const NX: usize, const NU: usize> Policy<T, NX, NU> {
    pub fn new(u: List<SVector<T, NU>>, feedback: List<SMatrix<T, NU, NX>>) -> Self {
        Self {
            u,
            feedback,
            cost: T::zero(),
            damping: T::zero(),
            far: true,
        }
    }
}

/// A rollout that may become the plan: inputs, and the states x_1 to x_N that follow.
#[derive(Debug)]
#[cfg_attr(feature = "alloc", derive(Clone))]
pub(crate) struct Trial<T: 'static, const NX: usize, const NU: usize> {
    pub u: List<SVector<T, NU>>,
    pub x: List<SVector<T, NX>>,
}

/// The entry of stage `i`; beyond the last, the last.
#[inline(always)]
pub(crate) fn at<T: Scalar, const R: usize, const C: usize>(
    list: &[SMatrix<T, R, C>],
    i: usize,
) -> SMatrix<T, R, C> {
    let entry = list.get(i).or(list.last());
    entry.copied().unwrap_or_else(SMatrix::zeros)
}

/// Prices per unit of what must not be: an exact penalty has them above the multipliers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Prices<T, const NX: usize> {
    /// Of exceeding a hard state bound.
    pub bounds: SVector<T, NX>,
    /// Of missing the terminal equality.
    pub end: SVector<T, NX>,
    /// Of exceeding a hard general row, whichever.
    pub rows: T,
}

impl<T: Scalar, const NX: usize> Prices<T, NX> {
    pub fn none() -> Self {
        Self {
            bounds: SVector::zeros(),
            end: SVector::zeros(),
            rows: T::zero(),
        }
    }

    /// Raises them above the multipliers of a program, whose cost is half of J.
    pub fn raise(&mut self, active: &ActiveSet<T>) {
        const FACTOR: f64 = 4.0;
        for row in active.iter() {
            let price = match (row.bound.quantity, row.bound.side) {
                (Quantity::State(j), Side::Equality) => self.end.get_mut(j),
                (Quantity::State(j), _) => self.bounds.get_mut(j),
                (Quantity::Row(_), _) => Some(&mut self.rows),
                (Quantity::Input(_), _) => None,
            };
            if let Some(price) = price {
                *price = price.max(row.multiplier.abs() * convert(FACTOR));
            }
        }
    }
}

/// The merit of a trajectory: the cost J, with an exact penalty for what must not be.
pub(crate) struct Merit<'a, T, const NX: usize, const NU: usize, D> {
    weights: Weights<T, NX, NU>,
    terminal: TerminalIngredient<T, NX>,
    bounds: Bounds<T, NX>,
    soft: SoftPrices<T, NX>,
    horizon: usize,
    pub aim: &'a Aim<'a, T, NX, NU, D>,
    prices: Prices<T, NX>,
}

impl<'a, T, const NX: usize, const NU: usize, D> Merit<'a, T, NX, NU, D>
where
    T: Scalar,
    D: CostByStage<T, NX, NU>,
{
    pub fn new<const NS: usize>(
        settings: &ControllerSettings<T, NX, NU, NS>,
        soft: &SoftPrices<T, NX>,
        aim: &'a Aim<'a, T, NX, NU, D>,
        prices: Prices<T, NX>,
    ) -> Self {
        Self {
            weights: settings.weights,
            terminal: *aim.own.terminal().unwrap_or(&settings.terminal),
            bounds: settings.x,
            soft: *soft,
            horizon: settings.horizon,
            aim,
            prices,
        }
    }

    /// Of the input `u` at the state `x` at stage `i`. The state at stage 0 is given: its bounds
    /// count nothing.
    // Once in the machine code of a microcontroller, for its flash.
    #[cfg_attr(target_arch = "arm", inline(never))]
    #[cfg_attr(not(target_arch = "arm"), inline(always))]
    pub fn stage(&self, i: usize, x: &SVector<T, NX>, u: &SVector<T, NU>) -> T {
        self.stage_along(i, x, u, None)
    }

    /// The same with outputs that are linear `about` a plan's state and input.
    #[inline(always)]
    fn stage_along(
        &self,
        i: usize,
        x: &SVector<T, NX>,
        u: &SVector<T, NU>,
        about: Option<(&SVector<T, NX>, &SVector<T, NU>)>,
    ) -> T {
        let mut cost = self.aim.cost(i, (x, u), &self.weights);
        if self.aim.own.any() {
            cost += self.price_of_rows(i, x, Some(u)) + self.of_outputs(i, (x, Some(u)), about);
        }
        if i > 0 {
            cost + self.excess(i, x)
        } else {
            cost
        }
    }

    /// Of the state `x` at the end of the horizon.
    #[cfg_attr(target_arch = "arm", inline(never))]
    #[cfg_attr(not(target_arch = "arm"), inline(always))]
    pub fn end(&self, x: &SVector<T, NX>) -> T {
        self.end_along(x, None)
    }

    /// The same with outputs that are linear `about` a plan's state.
    #[inline(always)]
    fn end_along(&self, x: &SVector<T, NX>, about: Option<&SVector<T, NX>>) -> T {
        let error = x - self.aim.end();
        let cost = match &self.terminal {
            TerminalIngredient::Cost(p) => squared(p, &error),
            TerminalIngredient::Equality => error.abs().dot(&self.prices.end),
        };
        let cost = cost + self.excess(self.horizon, x);
        if self.aim.own.any() {
            let linear = self.aim.linear_cost(self.horizon, x, None);
            let still = SVector::zeros();
            let about = about.map(|about| (about, &still));
            let outputs = self.of_outputs(self.horizon, (x, None), about);
            cost + linear + self.price_of_rows(self.horizon, x, None) + outputs
        } else {
            cost
        }
    }

    /// Of the inputs `u` and the states `x`_1 to `x`_N that follow `x0`.
    pub fn of(&self, x0: &SVector<T, NX>, u: &[SVector<T, NU>], x: &[SVector<T, NX>]) -> T {
        let mut before = x0;
        let mut total = T::zero();
        for (i, (u, next)) in u.iter().zip(x).enumerate().take(self.horizon) {
            total += self.stage(i, before, u);
            before = next;
        }
        total + self.end(before)
    }

    /// Of the answer `u` and `x` of a program along the plan `about`: of what the program expects of outputs, which
    /// are linear there.
    pub fn of_answer(
        &self,
        x0: &SVector<T, NX>,
        (u, x): (&[SVector<T, NU>], &[SVector<T, NX>]),
        about: (&[SVector<T, NU>], &[SVector<T, NX>]),
    ) -> T {
        if self.aim.own.outputs().is_none() {
            return self.of(x0, u, x);
        }
        let (mut before, mut planned) = (x0, x0);
        let mut total = T::zero();
        let stages = u.iter().zip(x).zip(about.0.iter().zip(about.1));
        for (i, ((u, next), (u_plan, next_plan))) in stages.enumerate().take(self.horizon) {
            total += self.stage_along(i, before, u, Some((planned, u_plan)));
            (before, planned) = (next, next_plan);
        }
        total + self.end_along(before, Some(planned))
    }

    /// What the outputs of stage `i` cost, with the prices of their bounds.
    fn of_outputs(
        &self,
        i: usize,
        motion: (&SVector<T, NX>, Option<&SVector<T, NU>>),
        about: Option<(&SVector<T, NX>, &SVector<T, NU>)>,
    ) -> T {
        let outputs = self.aim.own.outputs();
        outputs.map_or(T::zero(), |outputs| {
            outputs::merit(outputs, i, motion, about, self.price_of_row(None))
        })
    }

    /// How far the linear costs below zero bring the merit down, twice: what is added to the merit
    /// for the sum of the magnitudes of its parts.
    pub fn negative(&self, x0: &SVector<T, NX>, u: &[SVector<T, NU>], x: &[SVector<T, NX>]) -> T {
        if !self.aim.own.has_linear_costs() {
            return T::zero();
        }
        let states = core::iter::once(x0).chain(x);
        let inputs = u.iter().map(Some).take(self.horizon).chain([None]);
        let stages = states.zip(inputs).enumerate();
        stages.fold(T::zero(), |sum, (i, (x, u))| {
            let linear = self.aim.linear_cost(i, x, u);
            sum + linear.abs() - linear
        })
    }

    /// The price of the state bounds of stage `i` that `x` exceeds.
    #[inline(always)]
    fn excess(&self, i: usize, x: &SVector<T, NX>) -> T {
        if self.bounds(i).hold_at(x) {
            T::zero()
        } else {
            self.price_of_excess(i, x)
        }
    }

    #[inline(always)]
    fn bounds(&self, i: usize) -> &Bounds<T, NX> {
        self.aim.own.x(i).unwrap_or(&self.bounds)
    }

    #[cold]
    #[inline(never)]
    fn price_of_excess(&self, i: usize, x: &SVector<T, NX>) -> T {
        let bounds = self.bounds(i);
        let soft = self.soft.of(self.aim.own.soft_x(i));
        let mut total = price(&soft, x, bounds);
        let sides = bounds.lower.iter().zip(bounds.upper.iter());
        let values = soft.iter().zip(x.iter()).zip(sides);
        for (((soft, v), (lower, upper)), price) in values.zip(self.prices.bounds.iter()) {
            if soft.is_none() {
                total += excess(*v, *lower, *upper) * *price;
            }
        }
        total
    }

    /// The price of the general rows of stage `i` that `x` and `u` exceed.
    fn price_of_rows(&self, i: usize, x: &SVector<T, NX>, u: Option<&SVector<T, NU>>) -> T {
        let rows = self.aim.own.rows(i).iter();
        let counting = rows.filter(|row| row.counts(i == 0, u.is_none()));
        counting.fold(T::zero(), |total, row| {
            let beyond = excess(row.value(x, u), row.lower, row.upper);
            total + self.price_of_row(row.soft).of(beyond)
        })
    }

    /// The price of a general row; of a hard one, that of hard ones.
    fn price_of_row(&self, soft: Option<Penalty<T>>) -> Penalty<T> {
        soft.or(self.soft.of_rows()).unwrap_or(Penalty {
            linear: self.prices.rows,
            quadratic: T::zero(),
        })
    }
}

/// v'Wv
// Once in the machine code of a microcontroller, for its flash.
#[cfg_attr(target_arch = "arm", inline(never))]
#[cfg_attr(not(target_arch = "arm"), inline(always))]
pub(crate) fn squared<T: Scalar, const K: usize>(
    weight: &SMatrix<T, K, K>,
    v: &SVector<T, K>,
) -> T {
    product(weight, v).dot(v)
}
