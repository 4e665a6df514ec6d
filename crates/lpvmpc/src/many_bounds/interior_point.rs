//! The interior-point method (Mehrotra's predictor and corrector) on the Riccati factors, until it can be
//! told which bounds will be active.
//!
//! Every side has a slack and a multiplier above zero; a soft one its excess, with a multiplier, too. A
//! Newton step towards slack * multiplier = target is a linear-quadratic program in which each side acts
//! with a multiplier that is linear in its distance.

use super::exchange::{Patience, Program, Tolerances, exchange};
use super::newton;
use super::side::{BoundSide, Interior, Role, Target};
use super::span::Span;
use super::start;
use crate::model::Scalar;
use crate::riccati::{BadPivot, StageFactor};
use crate::rows::Trajectory;
use nalgebra::{SVector, convert};

/// Part of the way to the nearest zero that a step may take.
const NEARLY: f64 = 0.995;
/// A step that goes a smaller part of its way is short.
const SHORT: f64 = 0.3;
/// Still smaller parts mean that hard bounds may contradict each other.
pub(super) const STUCK: f64 = 0.1;
/// Where none can, the next step goes farther from products so many times larger.
const LARGER: f64 = 10.0;

/// Between the parts of its slack and of its multiplier that a step leaves there is less than this where it does not say
/// clearly which of them goes to zero.
const UNDECIDED: f64 = 0.4;

/// Multiplier of a side at d = 0 in a Newton step towards `target`, and how fast it falls with d.
#[inline(always)]
fn multiplier<T: Scalar>(side: &BoundSide<T>, target: Target<T>) -> (T, T) {
    let at = &side.interior;
    let of = |value: T, multiplier: T, target: T| {
        let inverse = T::one() / value;
        (multiplier + target * inverse, multiplier * inverse)
    };
    let (base, weight) = of(at.slack, at.multiplier, target.slack);
    let Some(price) = side.soft else {
        return (base, weight);
    };
    let (base_of_rest, weight_of_rest) = of(at.excess, at.rest, target.excess);
    let rest = price.quadratic + weight_of_rest;
    let share = weight / (weight + rest);
    (
        base - share * (base + base_of_rest - price.linear),
        share * rest,
    )
}

/// What a side comes to in that step at its distance.
#[inline(always)]
fn step_to<T: Scalar>(side: &BoundSide<T>, target: Target<T>) -> Interior<T> {
    let at = &side.interior;
    let multiplier = side.multiplier_at(side.distance);
    let Some(price) = side.soft else {
        return Interior {
            slack: side.distance,
            multiplier,
            excess: T::zero(),
            rest: T::zero(),
        };
    };
    // The products' linearisation, and how slack and excess, and both multipliers, belong together.
    let slack = at.slack + (target.slack - at.slack * multiplier) / at.multiplier;
    let excess = slack - side.distance;
    Interior {
        slack,
        multiplier,
        excess,
        rest: price.linear + price.quadratic * excess - multiplier,
    }
}

/// What a step says of the roles of the sides.
pub(super) struct Foretold {
    /// How many are not those of the step before.
    pub changed: usize,
    /// How many sides are active.
    pub active: usize,
    /// Of how many sides the step does not say clearly whether they are active.
    pub undecided: usize,
}

/// Where the method stands. Between its calls every side is free, and has the cost of a Newton step towards
/// complementarity zero.
pub(super) struct InteriorPoint<T> {
    /// Mean of slack * multiplier.
    complementarity: T,
    count: T,
    /// Whether hard bounds may contradict each other: those of inputs alone cannot.
    may_contradict: bool,
    prediction: Prediction<T>,
}

/// What there is to know of the way to a prediction.
#[derive(Clone, Copy)]
struct Prediction<T> {
    /// Where the first unknown is zero.
    part: Part<T>,
    /// How fast the sum of slack * multiplier changes with each of the two, and with both.
    primal: T,
    dual: T,
    both: T,
}

impl<T: Scalar> Prediction<T> {
    fn begin() -> Self {
        Self {
            part: Part::far(),
            primal: T::zero(),
            dual: T::zero(),
            both: T::zero(),
        }
    }

