//! The interior-point method (Mehrotra's predictor and corrector) on the Riccati factors, until it can be
//! told which bounds will be active.
//!
//! Every side has a slack and a multiplier above zero; a soft one its excess, with a multiplier, too. A
//! Newton step towards slack * multiplier = target is a linear-quadratic program in which each side acts
//! with a multiplier that is linear in its distance.

mod all_unknowns;
mod step;
mod unknowns;
mod way;

pub(super) use all_unknowns::AllUnknowns;
pub(crate) use unknowns::BoundUnknowns;
pub(super) use unknowns::Interior;
pub(super) use way::Foretold;

use super::exchange::{Patience, Program, Tolerances, exchange};
use super::newton;
use super::side::BoundSide;
use super::start::Start;
use crate::model::Scalar;
use crate::riccati::BadPivot;
use nalgebra::convert;
use unknowns::Target;
use way::Prediction;

/// Part of the way to the nearest zero that a step may take.
const NEARLY: f64 = 0.995;
/// A step that goes a smaller part of its way is short.
const SHORT: f64 = 0.3;
/// Still smaller parts mean that hard bounds may contradict each other.
pub(super) const STUCK: f64 = 0.1;
/// Where none can, the next step goes farther from products so many times larger.
const LARGER: f64 = 10.0;

/// Where the method stands. Between its calls the bounds have the costs of a Newton step towards complementarity zero.
pub(super) struct InteriorPoint<T> {
    /// Mean of slack * multiplier.
    complementarity: T,
    count: T,
    /// Whether hard bounds may contradict each other: those of inputs alone cannot.
    may_contradict: bool,
    prediction: Option<Prediction<T>>,
}

impl<T: Scalar> InteriorPoint<T> {
    /// Begins at a trajectory on which the sides are measured, with products of slack and multiplier of the size of `cost`,
    /// larger where bounds are violated by several times their size; `None` where there are not enough places.
    pub fn new<const NX: usize, const NU: usize>(
        program: &mut Program<'_, T, NX, NU>,
        sides: &[BoundSide<T>],
        cost: T,
    ) -> Option<Self> {
        let start = Start::new(sides, cost);
        let (mut sum, mut count) = (T::zero(), T::zero());
        program.unknowns.set(sides, |side| {
            let at = start.of(side);
            sum += at.product();
            count += if side.soft.is_some() {
                convert(2.0)
            } else {
                T::one()
            };
            at
        })?;
        let bounds = program.unknowns.bounds_mut().iter_mut();
        bounds.for_each(BoundUnknowns::weigh);
        Some(Self {
            complementarity: sum / count,
            count,
            may_contradict: sides.iter().any(BoundSide::may_contradict),
            prediction: None,
        })
    }

    /// Mean of slack * multiplier.
    pub fn complementarity(&self) -> T {
        self.complementarity
    }

    /// A Newton step towards complementarity zero: leaves its factors, and the trajectory that it leads to; what it foretells
    /// of the sides.
    pub fn predict<const NX: usize, const NU: usize>(
        &mut self,
        program: &mut Program<'_, T, NX, NU>,
    ) -> Result<Foretold, BadPivot<T>> {
        let bounds = program.unknowns.bounds();
        newton::factorize(&program.span, bounds, program.factors)?;
        newton::roll_out(&program.span, program.factors, &[], (program.u, program.x));
        let (prediction, foretold) = step::foretell(program);
        self.prediction = Some(prediction);
        Ok(foretold)
    }

    /// Tries the roles that the prediction in `program` foretells, in its other places; whether they, or what they are
    /// exchanged for, are right. Where they are not, the program is again that of the prediction.
    pub fn try_foretold<const NX: usize, const NU: usize>(
        program: &mut Program<'_, T, NX, NU>,
        sides: &mut [BoundSide<T>],
        tolerances: &Tolerances<T>,
        count: impl FnMut() -> bool,
    ) -> bool {
        program.unknowns.visit(sides, |side, known| {
            side.role = known.role;
            side.estimate = known.predicted.max(T::zero());
        });
        program.change_places();
        let found = exchange(program, sides, tolerances, Patience::NEAR, count);
        if !found {
            program.change_places();
        }
        found
    }

