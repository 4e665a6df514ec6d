//! A step in two parts, the long one before the state is measured, and what the short one leaves for
//! later.

use crate::by_stage::PlantByStage;
use crate::controller::{Controller, Reference, next_state};
use crate::descent::Outcome;
use crate::first_plan::First;
use crate::linearization::{Along, States};
use crate::model::{LpvModel, Scalar};
use crate::plan::{Aim, Prices, at};
use crate::preview::Preview;
use crate::settings::Iterations;
use crate::solution::{Solution, Status};
use crate::working_set::copy;
use crate::workspace::Workspace;
use nalgebra::SVector;

/// What a feedback leaves of its step for later.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Answered<T, const NX: usize> {
    /// All that follows from the state that it was given.
    At(SVector<T, NX>),
    /// What follows from the state that comes next.
    Before(SVector<T, NX>),
}

/// A program that waits for the measured state.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Prepared<T, const NX: usize> {
    /// The state that is expected.
    x: SVector<T, NX>,
    /// What came of factorising it.
    factorized: Result<(), Status<T>>,
    /// Whether the plan has moved on to the coming sample, as that of a descent does.
    pub moved_on: bool,
}

impl<P, T, const NX: usize, const NU: usize, const NS: usize> Controller<P, T, NX, NU, NS>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
{
    /// What a step can do before the state is measured: the rest of the last step, the program's
    /// matrices, and the backward sweep. [`feedback`](Self::feedback) then takes little time.
    ///
    /// `reference` is that of the coming sample. Until the feedback the workspace is this
    /// controller's alone. Without a past there is nothing to prepare.
    pub fn prepare(
        &mut self,
        reference: &Reference<'_, T, NX>,
        workspace: &mut Workspace<T, NX, NU>,
    ) {
        match self.fixed.take() {
            None => self.prepare_sample(reference, (), workspace),
            Some(fixed) => (fixed.run)(self, None, reference, fixed, workspace),
        }
    }

    /// What there is to prepare, with what the stages have of their own.
    pub(crate) fn prepare_sample<D: PlantByStage<P, T, NX, NU, NS>>(
        &mut self,
        reference: &Reference<'_, T, NX>,
        own: D,
        workspace: &mut Workspace<T, NX, NU>,
    ) {
        self.put_back();
        if !workspace.holds(self.settings.horizon) {
            return;
        }
        let aim = &self.aim(reference, own);
        let moved_on = matches!(self.settings.iterations, Iterations::Descent { .. });
        let x;
        if moved_on {
            self.pose(&at(&self.rollout, 0), aim, workspace);
            let answered = self.answered.take();
            let expected = { self.initialised }
                .then(|| self.prepare_descent(answered, aim, workspace))
                .flatten();
            let Some(expected) = expected else {
                self.initialised = false;
                return;
            };
            x = expected;
        } else {
            self.make_up(own);
            if !self.initialised {
                return;
            }
            x = at(&self.rollout, 0);
            self.pose(&x, aim, workspace);
            self.predict(&x, own, &mut workspace.ocp);
            self.track(aim, &mut workspace.ocp);
            if D::SOME {
                let plan = (&x, &*self.solution.u);
                self.pose_outputs(plan, 1, (aim, T::zero()), &mut workspace.ocp);
            }
        }
        self.prepared = Some(Prepared {
            x,
            factorized: workspace.solver.factorize(&workspace.ocp),
            moved_on,
        });
    }

    /// The answer to the measured state `x` by the program that [`prepare`](Self::prepare) made
    /// ready with this `reference`; a whole step where nothing is prepared.
    ///
    /// It is the answer of one program. Of a descent it is not known yet whether it is an
    /// improvement; the next `prepare` goes on from the better plan. The inputs are finite and
    /// within the input bounds, whatever the status says.
    pub fn feedback(
        &mut self,
        x: &SVector<T, NX>,
        reference: &Reference<'_, T, NX>,
        workspace: &mut Workspace<T, NX, NU>,
    ) -> &Solution<T, NX, NU> {
        let Some(Prepared { factorized, .. }) = self.prepared.take() else {
            return self.step(x, reference, workspace);
        };
        self.answer(x, factorized, workspace);
        self.answered = Some(Answered::At(*x));
        &self.solution
    }

    /// The answer of the program that was made ready.
    pub(crate) fn answer(
        &mut self,
        x: &SVector<T, NX>,
        factorized: Result<(), Status<T>>,
        workspace: &mut Workspace<T, NX, NU>,
    ) {
        let Workspace { ocp, solver, .. } = workspace;
        ocp.x0 = *x;
        let settings = &self.settings.solver;
        solver.solve_factorized(factorized, ocp, settings, &mut self.solution);
        self.problems = 1;
        self.take_feedback(workspace);
    }

