//! The interior-point method (Mehrotra's predictor and corrector) on the Riccati factors, until it can be
//! told which bounds will be active.
//!
//! Every side has a slack and a multiplier above zero; a soft one its excess, with a multiplier, too. A
//! Newton step towards slack * multiplier = target is a linear-quadratic program in which each side acts
//! with a multiplier that is linear in its distance.

use super::newton;
use super::side::{BoundSide, Interior, Role, Target};
use crate::model::Scalar;
use crate::ocp::Ocp;
use crate::riccati::{BadPivot, StageFactor};
use crate::rows::Trajectory;
use nalgebra::{SVector, convert};

/// Part of the way to the nearest zero that a step may take.
const NEARLY: f64 = 0.995;

/// Least slack and excess to begin with, as a part of the bound's size.
const LEAST: f64 = 1.0;

/// The program of a Newton step, of one side.
#[derive(Clone, Copy)]
struct Linear<T> {
    /// Multiplier of d + s at zero, and its slope; the same of s.
    of_slack: (T, T),
    of_excess: (T, T),
    /// Linear price, and the slope of d(cost)/ds with all of its terms; none for a hard side.
    soft: Option<(T, T)>,
}

impl<T: Scalar> Linear<T> {
    fn new(side: &BoundSide<T>, target: Target<T>) -> Self {
        let at = &side.interior;
        let of =
            |value: T, multiplier: T, target: T| (multiplier + target / value, multiplier / value);
        let of_slack = of(at.slack, at.multiplier, target.slack);
        let (of_excess, soft) = match side.soft {
            None => ((T::zero(), T::zero()), None),
            Some(price) => {
                let of_excess = of(at.excess, at.rest, target.excess);
                let slope = price.quadratic + of_slack.1 + of_excess.1;
                (of_excess, Some((price.linear, slope)))
            }
        };
        Self {
            of_slack,
            of_excess,
            soft,
        }
    }

    /// Multiplier at d = 0, and how fast it falls with d.
    fn multiplier(&self) -> (T, T) {
        let (base, weight) = self.of_slack;
        match self.soft {
            None => (base, weight),
            Some((price, slope)) => {
                let share = weight / slope;
                let rest = slope - weight;
                (
                    base - share * (base + self.of_excess.0 - price),
                    share * rest,
                )
            }
        }
    }

    /// What the side comes to at the distance d.
    fn at(&self, distance: T) -> Interior<T> {
        let (base, weight) = self.of_slack;
        let excess = match self.soft {
            None => T::zero(),
            Some((price, slope)) => (base + self.of_excess.0 - price - weight * distance) / slope,
        };
        let slack = distance + excess;
        Interior {
            slack,
            multiplier: base - weight * slack,
            excess,
            rest: self.of_excess.0 - self.of_excess.1 * excess,
        }
    }
}

/// What a step says of the roles of the sides.
pub(super) struct Foretold {
    /// How many are not those of the step before.
    pub changed: usize,
    /// How many sides are active.
    pub active: usize,
}

/// Where the method stands.
pub(super) struct InteriorPoint<T> {
    /// Mean of slack * multiplier.
    pub complementarity: T,
    count: T,
}

impl<T: Scalar> InteriorPoint<T> {
    /// Begins at a trajectory whose distances are known, with products of slack and multiplier of the size
    /// of `cost`.
    pub fn new(sides: &mut [BoundSide<T>], cost: T) -> Self {
        let least: T = convert(LEAST);
        for side in sides.iter_mut() {
            let slack = side.distance.max(least * side.size);
            let excess = (slack - side.distance).max(least * side.size);
            let multiplier = cost / slack;
            side.interior = match side.soft {
                None => Interior {
                    slack,
                    multiplier,
                    excess: T::zero(),
                    rest: T::zero(),
                },
                // Both multipliers add up to the price.
                Some(price) => {
                    let whole = price.linear + price.quadratic * excess;
                    let multiplier = multiplier.min(whole * convert(0.5));
                    Interior {
                        slack,
                        multiplier,
                        excess,
                        rest: whole - multiplier,
                    }
                }
            };
        }
        let mut start = Self {
            complementarity: cost,
            count: T::one(),
        };
        start.measure(sides);
        start
    }

    fn measure(&mut self, sides: &[BoundSide<T>]) {
        let (sum, count) = products(sides, |side| side.interior);
        self.complementarity = sum / count;
        self.count = count;
    }

