//! The unknowns of the interior-point method: of both sides of a bound side by side, so that the machine works them out
//! together.

use super::way::{Foretold, Left, Part, Sums};
use crate::many_bounds::side::{BoundSide, Role};
use crate::many_bounds::weighted::Weighted;
use crate::model::Scalar;
use crate::solution::{Quantity, Side};
use nalgebra::convert;

/// Where a step leaves half of a slack, but for less than this, it leaves as much of the multiplier, and does not say
/// clearly which of them goes to zero.
const UNDECIDED: f64 = 0.2;

/// A side's unknowns, all above zero, or where a step is to take them.
#[derive(Clone, Copy, Debug)]
pub(in crate::many_bounds) struct Interior<T> {
    /// d + s.
    pub slack: T,
    pub multiplier: T,
    /// s, of a soft side.
    pub excess: T,
    /// Multiplier of s >= 0.
    pub rest: T,
}

impl<T: Scalar> Interior<T> {
    /// What goes to zero.
    pub fn product(&self) -> T {
        self.slack * self.multiplier + self.excess * self.rest
    }
}

/// What a side is to come to in a Newton step: slack * multiplier, and excess * rest.
#[derive(Clone, Copy, Debug)]
pub(super) struct Target<T> {
    pub slack: T,
    pub excess: T,
}

impl<T: Scalar> Target<T> {
    fn zero() -> Self {
        Self {
            slack: T::zero(),
            excess: T::zero(),
        }
    }
}

/// What it costs to exceed a side: `linear` s + `quadratic` s^2 / 2. The first of a side that is hard, or not there, is infinite.
#[derive(Clone, Copy)]
struct Price<T> {
    linear: T,
    quadratic: T,
}

impl<T: Scalar> Price<T> {
    #[inline(always)]
    fn is_soft(&self) -> bool {
        self.linear < convert(f64::INFINITY)
    }
}

/// Multiplier of a side at d = 0 in a Newton step towards `target`, and how fast it falls with d.
#[inline(always)]
fn multiplier<T: Scalar, const SOFT: bool>(
    at: &Interior<T>,
    inverse: &Interior<T>,
    price: Price<T>,
    target: Target<T>,
) -> (T, T) {
    let of = |inverse: T, multiplier: T, target: T| {
        (multiplier + target * inverse, multiplier * inverse)
    };
    let (base, weight) = of(inverse.slack, at.multiplier, target.slack);
    if !SOFT {
        return (base, weight);
    }
    // Worked out for a side that is not there, too: a choice between two numbers is no branch.
    let (base_of_rest, weight_of_rest) = of(inverse.excess, at.rest, target.excess);
    let rest = price.quadratic + weight_of_rest;
    let share = weight / (weight + rest);
    let base_of_soft = base - share * (base + base_of_rest - price.linear);
    (
        if price.is_soft() { base_of_soft } else { base },
        if price.is_soft() {
            share * rest
        } else {
            weight
        },
    )
}

/// What a side comes to in that step at the distance d, where its multiplier is this.
#[inline(always)]
fn step_to<T: Scalar, const SOFT: bool>(
    at: &Interior<T>,
    inverse: &Interior<T>,
    price: Price<T>,
    target: Target<T>,
    (distance, multiplier): (T, T),
) -> Interior<T> {
    if !SOFT {
        return Interior {
            slack: distance,
            multiplier,
            excess: T::zero(),
            rest: T::zero(),
        };
    }
    // The products' linearisation, and how slack and excess, and both multipliers, belong together.
    let soft = price.is_soft();
    let slack_of_soft = at.slack + (target.slack - at.slack * multiplier) * inverse.multiplier;
    let slack = if soft { slack_of_soft } else { distance };
    let excess = slack - distance;
    let rest = price.linear + price.quadratic * excess - multiplier;
    Interior {
        slack,
        multiplier,
        excess,
        rest: if soft { rest } else { T::zero() },
    }
}