    /// The corrector: the trajectory of the prediction moves on, and the sides' unknowns go towards it as far
    /// as they stay above zero. Returns that part of the way.
    ///
    /// Where that is short, what the prediction's products add to second order is of a way that is not gone: then the step
    /// is one towards equal products alone, from which the next one gets farther; larger ones where it is very short. Of hard
    /// bounds that contradict each other the multipliers are to grow instead.
    pub fn correct<const NX: usize, const NU: usize>(
        &mut self,
        program: &mut Program<'_, T, NX, NU>,
    ) -> T {
        let sum = self.complementarity * self.count;
        let predicted = self.prediction.map_or(sum, |way| way.sum(sum));
        let ratio = (predicted / sum).max(T::zero());
        let center = ratio * ratio * ratio * self.complementarity;
        let with_products = |predicted: Target<T>| Target {
            slack: center - predicted.slack,
            excess: center - predicted.excess,
        };
        let mut part = step::aim(program, with_products).shortened(convert(NEARLY));
        let stuck = part.shortest() < convert(STUCK);
        if part.shortest() < convert(SHORT) && !(stuck && self.may_contradict) {
            let times = if stuck { LARGER } else { 1.0 };
            let product = self.complementarity * convert(times);
            let equal = Target {
                slack: product,
                excess: product,
            };
            part = step::aim(program, |_| equal).shortened(convert(NEARLY));
        }
        let mut sums = [T::zero(); 2];
        for bound in program.unknowns.bounds_mut() {
            bound.advance(part, &mut sums);
        }
        self.complementarity = (sums[0] + sums[1]) / self.count;
        part.shortest()
    }
}

#[cfg(all(test, feature = "alloc"))]
mod tests {
    use super::*;
    use crate::list::List;
    use crate::many_bounds::fixture::{self, Fixture};
    use crate::many_bounds::span::Span;
    use crate::memory::Capacity;
    use crate::ocp::{Bounds, GeneralRow, Ocp, Penalty};
    use crate::rows::Trajectory;
    use alloc::format;
    use alloc::string::String;
    use alloc::vec;
    use alloc::vec::Vec;
    use nalgebra::{Matrix2, Vector1, Vector2};

    const N: usize = 12;