    /// The rollout that a feedback has left for later.
    #[inline(always)]
    pub(crate) fn make_up<D: PlantByStage<P, T, NX, NU, NS>>(&mut self, own: D) {
        self.put_back();
        match self.answered.take() {
            None => return,
            Some(Answered::At(x)) => self.roll_out(&x, ()),
            Some(Answered::Before(x)) if D::SOME => self.roll_out_rest(&x, own),
            Some(Answered::Before(_)) => self.initialised = false,
        }
        copy(&mut self.policy.u, &self.solution.u);
    }

    /// Makes up for what [`Controller::feedback`] left: the plan, one sample after `x` was measured,
    /// is the best of what was planned before and of what the program answered. Then the program
    /// along it is made ready. The state that is expected; `None` if nothing is finite.
    fn prepare_descent<D: PlantByStage<P, T, NX, NU, NS>>(
        &mut self,
        answered: Option<Answered<T, NX>>,
        aim: &Aim<'_, T, NX, NU, D>,
        workspace: &mut Workspace<T, NX, NU>,
    ) -> Option<SVector<T, NX>> {
        self.track(aim, &mut workspace.ocp);
        let last = self.last_stage();
        // Where the plant will be, as far as the model knows.
        let x = match answered {
            Some(Answered::At(x)) => {
                let u = at(&self.solution.u, 0);
                next_state(&self.model, &self.settings, &x, &u)
            }
            Some(Answered::Before(x)) => x,
            None => at(&self.rollout, 0),
        };
        if self.first_plan(&x, aim, workspace) == First::Nothing {
            return None;
        }
        if answered.is_some() && self.solution.status.is_solved() {
            let mut prices = Prices::none();
            prices.raise(&self.solution.active);
            let merit = self.merit(aim, prices);
            self.policy.cost = merit.of(&x, &self.policy.u, &self.rollout);
            let trial = &mut workspace.trial;
            let taken = self.search_line(&x, &merit, (T::zero(), T::one()), trial, &|i| {
                let u = if i < last {
                    at(&self.solution.u, i + 1)
                } else {
                    at(&self.policy.u, i)
                };
                (at(&self.solution.x, i), u)
            });
            self.take_if_some(taken.map(|(_, cost)| cost), &workspace.trial);
            self.adapt_damping(aim, &Outcome::NothingToGain { hidden: false });
        }
        self.linearize_plan(&x, aim, (Along::Jacobian, States::Follow), workspace);
        Some(x)
    }

    /// What was prepared is not used: a plan that has moved on to the coming sample becomes that of the sample before
    /// again, whose own input nothing depends on.
    #[inline(always)]
    pub(crate) fn put_back(&mut self) {
        if let Some(prepared) = self.prepared.take()
            && prepared.moved_on
        {
            self.shift_back(prepared.x);
        }
    }

    /// [`prepare`](Self::prepare) with all that may be known ahead of the coming sample.
    pub fn prepare_with(
        &mut self,
        preview: &Preview<'_, P, T, NX, NU, NS>,
        workspace: &mut Workspace<T, NX, NU>,
    ) {
        self.with_rows(preview, workspace, |controller, given, workspace| {
            controller.prepare_sample(&preview.reference, given, workspace);
        });
    }

    /// [`feedback`](Self::feedback) after a [`prepare_with`](Self::prepare_with) of the same preview.
    /// It takes a Runge-Kutta step more than [`feedback`](Self::feedback).
    pub fn feedback_with(
        &mut self,
        x: &SVector<T, NX>,
        preview: &Preview<'_, P, T, NX, NU, NS>,
        workspace: &mut Workspace<T, NX, NU>,
    ) -> &Solution<T, NX, NU> {
        let Some(Prepared { factorized, .. }) = self.prepared.take() else {
            return self.step_with(x, preview, workspace);
        };
        self.with_rows(preview, workspace, |controller, given, workspace| {
            controller.answer(x, factorized, workspace);
            let u = at(&controller.solution.u, 0);
            let (model, settings) = (&controller.model, &controller.settings);
            let next = given.next_state(0, model, settings, x, &u);
            controller.answered = Some(Answered::Before(next));
        });
        &self.solution
    }

    /// The nonlinear model under the last plan's second and further inputs, from the state that its
    /// first led to; what `own` has at stage 0 is of the plan's stage 1.
    #[cold]
    pub(crate) fn roll_out_rest<D: PlantByStage<P, T, NX, NU, NS>>(
        &mut self,
        x: &SVector<T, NX>,
        own: D,
    ) {
        let mut state = *x;
        let places = self.rollout.iter_mut().zip(self.solution.u.iter());
        for (i, (place, u)) in places.enumerate().take(self.settings.horizon) {
            if let Some(before) = i.checked_sub(1) {
                state = own.next_state(before, &self.model, &self.settings, &state, u);
            }
            *place = state;
        }
        self.gap = state - at(&self.solution.x, self.last_stage());
        self.initialised = state.iter().all(|entry| entry.is_finite());
    }
}