/// The unknowns of a bound, those of its lower and of its upper side. A side that is not there has the slack one, all else of
/// it is zero, and a step changes nothing.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BoundUnknowns<T> {
    stage: usize,
    quantity: Quantity,
    soft: bool,
    /// The roles that the last prediction foretells.
    role: [Role; 2],
    /// One, or zero where there is no such side.
    bounded: [T; 2],
    limit: [T; 2],
    slack: [T; 2],
    multiplier: [T; 2],
    /// One divided by each.
    inverse_slack: [T; 2],
    inverse_multiplier: [T; 2],
    /// Multiplier at d = 0, and how fast it falls with d.
    base: [T; 2],
    weight: [T; 2],
    /// d on the trajectory at hand.
    distance: [T; 2],
    /// What slack * multiplier is to come to; after a prediction, the product of their changes.
    target: [T; 2],
    /// The price of exceeding them.
    linear: [T; 2],
    quadratic: [T; 2],
    excess: [T; 2],
    rest: [T; 2],
    inverse_excess: [T; 2],
    inverse_rest: [T; 2],
    /// The same as `target`, of excess * rest.
    target_of_excess: [T; 2],
}

impl<T: Scalar> Weighted<T> for BoundUnknowns<T> {
    #[inline(always)]
    fn stage(&self) -> usize {
        self.stage
    }

    #[inline(always)]
    fn quantity(&self) -> Quantity {
        self.quantity
    }

    #[inline(always)]
    fn weight_and_pull(&self) -> (T, T) {
        let ([lower, upper], [base, base_of_upper], [limit, limit_of_upper]) =
            (self.weight, self.base, self.limit);
        (
            lower + upper,
            (base + lower * limit) - (base_of_upper - upper * limit_of_upper),
        )
    }

    #[inline(always)]
    fn held_input(&self) -> Option<T> {
        None
    }
}

/// Calls the method for hard or for soft bounds.
macro_rules! by_kind {
    ($bound:expr, $method:ident($($argument:expr),*)) => {
        match $bound.soft {
            false => $bound.$method::<false>($($argument),*),
            true => $bound.$method::<true>($($argument),*),
        }
    };
}

/// Slack, multiplier, excess and rest of a side, out of those of both; of a hard one the last two are zero.
#[inline(always)]
fn of_side<T: Scalar, const SOFT: bool>(each: [&[T; 2]; 4], k: usize) -> Interior<T> {
    let [slack, multiplier, excess, rest] = each.map(|both| both[k]);
    let zero = T::zero();
    Interior {
        slack,
        multiplier,
        excess: if SOFT { excess } else { zero },
        rest: if SOFT { rest } else { zero },
    }
}

/// Where a bound has the unknowns of a side.
fn place_of(side: Side) -> usize {
    match side {
        Side::Upper => 1,
        _ => 0,
    }
}

/// What there is to know of a side.
pub(in crate::many_bounds) struct Known<T> {
    pub at: Interior<T>,
    /// The role that the last prediction foretells,
    pub role: Role,
    /// and where it takes the multiplier.
    pub predicted: T,
}

impl<T: Scalar> BoundUnknowns<T> {
    /// Those of nothing.
    pub fn empty() -> Self {
        Self::new(0, Quantity::State(0))
    }

    /// Those of a bound without sides.
    pub(super) fn new(stage: usize, quantity: Quantity) -> Self {
        let zeros = [T::zero(); 2];
        Self {
            stage,
            quantity,
            soft: false,
            role: [Role::Free; 2],
            bounded: zeros,
            limit: zeros,
            slack: [T::one(); 2],
            multiplier: zeros,
            inverse_slack: [T::one(); 2],
            inverse_multiplier: zeros,
            base: zeros,
            weight: zeros,
            distance: [T::one(); 2],
            target: zeros,
            linear: [convert(f64::INFINITY); 2],
            quadratic: zeros,
            excess: zeros,
            rest: zeros,
            inverse_excess: zeros,
            inverse_rest: zeros,
            target_of_excess: zeros,
        }
    }

