//! What a plan costs at least of which only the first samples are known: a rollout that is too dear
//! need not come to its end.

use super::GuaranteedSettings;
use super::aim::Aims;
use crate::model::Scalar;
use nalgebra::SVector;

/// Offset cost and stage costs so far, as a parabola over the move m of the plan's set point:
/// constant + 2 slope m + curvature m^2. What follows costs nothing or more.
pub(super) struct LeastCost<'a, T: 'static, const NX: usize, const NU: usize> {
    settings: &'a GuaranteedSettings<T, NX, NU>,
    aims: &'a Aims<T>,
    /// The set point from which it moves.
    near: T,
    constant: T,
    slope: T,
    curvature: T,
}

impl<'a, T: Scalar, const NX: usize, const NU: usize> LeastCost<'a, T, NX, NU> {
    /// Of no sample yet, seen from the set point `near`: far from zero, squares would leave no digits.
    pub fn new(settings: &'a GuaranteedSettings<T, NX, NU>, aims: &'a Aims<T>, near: T) -> Self {
        let (weight, offset) = (settings.offset_weight, near - aims.end);
        Self {
            settings,
            aims,
            near,
            constant: weight * offset * offset,
            slope: weight * offset,
            curvature: weight,
        }
    }

    /// With the sample `i` from `x` under `u`, too.
    pub fn add(&mut self, i: usize, x: &SVector<T, NX>, u: &SVector<T, NU>) {
        let (weights, d) = (&self.settings.weights, &self.settings.direction);
        let wanted = self.aims.stages.get(i).filter(|_| i < self.aims.changes);
        let error = x - d * *wanted.unwrap_or(&self.near);
        let pull = weights.q * error;
        self.constant += pull.dot(&error) + (weights.r * u).dot(u);
        if wanted.is_none() {
            self.slope -= pull.dot(d);
            self.curvature += (weights.q * d).dot(d);
        }
    }

    /// With the set point that is best for it.
    pub fn value(&self) -> T {
        self.constant - self.slope * self.slope / self.curvature
    }
}

#[cfg(all(test, feature = "alloc"))]
mod tests {
    use super::*;
    use crate::guaranteed::carriage::{Carriage, N, plan, settings, vector};
    use crate::guaranteed::{GuaranteedController, SetPoints};
    use crate::list::List;
    use crate::settings::Weights;
    use alloc::vec::Vec;
    use lpvmpc_testkit::rng::Rng;
    use nalgebra::{Matrix1x3, Vector1, Vector3};

    fn aims(random: &mut Rng, last: f64) -> Aims<f64> {
        let mut aims = Aims::new(List::repeat(0.0, N));
        let stages: [f64; N] = core::array::from_fn(|_| random.uniform(-9.0, 9.0));
        let seen = random.index(N + 1);
        let wanted = SetPoints {
            stages: &stages[..seen],
            end: random.uniform(-99.0, 99.0),
        };
        aims.take(&wanted, last, [f64::NEG_INFINITY, f64::INFINITY]);
        aims
    }

    /// For any first samples, no set point makes them and the offset cheaper, and one is as cheap.
    #[test]
    fn it_is_the_least_cost_over_all_set_points() {
        let mut random = Rng::new(5);
        for _ in 0..300 {
            let settings = settings(&mut random);
            let near = random.uniform(-99.0, 99.0);
            let aims = aims(&mut random, near);
            let Weights { q, r } = settings.weights;
            let samples: Vec<(Vector3<f64>, Vector1<f64>)> = (0..1 + random.index(N))
                .map(|_| {
                    let x = vector(&mut random, 5.0) + Vector3::x() * near;
                    (x, vector(&mut random, 2.0))
                })
                .collect();
            let mut least = LeastCost::new(&settings, &aims, near);
            for (i, (x, u)) in samples.iter().enumerate() {
                least.add(i, x, u);
            }
            let cost = |z: f64| {
                let stage = |(i, (x, u)): (usize, &(Vector3<f64>, Vector1<f64>))| {
                    let aim = if i < aims.changes { aims.stages[i] } else { z };
                    let error = x - Vector3::x() * aim;
                    (error.transpose() * q * error + u.transpose() * r * u)[0]
                };
                let stages: f64 = samples.iter().enumerate().map(stage).sum();
                stages + settings.offset_weight * (z - aims.end).powi(2)
            };
            // Golden sections: it is a parabola.
            let (mut low, mut high) = (-1e3, 1e3);
            for _ in 0..100 {
                let part = 0.381_966_011_250_105 * (high - low);
                if cost(low + part) < cost(high - part) {
                    high -= part;
                } else {
                    low += part;
                }
            }
            let smallest = cost(low);
            let rounding = 1e-9 * cost(near).max(smallest);
            let value = least.value();
            assert!((value - smallest).abs() <= rounding, "{value} {smallest}");
        }
    }

    /// A rollout that is ended would have cost more than what it had to beat, or have left the bounds; any
    /// other is the one without an end.
    #[test]
    fn what_it_ends_is_no_better_plan() {
        let mut random = Rng::new(6);
        let (mut ended, mut whole) = (0, 0);
        for _ in 0..300 {
            let plant = Carriage {
                drag: random.uniform(0.0, 1.0),
                lag: random.uniform(1.0, 9.0),
            };
            let settings = settings(&mut random);
            let mut planner = GuaranteedController::allocate(plant, settings)
                .unwrap()
                .planner;
            let start: Vector3<f64> = vector(&mut random, 2.5);
            planner.aims = aims(&mut random, start[0]);
            let [mut along, mut expected, mut found] = [plan(), plan(), plan()];
            planner.follow_terminal_law(&start, &mut along);
            let policy: Vec<_> = along
                .states()
                .zip(&along.stages)
                .map(|(x, stage)| {
                    let gain = Matrix1x3::from_fn(|_, _| random.uniform(-1.0, 0.0));
                    let x = x + vector::<3>(&mut random, 1.0);
                    (x, stage.u + vector::<1>(&mut random, 1.0), gain)
                })
                .collect();
            let towards = || policy.iter().copied();
            planner.go_between(&along, towards(), 1.0, None, &mut expected);
            for part in [0.3, 0.9, 0.999, 1.001, 1.1, 3.0] {
                let most = expected.cost * part;
                planner.go_between(&along, towards(), 1.0, Some(most), &mut found);
                if found.cost.is_finite() {
                    whole += 1;
                    assert_eq!(found.stages[..], expected.stages[..]);
                    assert_eq!(found.cost, expected.cost);
                    assert_eq!(found.set_point, expected.set_point);
                } else {
                    ended += 1;
                    assert!(expected.cost > most || !planner.is_feasible(&expected));
                }
            }
        }
        assert!(ended > 300 && whole > 300, "{ended} {whole}");
    }
}