    /// Takes a side into account, which is to go from `at` to `to`; returns the products of its steps.
    #[inline(always)]
    fn add(&mut self, at: &Interior<T>, to: &Interior<T>, soft: bool) -> Target<T> {
        self.part.keep_above_zero(at, to, soft);
        let (slack, multiplier) = (to.slack - at.slack, to.multiplier - at.multiplier);
        let (excess, rest) = (to.excess - at.excess, to.rest - at.rest);
        let products = Target {
            slack: slack * multiplier,
            excess: excess * rest,
        };
        self.primal += slack * at.multiplier + excess * at.rest;
        self.dual += multiplier * at.slack + rest * at.excess;
        self.both += products.slack + products.excess;
        products
    }

    /// The change of the sum of slack * multiplier where that first unknown is zero.
    fn change(&self) -> T {
        let Part { primal, dual } = self.part.shortened(T::one());
        primal * self.primal + dual * self.dual + primal * dual * self.both
    }
}

impl<T: Scalar> InteriorPoint<T> {
    /// Begins at a trajectory whose distances are known, with products of slack and multiplier of the size
    /// of `cost`, larger where bounds are violated by several times their size.
    pub fn new(sides: &mut [BoundSide<T>], cost: T) -> Self {
        start::place(sides, cost);
        sides.iter_mut().for_each(free);
        Self::at(sides)
    }

    /// Mean of slack * multiplier.
    pub fn complementarity(&self) -> T {
        self.complementarity
    }

    /// Where the sides' unknowns are.
    fn at(sides: &[BoundSide<T>]) -> Self {
        let (mut sum, mut count) = (T::zero(), T::zero());
        for side in sides {
            sum += side.interior.product();
            count += T::one();
            if side.soft.is_some() {
                count += T::one();
            }
        }
        Self {
            complementarity: sum / count,
            count,
            may_contradict: sides.iter().any(BoundSide::may_contradict),
            prediction: Prediction::begin(),
        }
    }

    /// A Newton step towards complementarity zero: leaves its factors, the trajectory that it leads to, and in every
    /// side, as `last_role`, the role that it foretells.
    pub fn predict<const NX: usize, const NU: usize>(
        &mut self,
        span: &Span<'_, T, NX, NU>,
        sides: &mut [BoundSide<T>],
        factors: &mut [StageFactor<T, NX, NU>],
        (u, x): (&mut [SVector<T, NU>], &mut [SVector<T, NX>]),
    ) -> Result<Foretold, BadPivot<T>> {
        newton::factorize(span, sides, factors)?;
        newton::roll_out(span, factors, (u, x));
        Ok(self.foretell(span, sides, &Trajectory { x, u }))
    }

    /// Tries the roles that the prediction in `program` foretells, in its other places; whether they, or what they are
    /// exchanged for, are right. Where they are not, program and sides are again those of the prediction.
    pub fn try_foretold<const NX: usize, const NU: usize>(
        &mut self,
        program: &mut Program<'_, T, NX, NU>,
        sides: &mut [BoundSide<T>],
        tolerances: &Tolerances<T>,
        count: impl FnMut() -> bool,
    ) -> bool {
        program.change_places();
        sides.iter_mut().for_each(|side| side.role = side.last_role);
        if exchange(program, sides, tolerances, Patience::NEAR, count) {
            return true;
        }
        program.change_places();
        sides.iter_mut().for_each(free);
        let (x, u) = (&*program.x, &*program.u);
        self.foretell(&program.span, sides, &Trajectory { x, u });
        false
    }

    fn foretell<const NX: usize, const NU: usize>(
        &mut self,
        span: &Span<'_, T, NX, NU>,
        sides: &mut [BoundSide<T>],
        trajectory: &Trajectory<'_, T, NX, NU>,
    ) -> Foretold {
        let mut foretold = Foretold {
            changed: 0,
            active: 0,
            undecided: 0,
        };
        let mut prediction = Prediction::begin();
        let undecided: T = convert(UNDECIDED);
        newton::measure_each(span, sides, trajectory, |side| {
            let at = &side.interior;
            let to = step_to(side, Target::zero());
            // What goes to zero first, relative to where it is: both parts add up to the product.
            let (slack, multiplier) = (to.slack * at.multiplier, to.multiplier * at.slack);
            let holds = slack < multiplier;
            let gap = (slack - multiplier).abs();
            foretold.undecided += usize::from(gap < undecided * at.slack * at.multiplier);
            let exceeded = side.soft.is_some() && to.rest * at.excess < to.excess * at.rest;
            let role = match (exceeded, holds) {
                (true, _) => Role::Exceeded,
                (false, true) => Role::Held,
                (false, false) => Role::Free,
            };
            side.estimate = to.multiplier.max(T::zero());
            side.target = prediction.add(at, &to, side.soft.is_some());
            foretold.changed += usize::from(role != side.last_role);
            foretold.active += usize::from(role != Role::Free);
            side.last_role = role;
        });
        self.prediction = prediction;
        foretold
    }

