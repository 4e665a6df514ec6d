//! Decisions that are told more than a reference.

use super::output_feedback::OutputFeedback;
use super::standalone::Standalone;
use super::{Command, Held};
use crate::model::{LpvModel, Scalar};
use crate::preview::Preview;
use crate::workspace::Workspace;

impl<P, T, const NX: usize, const NU: usize, const NS: usize, const NY: usize, const ND: usize>
    OutputFeedback<P, Held<P, T, NX, NU, NS>, T, NX, NU, NS, NY, ND>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
{
    /// [`decide`](Self::decide) with all that may be known ahead, as
    /// [`Controller::step_with`](crate::Controller::step_with) takes it.
    ///
    /// Stage 0 of the preview is when the command acts: the delay after the last measurement. Its
    /// states are in the model's coordinates. Its inputs are commanded ones, without the disturbance
    /// that the filter finds, and its bounds hold within those of the
    /// [settings](super::FeedbackSettings) and of the [share](Self::set_share).
    pub fn decide_with(
        &mut self,
        preview: &Preview<'_, P, T, NX, NU, NS>,
        workspace: &mut Workspace<T, NX, NU>,
    ) -> Command<T, NX, NU> {
        let x_ref = *preview.reference.at(0);
        if self.belief.is_lost() {
            return self.without_state(x_ref);
        }
        let (beside, allowed) = (self.belief.disturbance(), self.allowed());
        self.start = self.belief.ahead(&self.commands, self.settings.delay);
        let planner = &mut self.planner;
        let plan = planner.plan_with(&self.start, &beside, &allowed, preview, workspace);
        let input = planner.command();
        self.command(input, x_ref, plan)
    }

    /// The cost J of the last plan, constant terms included, with the preview of its decision.
    pub fn cost_with(&self, preview: &Preview<'_, P, T, NX, NU, NS>) -> T {
        self.planner.cost_with(&self.start, preview)
    }
}

impl<P, T, const NX: usize, const NU: usize, const NS: usize, const NY: usize, const ND: usize>
    Standalone<
        OutputFeedback<P, Held<P, T, NX, NU, NS>, T, NX, NU, NS, NY, ND>,
        Workspace<T, NX, NU>,
    >
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
{
    /// [`OutputFeedback::decide_with`], with the workspace of its own.
    pub fn decide_with(&mut self, preview: &Preview<'_, P, T, NX, NU, NS>) -> Command<T, NX, NU> {
        self.feedback.decide_with(preview, &mut self.workspace)
    }
}
