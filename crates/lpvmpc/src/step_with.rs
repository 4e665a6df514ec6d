//! Samples that are told more than a reference, and what may change while a controller runs.

use crate::by_stage::{CostByStage, Given, PlantByStage};
use crate::controller::{Answered, Controller, Reference};
use crate::list::List;
use crate::model::{LpvModel, Scalar};
use crate::ocp::GeneralRow;
use crate::plan::at;
use crate::preview::{Preview, PreviewError, PreviewPart, check_rows, fit};
use crate::settings::{ControllerError, ControllerSettings, InputReference, check};
use crate::solution::{Solution, Status};
use crate::workspace::Workspace;
use nalgebra::SVector;

/// General rows of every sample, beside the step that knows them: without any, a program has no machine
/// code for rows.
#[derive(Debug)]
#[cfg_attr(feature = "alloc", derive(Clone))]
pub(crate) struct FixedRows<P, T: 'static, const NX: usize, const NU: usize, const NS: usize> {
    rows: List<GeneralRow<T, NX, NU>>,
    pub run: Run<P, T, NX, NU, NS>,
}

/// A step from a measured state, or without one what can be prepared. It puts the rows back.
type Run<P, T, const NX: usize, const NU: usize, const NS: usize> = fn(
    &mut Controller<P, T, NX, NU, NS>,
    Option<&SVector<T, NX>>,
    &Reference<'_, T, NX>,
    FixedRows<P, T, NX, NU, NS>,
    &mut Workspace<T, NX, NU>,
);

impl<P, T, const NX: usize, const NU: usize, const NS: usize> Controller<P, T, NX, NU, NS>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
{
    /// [`step`](Self::step) with all that may be known ahead: references, weights, bounds, general
    /// rows, disturbances, scheduling and the plant itself, stage by stage.
    ///
    /// The workspace needs room for rows, and for stages with weights or bounds of their own, where
    /// there are any ([`Capacity`](crate::Capacity)). A preview that makes no sense or does not fit is
    /// [`Status::Refused`]. The inputs are finite and within the input bounds, those of the preview
    /// unless it is refused.
    pub fn step_with(
        &mut self,
        x: &SVector<T, NX>,
        preview: &Preview<'_, P, T, NX, NU, NS>,
        workspace: &mut Workspace<T, NX, NU>,
    ) -> &Solution<T, NX, NU> {
        self.with_rows(preview, workspace, |controller, given, workspace| {
            controller.sample(x, &preview.reference, given, workspace);
            controller.keep_inputs_within(&given);
        });
        &self.solution
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
        let Some(factorized) = self.prepared.take() else {
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

    /// [`tracking_cost`](Self::tracking_cost) of the last plan, with the preview of its step.
    pub fn tracking_cost_with(
        &self,
        x: &SVector<T, NX>,
        preview: &Preview<'_, P, T, NX, NU, NS>,
    ) -> T {
        let given = Given { preview, rows: &[] };
        self.own_cost(x, &preview.reference, &given)
    }

    /// General rows for every stage of every sample from the next one on, unless a preview has others;
    /// `List::empty()` for none. The workspace needs room for them
    /// ([`Capacity::with_general_rows`](crate::Capacity::with_general_rows)).
    ///
    /// # Errors
    /// [`ControllerError::Rows`]; the rows are then as they were.
    pub fn set_rows(&mut self, rows: List<GeneralRow<T, NX, NU>>) -> Result<(), ControllerError> {
        check_rows(&rows).map_err(ControllerError::Rows)?;
        let run: Run<P, T, NX, NU, NS> = Self::run_with_rows;
        self.fixed = (!rows.is_empty()).then_some(FixedRows { rows, run });
        self.prepared = None;
        Ok(())
    }

    /// Another model of the plant from the next step on; the last plan stays its start.
    pub fn set_model(&mut self, model: P) {
        self.model = model;
        (self.prepared, self.aimed_at) = (None, None);
    }

    /// Other settings from the next step on: weights, bounds, prices, terminal ingredient, input
    /// reference, scheduling, iterations. Horizon and sampling time stay; for others
    /// another controller [takes over](Self::take_over).
    ///
    /// # Errors
    /// A [`ControllerError`] names the first setting that makes no sense; they are then as they were.
    pub fn set_settings(
        &mut self,
        settings: ControllerSettings<T, NX, NU, NS>,
    ) -> Result<(), ControllerError> {
        let ControllerSettings { horizon, t_s, .. } = self.settings;
        if (settings.horizon, settings.t_s) != (horizon, t_s) {
            return Err(ControllerError::Another);
        }
        check(&settings, horizon)?;
        self.settings = settings;
        (self.prepared, self.aimed_at, self.target) = (None, None, None);
        Ok(())
    }

    /// A sample with the controller's own rows.
    fn run_with_rows(
        &mut self,
        x: Option<&SVector<T, NX>>,
        reference: &Reference<'_, T, NX>,
        fixed: FixedRows<P, T, NX, NU, NS>,
        workspace: &mut Workspace<T, NX, NU>,
    ) {
        self.fixed = Some(fixed);
        let preview = Preview::new(*reference);
        match x {
            Some(x) => {
                self.step_with(x, &preview, workspace);
            }
            None => self.prepare_with(&preview, workspace),
        }
    }

    /// `run` with the preview and the controller's own rows, if they make sense.
    fn with_rows<'a>(
        &mut self,
        preview: &'a Preview<'a, P, T, NX, NU, NS>,
        workspace: &mut Workspace<T, NX, NU>,
        run: impl FnOnce(&mut Self, Given<'_, P, T, NX, NU, NS>, &mut Workspace<T, NX, NU>),
    ) {
        let room = workspace.room(self.settings.horizon);
        let fixed = self.fixed.take();
        let rows: &[_] = fixed.as_ref().map_or(&[], |fixed| &fixed.rows);
        let used = if preview.rows.is_empty() { rows } else { &[] };
        let fits = fit(used.len(), room.horizon + 1, room.rows);
        let fits = fits.map_err(|mistake| PreviewError {
            part: PreviewPart::Rows,
            stage: 0,
            mistake,
        });
        match preview.check(&room).and(fits) {
            Ok(()) => run(self, Given { preview, rows }, workspace),
            Err(error) => self.give_up(Status::Refused(error)),
        }
        self.fixed = fixed;
    }

    /// Also where no program was posed: the inputs of a failure are those of the settings' bounds.
    fn keep_inputs_within<D: CostByStage<T, NX, NU>>(&mut self, own: &D) {
        for (i, u) in self.solution.u.iter_mut().enumerate() {
            *u = own.u(i).unwrap_or(&self.settings.u).project(u);
        }
    }

    /// The steady state of the plant as it is at the end of the horizon. `false` where that is the
    /// settings'.
    pub(crate) fn find_own_target<D: PlantByStage<P, T, NX, NU, NS>>(
        &mut self,
        x_ref: &SVector<T, NX>,
        own: D,
    ) -> bool {
        let target = if own.u_ref(0).is_some() {
            None
        } else if self.settings.input_reference != InputReference::SteadyState {
            return false;
        } else {
            match own.steady_state(&self.model, &self.settings, x_ref) {
                Some(target) => target,
                None => return false,
            }
        };
        (self.aimed_at, self.target) = (None, target);
        true
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
