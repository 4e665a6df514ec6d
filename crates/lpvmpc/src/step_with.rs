//! Samples that are told more than a reference.

use crate::by_stage::{CostByStage, Given, PlantByStage};
use crate::controller::Controller;
use crate::model::{LpvModel, Scalar};
use crate::preview::{Preview, PreviewError, PreviewPart, fit};
use crate::settings::InputReference;
use crate::solution::{Solution, Status};
use crate::workspace::Workspace;
use nalgebra::SVector;

impl<P, T, const NX: usize, const NU: usize, const NS: usize> Controller<P, T, NX, NU, NS>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
{
    /// [`step`](Self::step) with all that may be known ahead: references, weights, bounds, general
    /// rows, disturbances, scheduling and the plant itself, stage by stage.
    ///
    /// The workspace needs room for rows, and for stages with weights or bounds of their own, where there are any, and the
    /// controller for those that are active: memory of the same [`Capacity`](crate::Capacity). A preview that makes no
    /// sense or does not fit is [`Status::Refused`]. The inputs are finite and within the input bounds, those of the
    /// preview unless it is refused.
    pub fn step_with(
        &mut self,
        x: &SVector<T, NX>,
        preview: &Preview<'_, P, T, NX, NU, NS>,
        workspace: &mut Workspace<T, NX, NU>,
    ) -> &Solution<T, NX, NU> {
        self.step_beside(x, None, preview, workspace)
    }

    /// The same with a constant input `beside` the planned one, if there is any.
    pub(crate) fn step_beside(
        &mut self,
        x: &SVector<T, NX>,
        beside: Option<&SVector<T, NU>>,
        preview: &Preview<'_, P, T, NX, NU, NS>,
        workspace: &mut Workspace<T, NX, NU>,
    ) -> &Solution<T, NX, NU> {
        self.with_rows(preview, workspace, |controller, given, workspace| {
            let given = Given { beside, ..given };
            controller.sample(x, &preview.reference, given, workspace);
            controller.keep_inputs_within(&given);
        });
        &self.solution
    }

    /// [`tracking_cost`](Self::tracking_cost) of the last plan, with the preview of its step.
    pub fn tracking_cost_with(
        &self,
        x: &SVector<T, NX>,
        preview: &Preview<'_, P, T, NX, NU, NS>,
    ) -> T {
        let given = Given::new(preview, &[]);
        self.own_cost(x, &preview.reference, given)
    }

    /// `run` with the preview and the controller's own rows, if they make sense.
    pub(crate) fn with_rows<'a>(
        &mut self,
        preview: &'a Preview<'a, P, T, NX, NU, NS>,
        workspace: &mut Workspace<T, NX, NU>,
        run: impl FnOnce(&mut Self, Given<'_, P, T, NX, NU, NS>, &mut Workspace<T, NX, NU>),
    ) {
        let room = workspace.room(self.settings.horizon);
        let fixed = self.fixed.take();
        let rows: &[_] = fixed.as_ref().map_or(&[], |fixed| &fixed.rows);
        let used = if preview.rows.is_empty() { rows } else { &[] };
        let used = used.len() + preview.output_rows();
        let fits = fit(used, room.horizon + 1, room.rows);
        let fits = fits.map_err(|mistake| PreviewError {
            part: PreviewPart::Rows,
            stage: 0,
            mistake,
        });
        let checked = preview.check(&self.settings.weights, &room).and(fits);
        let given = Given::new(preview, rows);
        match checked {
            Ok(()) => run(self, given, workspace),
            Err(error) => self.give_up(Status::Refused(error)),
        }
        self.fixed = fixed;
    }

    /// Also where no program was posed: the inputs of a failure are those of the settings' bounds.
    fn keep_inputs_within<D: CostByStage<T, NX, NU>>(&mut self, own: &D) {
        for (i, u) in self.solution.u.iter_mut().enumerate() {
            *u = own.u(i, &self.settings.u).project(u);
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
}