    /// A double integrator pushed against the bounds of its input, softly of its speed, and of a sum of all.
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
        ocp.common.x.upper[0] = 10.0;
        ocp.rows_per_stage = 1;
        let row = GeneralRow {
            x: Vector2::new(0.1, 1.0),
            u: Vector1::new(0.5),
            lower: -1.2,
            upper: 2.0,
            soft: None,
        };
        ocp.rows = List::repeat(row, N + 1);
        ocp.terminal.p = Matrix2::identity();
        ocp.terminal.x.upper[1] = 0.3;
        ocp
    }

    /// The problem's sides, measured on its trajectory without bounds, and the method that begins there.
    fn begin(
        test: impl FnOnce(&mut InteriorPoint<f64>, &mut Program<'_, f64, 2, 1>, &mut [BoundSide<f64>]),
    ) -> Option<()> {
        let ocp = problem();
        let mut sides = fixture::sides(&ocp);
        let mut fixture = Fixture::new(Capacity {
            stages: N,
            ..Capacity::default()
        });
        let span = Span::whole(&ocp, &[]);
        let mut program = fixture.program(span);
        assert!(newton::factorize(&span, &sides, program.factors).is_ok());
        newton::roll_out(&span, program.factors, &[], (program.u, program.x));
        let trajectory = Trajectory {
            x: program.x,
            u: program.u,
        };
        newton::measure(&span, &mut sides, &trajectory);
        let mut method = InteriorPoint::new(&mut program, &sides, 1.0)?;
        test(&mut method, &mut program, &mut sides);
        Some(())
    }

    /// Factors, trajectory and unknowns of a Newton step are what they were after its guess has been tried in vain.
    #[test]
    fn a_guess_in_vain_leaves_the_step_as_it_was() {
        let tolerances = Tolerances {
            violation: 1e-10,
            scale: 1.0,
            penalty: 1e6,
        };
        let begun = begin(|method, program, sides| {
            for _ in 0..2 {
                method.predict(program).unwrap();
                let step = |program: &Program<'_, f64, 2, 1>| {
                    let factors = program.factors.iter();
                    let factors = factors.map(|f| (f.feedback, f.feedforward, f.inverse_factor));
                    let unknowns: String = format!("{:?}", program.unknowns.bounds());
                    let trajectory = (program.u.to_vec(), program.x.to_vec());
                    (factors.collect::<Vec<_>>(), trajectory, unknowns)
                };
                let before = step(program);
                // One factorisation, which shows that the guess is wrong, and no more to exchange it.
                let mut left = 1;
                let count = || core::mem::replace(&mut left, 0) > 0;
                let found = InteriorPoint::try_foretold(program, sides, &tolerances, count);
                assert!(!found);
                assert_eq!(left, 0);
                assert_ne!(program.spare.1.to_vec(), before.1.0);
                assert_eq!(step(program), before);
                method.correct(program);
            }
        });
        assert!(begun.is_some());
    }

    /// What the inputs cost, and what the sides' multipliers add to it.
    fn lagrangian(
        ocp: &Ocp<f64, 2, 1>,
        u: &[Vector1<f64>],
        sides: &[(BoundSide<f64>, f64)],
    ) -> f64 {
        let mut states = vec![ocp.x0];
        for (stage, u) in ocp.stages.iter().zip(u) {
            states.push(stage.a * states[states.len() - 1] + stage.b * u);
        }
        let of_inputs: f64 = u.iter().map(|u| 0.05 * u[0] * u[0]).sum();
        let of_states: f64 = states.iter().map(|x| 0.5 * x.norm_squared()).sum();
        let of_sides = sides.iter().map(|(side, multiplier)| {
            let stage = side.bound.stage;
            multiplier * side.distance_of(side.value(ocp, &states[stage], u.get(stage)))
        });
        of_inputs + of_states - of_sides.sum::<f64>()
    }

    /// A prediction solves the linearised optimality conditions: the Lagrangian with its multipliers is at its minimum, which
    /// differences show, and every product is zero to first order. What is gone of the way leaves all unknowns above zero.
    #[test]
    fn a_prediction_solves_the_linearised_conditions() {
        let begun = begin(|method, program, sides| {
            let mut last = 0.0;
            for step in 0..20 {
                let at = program.unknowns.copied(sides);
                let products: f64 = at.iter().map(|(_, known)| known.at.product()).sum();
                let pairs = sides.len() + sides.iter().filter(|side| side.soft.is_some()).count();
                let mean = products / pairs as f64;
                assert!((method.complementarity() / mean - 1.0).abs() < 1e-12);
                last = mean;
                // Closer, multipliers are differences of numbers that are many times larger.
                if last < 1e-6 {
                    break;
                }
                method.predict(program).unwrap();
                let ocp = program.span.ocp;
                let known = program.unknowns.copied(sides);
                let multipliers: Vec<_> = known
                    .iter()
                    .map(|(side, of)| (*side, of.predicted))
                    .collect();
                for i in 0..N {
                    let moved = |by: f64| {
                        let mut u = program.u.to_vec();
                        u[i][0] += by;
                        lagrangian(ocp, &u, &multipliers)
                    };
                    let slope = (moved(0.5) - moved(-0.5)).abs();
                    assert!(slope < 1e-9 * moved(0.0).abs(), "{step}, {i}: {slope}");
                }
                for (side, of) in &known {
                    let (stage, at) = (side.bound.stage, of.at);
                    assert!(at.slack > 0.0 && at.multiplier > 0.0);
                    let x = program.span.state(
                        &Trajectory {
                            x: program.x,
                            u: program.u,
                        },
                        stage,
                    );
                    let distance = side.distance_of(side.value(ocp, x, program.u.get(stage)));
                    let slack = at.slack * (1.0 - of.predicted / at.multiplier);
                    let Some(price) = side.soft else {
                        assert!(
                            (slack - distance).abs() < 1e-9 * (1.0 + at.slack),
                            "{step}: {}",
                            side.bound
                        );
                        continue;
                    };
                    assert!(at.excess > 0.0 && at.rest > 0.0);
                    let excess = slack - distance;
                    let rest = price.linear + price.quadratic * excess - of.predicted;
                    let product = at.excess * rest + at.rest * excess - at.excess * at.rest;
                    assert!(
                        product.abs() < 1e-9 * (1.0 + at.rest) * (1.0 + at.excess),
                        "{step}: {product}"
                    );
                }
                assert!(method.correct(program) > 0.1);
            }
            assert!(last < 1e-6, "{last}");
        });
        assert!(begun.is_some());
    }
}