    /// Takes up a side.
    pub(super) fn set(&mut self, side: &BoundSide<T>, at: &Interior<T>) {
        let k = place_of(side.bound.side);
        self.soft = side.soft.is_some();
        self.bounded[k] = T::one();
        self.limit[k] = side.limit;
        self.linear[k] = side.price();
        self.quadratic[k] = side.curvature();
        self.slack[k] = at.slack;
        self.multiplier[k] = at.multiplier;
        self.excess[k] = at.excess;
        self.rest[k] = at.rest;
    }

    /// What there is to know of a side.
    pub(super) fn known(&self, side: Side) -> Known<T> {
        let k = place_of(side);
        Known {
            at: self.at::<true>(k),
            role: self.role[k],
            predicted: self.base[k] - self.weight[k] * self.distance[k],
        }
    }

    /// Gives the sides the cost that they have in a Newton step towards complementarity zero.
    pub(super) fn weigh(&mut self) {
        by_kind!(self, weigh_as());
    }

    /// What becomes of the sides in a step towards complementarity zero that takes the quantity to `value`.
    #[inline(always)]
    pub(super) fn foretell(&mut self, value: T, sums: &mut Sums<T>, foretold: &mut Foretold) {
        self.measure(value);
        by_kind!(self, foretell_as(sums, foretold));
    }

    /// Aims at the `target` that follows from the one before; the derivative of what that adds to the costs, in the quantity.
    #[inline(always)]
    pub(super) fn aim(&mut self, target: &impl Fn(Target<T>) -> Target<T>) -> T {
        by_kind!(self, aim_as(target))
    }

    /// What the step to the target, which takes the quantity to `value`, leaves of the unknowns.
    #[inline(always)]
    pub(super) fn keep_above_zero(&mut self, value: T, left: &mut Left<T>) {
        self.measure(value);
        by_kind!(self, keep_above_zero_as(left));
    }

    /// Goes a part of that way and weighs the sides anew; adds up their products of slack and multiplier.
    #[inline(always)]
    pub(super) fn advance(&mut self, part: Part<T>, sum: &mut [T; 2]) {
        by_kind!(self, advance_as(part, sum));
    }

    #[inline(always)]
    fn measure(&mut self, value: T) {
        let [limit, limit_of_upper] = self.limit;
        let distance = [value - limit, limit_of_upper - value];
        for (k, distance) in distance.into_iter().enumerate() {
            let bounded = self.bounded[k] > T::zero();
            self.distance[k] = if bounded { distance } else { T::one() };
        }
    }

    #[inline(always)]
    fn at<const SOFT: bool>(&self, k: usize) -> Interior<T> {
        let each = [&self.slack, &self.multiplier, &self.excess, &self.rest];
        of_side::<T, SOFT>(each, k)
    }

    /// One divided by each of them.
    #[inline(always)]
    fn inverse<const SOFT: bool>(&self, k: usize) -> Interior<T> {
        let (slack, multiplier) = (&self.inverse_slack, &self.inverse_multiplier);
        let each = [slack, multiplier, &self.inverse_excess, &self.inverse_rest];
        of_side::<T, SOFT>(each, k)
    }

    #[inline(always)]
    fn price(&self, k: usize) -> Price<T> {
        Price {
            linear: self.linear[k],
            quadratic: self.quadratic[k],
        }
    }

    #[inline(always)]
    fn target<const SOFT: bool>(&self, k: usize) -> Target<T> {
        Target {
            slack: self.target[k],
            excess: if SOFT {
                self.target_of_excess[k]
            } else {
                T::zero()
            },
        }
    }

    #[inline(always)]
    fn set_target<const SOFT: bool>(&mut self, k: usize, target: Target<T>) {
        self.target[k] = target.slack * self.bounded[k];
        if SOFT {
            self.target_of_excess[k] = target.excess;
        }
    }

    #[inline(always)]
    fn step_to<const SOFT: bool>(&self, k: usize, target: Target<T>) -> Interior<T> {
        let multiplier = self.base[k] - self.weight[k] * self.distance[k];
        let at = self.at::<SOFT>(k);
        let inverse = self.inverse::<SOFT>(k);
        let there = (self.distance[k], multiplier);
        step_to::<T, SOFT>(&at, &inverse, self.price(k), target, there)
    }

