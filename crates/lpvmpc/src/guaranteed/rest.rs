//! The rest of a plan, with which every sample begins.

use super::Planner;
use super::plan::{Plan, PlannedStage};
use crate::model::{LpvModel, Scalar};
use crate::policy::input_at;
use nalgebra::SVector;

impl<P, T, const NX: usize, const NU: usize, const NS: usize> Planner<P, T, NX, NU, NS>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
{
    /// `plan` becomes the rest of `last` from the measured state, ended by the terminal law.
    pub(super) fn rest(
        &mut self,
        x0: &SVector<T, NX>,
        last: &Plan<T, NX, NU>,
        plan: &mut Plan<T, NX, NU>,
    ) {
        if self.is_as_planned(x0, last) {
            self.estimate_rest(x0, last, plan);
        } else {
            self.roll_out_rest(x0, last, plan);
        }
        plan.drift_as(last);
        self.aim_as_surely(plan, last.set_point);
    }

    /// Whether the plant is after the first sample of `last` where the rollout said, up to its integration
    /// error.
    fn is_as_planned(&self, x0: &SVector<T, NX>, last: &Plan<T, NX, NU>) -> bool {
        let first = last.stages.first().filter(|_| !last.estimated);
        first.is_some_and(|first| {
            let off = (x0 - first.x).abs();
            let error = self.error(&last.start, &first.u);
            off.iter()
                .zip(error.iter())
                .all(|(off, error)| off <= error)
        })
    }

    /// The rest of `last` where the plant is as planned: its rollout, moved by what the deviation becomes
    /// under the plan's own derivatives, as the deviations are for which it keeps room. Only the last sample
    /// is rolled out.
    fn estimate_rest(
        &mut self,
        x0: &SVector<T, NX>,
        last: &Plan<T, NX, NU>,
        plan: &mut Plan<T, NX, NU>,
    ) {
        let mut planned = last.stages.iter().zip(last.stages.iter().skip(1));
        let mut x = *x0;
        for (i, stage) in plan.stages.iter_mut().enumerate() {
            *stage = match planned.next() {
                Some((before, next)) => {
                    // Those of the last plan stay where they are: it may be repeated.
                    let (a, b) = self.slopes_at(i + 1, &before.x, &next.u);
                    let at = (&before.x, &next.u);
                    let u = input_at(&x, at, &next.feedback, &self.settings.u);
                    let here = x - before.x;
                    let there = a * here + b * (u - next.u);
                    PlannedStage {
                        u,
                        x: next.x + there,
                        highest: next.highest + here.sup(&there),
                        lowest: next.lowest + here.inf(&there),
                        ..*next
                    }
                }
                None => {
                    let (u, feedback) = self.terminal_law(&x, last.set_point);
                    self.sample(&x, u, feedback)
                }
            };
            x = stage.x;
        }
        (plan.start, plan.end, plan.estimated) = (*x0, x, true);
    }

    /// The rest of `last`, rolled out.
    fn roll_out_rest(
        &self,
        x0: &SVector<T, NX>,
        last: &Plan<T, NX, NU>,
        plan: &mut Plan<T, NX, NU>,
    ) {
        let mut planned = last.stages.iter().zip(last.stages.iter().skip(1));
        self.simulate(x0, plan, None, |x| match planned.next() {
            Some((before, PlannedStage { u, feedback, .. })) => (
                input_at(x, (&before.x, u), feedback, &self.settings.u),
                *feedback,
            ),
            None => self.terminal_law(x, last.set_point),
        });
    }
}

#[cfg(all(test, feature = "alloc"))]
mod tests {
    use super::super::GuaranteedController;
    use super::super::carriage::{Carriage, N, plan, settings, vector};
    use lpvmpc_testkit::rng::Rng;
    use nalgebra::{SMatrix, Vector3};

    /// Where the plant is as planned, the rest is the rollout, but for a few percent of the deviation; anywhere
    /// else, and after an estimate, it is the rollout itself.
    #[test]
    fn it_is_its_rollout() {
        let mut random = Rng::new(7);
        let mut saturated = 0;
        for _ in 0..300 {
            let plant = Carriage {
                drag: random.uniform(0.0, 1.0),
                lag: random.uniform(1.0, 9.0),
            };
            let mut settings = settings(&mut random);
            // The prediction's steps and the rollout's differ by their own error otherwise.
            settings.rk4.substeps = 4;
            settings.rollout.rk4.substeps = 12;
            let controller = GuaranteedController::allocate(plant, settings).unwrap();
            let mut planner = controller.planner;
            let [mut last, mut found, mut expected] = [plan(), plan(), plan()];
            let start = vector::<3>(&mut random, 2.5);
            planner.follow_terminal_law(&start, &mut last);
            for stage in last.stages.iter_mut() {
                stage.feedback = SMatrix::from_fn(|_, _| random.uniform(-1.0, 0.0));
            }
            let first = last.stages[0];
            let error = planner.error(&start, &first.u);
            let off = Vector3::from_fn(|i, _| error[i] * random.uniform(-1.0, 1.0));
            let x = first.x + off;
            planner.rest(&x, &last, &mut found);
            planner.roll_out_rest(&x, &last, &mut expected);
            assert!(found.estimated);
            assert_eq!(found.start, x);
            // What rounding makes of states of this size.
            let rounding = 1e-13 * (1.0 + start.amax());
            let most = error.amax();
            for (i, (found, expected)) in found.stages.iter().zip(&expected.stages).enumerate() {
                saturated += usize::from(i + 1 < N && found.u.amax() == 2.0);
                let little = 0.05 * most + rounding;
                assert!((found.x - expected.x).amax() <= little, "{i}");
                assert!((expected.highest - found.highest).max() <= little, "{i}");
                assert!((found.lowest - expected.lowest).max() <= little, "{i}");
            }
            let beyond = first.x + error * 1.1 + Vector3::repeat(rounding);
            for (x, estimated) in [(beyond, false), (x, true)] {
                last.estimated = estimated;
                planner.rest(&x, &last, &mut found);
                planner.roll_out_rest(&x, &last, &mut expected);
                assert!(!found.estimated);
                assert_eq!(found.stages[N - 1].x, expected.stages[N - 1].x);
            }
        }
        assert!(saturated > 100, "{saturated}");
    }
}