    /// The corrector: the trajectory of the prediction moves on, and the sides' unknowns go towards it as far
    /// as they stay above zero. Returns that part of the way.
    ///
    /// Where that is short, what the prediction's products add to second order is of a way that is not gone: then the step
    /// is one towards equal products alone, from which the next one gets farther; larger ones where it is very short. Of hard
    /// bounds that contradict each other the multipliers are to grow instead.
    pub fn correct<const NX: usize, const NU: usize>(
        &mut self,
        span: &Span<'_, T, NX, NU>,
        sides: &mut [BoundSide<T>],
        factors: &[StageFactor<T, NX, NU>],
        v: &mut [SVector<T, NU>],
        mut trajectory: (&mut [SVector<T, NU>], &mut [SVector<T, NX>]),
    ) -> T {
        let sum = self.complementarity * self.count;
        let ratio = ((sum + self.prediction.change()) / sum).max(T::zero());
        let center = ratio * ratio * ratio * self.complementarity;
        let with_products = |predicted: Target<T>| Target {
            slack: center - predicted.slack,
            excess: center - predicted.excess,
        };
        let mut part = aim(span, sides, factors, v, &mut trajectory, with_products);
        let shortest = part.shortest();
        let stuck = shortest < convert(STUCK);
        if shortest < convert(SHORT) && !(stuck && self.may_contradict) {
            let times = if stuck { LARGER } else { 1.0 };
            let product = self.complementarity * convert(times);
            let equal = Target {
                slack: product,
                excess: product,
            };
            part = aim(span, sides, factors, v, &mut trajectory, |_| equal);
        }
        let mut sum = T::zero();
        for side in sides.iter_mut() {
            side.interior = along(&side.interior, &step_to(side, side.target), part);
            sum += side.interior.product();
            weigh(side);
        }
        self.complementarity = sum / self.count;
        part.shortest()
    }
}

/// Moves the trajectory to where the sides' products come to the `target` of each, which follows from the one that it has;
/// returns how far their unknowns may go there.
fn aim<T: Scalar, const NX: usize, const NU: usize>(
    span: &Span<'_, T, NX, NU>,
    sides: &mut [BoundSide<T>],
    factors: &[StageFactor<T, NX, NU>],
    v: &mut [SVector<T, NU>],
    (u, x): &mut (&mut [SVector<T, NU>], &mut [SVector<T, NX>]),
    target: impl Fn(Target<T>) -> Target<T>,
) -> Part<T> {
    let change = |side: &mut BoundSide<T>| {
        side.target = target(side.target);
        let base = multiplier(side, side.target).0;
        base - core::mem::replace(&mut side.base, base)
    };
    newton::shift(span, factors, sides, change, v, (u, x));
    let mut part = Part::far();
    newton::measure_each(span, sides, &Trajectory { x, u }, |side| {
        let corrected = step_to(side, side.target);
        part.keep_above_zero(&side.interior, &corrected, side.soft.is_some());
    });
    part.shortened(convert(NEARLY))
}

/// No guess says what becomes of the side.
fn free<T: Scalar>(side: &mut BoundSide<T>) {
    side.role = Role::Free;
    weigh(side);
}