    /// A Newton step towards complementarity zero, on the way to `trajectory`: leaves the trajectory that it
    /// leads to there, and in every side the role that it foretells.
    pub fn predict<const NX: usize, const NU: usize>(
        &self,
        ocp: &Ocp<T, NX, NU>,
        sides: &mut [BoundSide<T>],
        factors: &mut [StageFactor<T, NX, NU>],
        (u, x): (&mut [SVector<T, NU>], &mut [SVector<T, NX>]),
    ) -> Result<Foretold, BadPivot<T>> {
        for side in sides.iter_mut() {
            side.last_role = side.role;
            side.role = Role::Free;
            (side.base, side.weight) = Linear::new(side, Target::zero()).multiplier();
        }
        newton::factorize(ocp, sides, factors)?;
        newton::roll_out(ocp, factors, (u, x));
        newton::measure(ocp, sides, &Trajectory { x, u });
        let mut foretold = Foretold {
            changed: 0,
            active: 0,
        };
        for side in sides.iter_mut() {
            let at = &side.interior;
            let to = Linear::new(side, Target::zero()).at(side.distance);
            // What goes to zero first, relative to where it is.
            let holds = to.slack * at.multiplier < to.multiplier * at.slack;
            let exceeded = side.soft.is_some() && to.rest * at.excess < to.excess * at.rest;
            side.role = match (exceeded, holds) {
                (true, _) => Role::Exceeded,
                (false, true) => Role::Held,
                (false, false) => Role::Free,
            };
            side.estimate = to.multiplier.max(T::zero());
            foretold.changed += usize::from(side.role != side.last_role);
            foretold.active += usize::from(side.role != Role::Free);
        }
        Ok(foretold)
    }

    /// The corrector: the trajectory of the prediction moves on, and the sides' unknowns go towards it as far
    /// as they stay above zero. Returns that part of the way.
    pub fn correct<const NX: usize, const NU: usize>(
        &mut self,
        ocp: &Ocp<T, NX, NU>,
        sides: &mut [BoundSide<T>],
        factors: &[StageFactor<T, NX, NU>],
        v: &mut [SVector<T, NU>],
        (u, x): (&mut [SVector<T, NU>], &mut [SVector<T, NX>]),
    ) -> T {
        let predicted = |side: &BoundSide<T>| Linear::new(side, Target::zero()).at(side.distance);
        let part = Part::until_zero(sides, predicted);
        let (sum, _) = products(sides, |side| along(&side.interior, &predicted(side), part));
        let ratio = sum / self.count / self.complementarity;
        let center = ratio * ratio * ratio * self.complementarity;
        for side in sides.iter_mut() {
            side.target = target(side, &predicted(side), center);
            let (base, _) = Linear::new(side, side.target).multiplier();
            side.estimate = base - side.base;
        }
        newton::shift(ocp, factors, sides, |side| side.estimate, v, (u, x));
        newton::measure(ocp, sides, &Trajectory { x, u });
        let corrected = |side: &BoundSide<T>| Linear::new(side, side.target).at(side.distance);
        let part = Part::until_zero(sides, corrected).shortened(convert(NEARLY));
        for side in sides.iter_mut() {
            side.interior = along(&side.interior, &corrected(side), part);
        }
        self.measure(sides);
        part.shortest()
    }
}

/// The center, less what the prediction's own products add.
fn target<T: Scalar>(side: &BoundSide<T>, to: &Interior<T>, center: T) -> Target<T> {
    let at = &side.interior;
    Target {
        slack: center - (to.slack - at.slack) * (to.multiplier - at.multiplier),
        excess: center - (to.excess - at.excess) * (to.rest - at.rest),
    }
}

/// Sum and number of the products that go to zero.
fn products<T: Scalar>(
    sides: &[BoundSide<T>],
    at: impl Fn(&BoundSide<T>) -> Interior<T>,
) -> (T, T) {
    let mut sum = (T::zero(), T::zero());
    for side in sides {
        let at = at(side);
        sum.0 += at.slack * at.multiplier;
        sum.1 += T::one();
        if side.soft.is_some() {
            sum.0 += at.excess * at.rest;
            sum.1 += T::one();
        }
    }
    sum
}

/// Parts of a way.
#[derive(Clone, Copy)]
struct Part<T> {
    /// Of slacks and excesses.
    primal: T,
    /// Of multipliers.
    dual: T,
}

impl<T: Scalar> Part<T> {
    /// Where the first unknown is zero.
    fn until_zero(sides: &[BoundSide<T>], to: impl Fn(&BoundSide<T>) -> Interior<T>) -> Self {
        let far: T = convert(1e3);
        let (mut primal, mut dual) = (far, far);
        let keep = |part: &mut T, at: T, to: T| {
            if to < at && at < *part * (at - to) {
                *part = at / (at - to);
            }
        };
        for side in sides {
            let (at, to) = (&side.interior, to(side));
            keep(&mut primal, at.slack, to.slack);
            keep(&mut dual, at.multiplier, to.multiplier);
            if side.soft.is_some() {
                keep(&mut primal, at.excess, to.excess);
                keep(&mut dual, at.rest, to.rest);
            }
        }
        Self { primal, dual }
    }

    /// Times `factor`, at most the whole way.
    fn shortened(self, factor: T) -> Self {
        Self {
            primal: (self.primal * factor).min(T::one()),
            dual: (self.dual * factor).min(T::one()),
        }
    }

    fn shortest(self) -> T {
        self.primal.min(self.dual)
    }
}

fn along<T: Scalar>(at: &Interior<T>, to: &Interior<T>, part: Part<T>) -> Interior<T> {
    let Part { primal, dual } = part.shortened(T::one());
    let between = |at: T, to: T, part: T| at + (to - at) * part;
    Interior {
        slack: between(at.slack, to.slack, primal),
        multiplier: between(at.multiplier, to.multiplier, dual),
        excess: between(at.excess, to.excess, primal),
        rest: between(at.rest, to.rest, dual),
    }
}
