//! The predictor's matrices of a program, along the last rollout (Algorithm 1, lines 1 to 8).

use crate::by_stage::PlantByStage;
use crate::controller::Controller;
use crate::model::{LpvModel, Scalar};
use crate::ocp::{Ocp, Stage};
use crate::plan::at;
use crate::settings::ControllerSettings;
use core::array::from_fn;
use nalgebra::SVector;

/// So many stages are linearised together where that takes less time.
const GROUP: usize = 4;

/// States and inputs of such a group.
type Group<'a, T, const NX: usize, const NU: usize> =
    (&'a [SVector<T, NX>; GROUP], &'a [SVector<T, NU>; GROUP]);

impl<P, T, const NX: usize, const NU: usize, const NS: usize> Controller<P, T, NX, NU, NS>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
{
    /// Algorithm 2, step 1: without a past, the plant is expected to stay at `x`.
    pub(crate) fn initialise_scheduling(&mut self, x: &SVector<T, NX>) {
        if !self.initialised {
            self.rollout.fill(*x);
            self.solution.u.fill(SVector::zeros());
        }
    }

    /// Algorithm 1, lines 1 to 8: the predictor's matrices along the scheduling window, which
    /// is that of the last rollout (Algorithm 2, steps 5 and 9).
    pub(crate) fn predict<D: PlantByStage<P, T, NX, NU, NS>>(
        &self,
        x: &SVector<T, NX>,
        own: D,
        ocp: &mut Ocp<T, NX, NU>,
    ) {
        ocp.horizon = self.settings.horizon;
        ocp.x0 = *x;
        self.linearize(x, &self.solution.u, 1, own, ocp);
    }

    /// The predictor's matrices along the last rollout, which began at `x` and had these
    /// `inputs`, from its sample `first` (0 or 1) on; the last input is repeated.
    // Not inlined, so that each loop has the registers for itself: a tenth of the step's time.
    #[inline(never)]
    pub(crate) fn linearize<D: PlantByStage<P, T, NX, NU, NS>>(
        &self,
        x: &SVector<T, NX>,
        inputs: &[SVector<T, NU>],
        first: usize,
        own: D,
        ocp: &mut Ocp<T, NX, NU>,
    ) {
        let horizon = self.settings.horizon;
        if P::TOGETHER {
            let done = self.in_groups(x, inputs, first, &mut ocp.stages, |motion, stages| {
                let Some(made) = own.predict_each(&self.model, &self.settings, motion) else {
                    return false;
                };
                for ((c, a, b), stage) in made.iter().zip(stages) {
                    (stage.a, stage.b, stage.c) = (*a, *b, *c);
                }
                true
            });
            let rest = ocp.stages.iter_mut().enumerate().take(horizon);
            for (i, stage) in rest.skip(done) {
                let (x, u) = self.expected(x, inputs, first + i);
                (stage.a, stage.b, stage.c) = own.predict(i, &self.model, &self.settings, &x, &u);
            }
            return;
        }
        let states = core::iter::once(x).chain(self.rollout.iter()).skip(first);
        let inputs = inputs.iter().take(horizon);
        let window = states.zip(inputs.clone().skip(first).chain(inputs.last()));
        let samples = ocp.stages.iter_mut().zip(window).take(horizon);
        if D::SOME {
            for (i, (stage, (x, u))) in samples.enumerate() {
                (stage.a, stage.b, stage.c) = own.predict(i, &self.model, &self.settings, x, u);
            }
            return;
        }
        // The same again, for its registers: 2 % of the step's instructions.
        let ControllerSettings { t_s, predictor, .. } = &self.settings;
        let held = self.settings.scheduling.held();
        for (stage, (x, u)) in samples {
            let pair = predictor.linearize_along(&self.model, held, x, u, *t_s);
            let c = predictor.offset_along(&self.model, held, (x, u), *t_s, &pair);
            stage.c = c.unwrap_or_else(SVector::zeros);
            (stage.a, stage.b) = pair;
        }
    }

    /// State and input that are expected `i` samples from `x` on, along the last rollout and these `inputs`; beyond the
    /// last, the last.
    fn expected(
        &self,
        x: &SVector<T, NX>,
        inputs: &[SVector<T, NU>],
        i: usize,
    ) -> (SVector<T, NX>, SVector<T, NU>) {
        let state = i
            .checked_sub(1)
            .map_or(*x, |before| at(&self.rollout, before));
        (state, at(inputs, i))
    }

    /// Has the `stages` written from states and inputs, in groups, until there is no whole group left or `write` makes
    /// nothing of them. The states are those of the rollout from `x`, the `first` of them for the first stage.
    /// Returns how many stages were written.
    pub(crate) fn in_groups(
        &self,
        x: &SVector<T, NX>,
        inputs: &[SVector<T, NU>],
        first: usize,
        stages: &mut [Stage<T, NX, NU>],
        write: impl Fn(Group<'_, T, NX, NU>, &mut [Stage<T, NX, NU>; GROUP]) -> bool,
    ) -> usize {
        let mut done = 0;
        let (groups, _) = stages.as_chunks_mut();
        for stages in groups.iter_mut().take(self.settings.horizon / GROUP) {
            let expected: [_; GROUP] = from_fn(|k| self.expected(x, inputs, first + done + k));
            let (states, inputs) = (expected.map(|(x, _)| x), expected.map(|(_, u)| u));
            if !write((&states, &inputs), stages) {
                break;
            }
            done += GROUP;
        }
        done
    }
}