    #[inline(always)]
    fn weigh_as<const SOFT: bool>(&mut self) {
        for k in 0..2 {
            let at = self.at::<SOFT>(k);
            self.inverse_slack[k] = T::one() / at.slack;
            self.inverse_multiplier[k] = T::one() / at.multiplier;
            if SOFT {
                self.inverse_excess[k] = T::one() / at.excess;
                self.inverse_rest[k] = T::one() / at.rest;
            }
            let inverse = self.inverse::<SOFT>(k);
            (self.base[k], self.weight[k]) =
                multiplier::<T, SOFT>(&at, &inverse, self.price(k), Target::zero());
        }
    }

    #[inline(always)]
    fn foretell_as<const SOFT: bool>(&mut self, sums: &mut Sums<T>, foretold: &mut Foretold) {
        let [mut left, mut left_of_excess] = [[T::zero(); 2]; 2];
        for k in 0..2 {
            let (at, inverse) = (self.at::<SOFT>(k), self.inverse::<SOFT>(k));
            let to = self.step_to::<SOFT>(k, Target::zero());
            left[k] = to.slack * inverse.slack;
            self.target[k] = sums.add(k, left[k], at.slack * at.multiplier);
            if SOFT {
                let soft = self.price(k).is_soft();
                left_of_excess[k] = if soft {
                    to.excess * inverse.excess
                } else {
                    T::zero()
                };
                let product = at.excess * at.rest;
                self.target_of_excess[k] = sums.add(k, left_of_excess[k], product);
            }
        }
        let [undecided, half] = [UNDECIDED, 0.5].map(convert::<f64, T>);
        for ((left, left_of_excess), last) in left.iter().zip(&left_of_excess).zip(&mut self.role) {
            let role = match (*left_of_excess > half, *left < half) {
                (true, _) => Role::Exceeded,
                (false, true) => Role::Held,
                (false, false) => Role::Free,
            };
            foretold.undecided += usize::from((*left - half).abs() < undecided);
            foretold.changed += usize::from(role != *last);
            foretold.active += usize::from(role != Role::Free);
            *last = role;
        }
    }

    #[inline(always)]
    fn aim_as<const SOFT: bool>(&mut self, target: &impl Fn(Target<T>) -> Target<T>) -> T {
        let before = self.base;
        for k in 0..2 {
            self.set_target::<SOFT>(k, target(self.target::<SOFT>(k)));
            let (at, inverse) = (self.at::<SOFT>(k), self.inverse::<SOFT>(k));
            let target = self.target::<SOFT>(k);
            (self.base[k], _) = multiplier::<T, SOFT>(&at, &inverse, self.price(k), target);
        }
        let [lower, upper] = self.base;
        (upper - before[1]) - (lower - before[0])
    }

    #[inline(always)]
    fn keep_above_zero_as<const SOFT: bool>(&self, left: &mut Left<T>) {
        for k in 0..2 {
            let to = self.step_to::<SOFT>(k, self.target::<SOFT>(k));
            left.add(k, &self.inverse::<SOFT>(k), &to, SOFT);
        }
    }

    #[inline(always)]
    fn advance_as<const SOFT: bool>(&mut self, part: Part<T>, sum: &mut [T; 2]) {
        let Part { primal, dual } = part;
        for (k, sum) in sum.iter_mut().enumerate() {
            let to = self.step_to::<SOFT>(k, self.target::<SOFT>(k));
            self.slack[k] += (to.slack - self.slack[k]) * primal;
            self.multiplier[k] += (to.multiplier - self.multiplier[k]) * dual;
            if SOFT {
                self.excess[k] += (to.excess - self.excess[k]) * primal;
                self.rest[k] += (to.rest - self.rest[k]) * dual;
            }
            *sum += self.at::<SOFT>(k).product();
        }
        self.weigh_as::<SOFT>();
    }
}