/// Gives the side the cost that it has in a Newton step towards complementarity zero.
#[inline(always)]
fn weigh<T: Scalar>(side: &mut BoundSide<T>) {
    (side.base, side.weight) = multiplier(side, Target::zero());
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
    /// Beyond any that counts.
    fn far() -> Self {
        let far = convert(1e3);
        Self {
            primal: far,
            dual: far,
        }
    }

    /// Not beyond where a side's first unknown is zero, on its way from `at` to `to`.
    #[inline(always)]
    fn keep_above_zero(&mut self, at: &Interior<T>, to: &Interior<T>, soft: bool) {
        let keep = |part: &mut T, at: T, to: T| {
            // Seldom, so that the processor foresees it; never where `to` is not below `at`, which is above zero.
            if at < *part * (at - to) {
                *part = at / (at - to);
            }
        };
        keep(&mut self.primal, at.slack, to.slack);
        keep(&mut self.dual, at.multiplier, to.multiplier);
        if soft {
            keep(&mut self.primal, at.excess, to.excess);
            keep(&mut self.dual, at.rest, to.rest);
        }
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

#[cfg(all(test, feature = "alloc"))]
mod tests {
    use super::*;
    use crate::many_bounds::side;
    use crate::ocp::{Bounds, Ocp, Penalty};
    use alloc::vec;
    use alloc::vec::Vec;
    use nalgebra::{Matrix2, Vector1, Vector2};

    const N: usize = 12;

    /// A double integrator pushed against the bounds of its input and, softly, of its speed.
    fn problem() -> Ocp<f64, 2, 1> {
        let mut ocp = Ocp::allocate(N);
        ocp.x0 = Vector2::new(9.0, -1.0);
        for stage in ocp.stages.iter_mut() {
            stage.a = Matrix2::new(1.0, 0.2, 0.0, 1.0);
            stage.b = Vector2::new(0.02, 0.2);
        }
        ocp.common.q = Matrix2::identity();
        ocp.common.r[(0, 0)] = 0.1;
        ocp.common.u = Bounds {
            lower: Vector1::new(-1.0),
            upper: Vector1::new(1.0),
        };
        ocp.common.x.lower[1] = -1.5;
        ocp.common.soft_x[1] = Some(Penalty {
            linear: 1.0,
            quadratic: 10.0,
        });
        ocp.terminal.p = Matrix2::identity();
        ocp
    }

    /// Factors, trajectory and sides of a Newton step are what they were after its guess has been tried in vain.
    #[test]
    fn a_guess_in_vain_leaves_the_step_as_it_was() {
        let ocp = problem();
        let mut sides = vec![BoundSide::empty(); 6 * (N + 1)];
        let count = side::collect(&ocp, &mut sides).unwrap();
        sides.truncate(count);
        let tolerances = Tolerances {
            violation: 1e-10,
            scale: 1.0,
            penalty: 1e6,
        };
        let place = || {
            (
                vec![StageFactor::zeros(); N],
                vec![Vector1::zeros(); N],
                vec![Vector2::zeros(); N],
            )
        };
        let ((mut factors, mut u, mut x), mut spare) = (place(), place());
        let mut v = u.clone();
        let span = Span::whole(&ocp);
        newton::factorize(&span, &sides, &mut factors).unwrap();
        newton::roll_out(&span, &factors, (&mut u, &mut x));
        newton::measure(&span, &mut sides, &Trajectory { x: &x, u: &u });
        let mut method = InteriorPoint::new(&mut sides, 1.0);
        let mut program = Program {
            span,
            v: &mut v,
            factors: &mut factors,
            u: &mut u,
            x: &mut x,
            spare: (&mut spare.0, &mut spare.1, &mut spare.2),
        };
        for _ in 0..2 {
            method
                .predict(&span, &mut sides, program.factors, (program.u, program.x))
                .unwrap();
            let of = |side: &BoundSide<f64>| {
                let numbers = [side.base, side.weight, side.distance, side.estimate];
                let roles = (side.role, side.last_role);
                (roles, numbers, side.target.slack, side.target.excess)
            };
            let step = |program: &Program<'_, f64, 2, 1>, sides: &[BoundSide<f64>]| {
                let policies = program.factors.iter();
                let policies = policies.map(|f| (f.feedback, f.feedforward, f.inverse_factor));
                (
                    policies.collect::<Vec<_>>(),
                    (program.u.to_vec(), program.x.to_vec()),
                    sides.iter().map(of).collect::<Vec<_>>(),
                )
            };
            let (before, change) = (step(&program, &sides), method.prediction.change());
            // One factorisation, which shows that the guess is wrong, and no more to exchange it.
            let mut left = 1;
            let count = || core::mem::replace(&mut left, 0) > 0;
            assert!(!method.try_foretold(&mut program, &mut sides, &tolerances, count));
            assert_eq!(left, 0);
            assert_ne!(program.spare.1.to_vec(), before.1.0);
            assert_eq!(step(&program, &sides), before);
            assert_eq!(method.prediction.change(), change);
            let trajectory = (&mut *program.u, &mut *program.x);
            method.correct(&span, &mut sides, program.factors, program.v, trajectory);
        }
    }
}
