//! Controllers on the measured state itself, with memory of their own.

use super::{
    Belief, FeedbackMemory, FeedbackSettings, Guaranteed, Held, OutputFeedback, Planner, Standalone,
};
use crate::controller::Controller;
use crate::guaranteed::{GuaranteedController, GuaranteedWorkspace};
use crate::model::{LpvModel, Scalar};
use crate::ocp::Bounds;
use crate::workspace::Workspace;

/// A controller on the measured state itself, without delay.
pub type StateFeedback<P, T, const NX: usize, const NU: usize, const NS: usize> =
    Standalone<DirectFeedback<P, Held<P, T, NX, NU, NS>, T, NX, NU, NS>, Workspace<T, NX, NU>>;

/// A guaranteed controller on the measured state itself, for which alone it gives its guarantee; `NA` is
/// `NX` + 1.
pub type GuaranteedFeedback<
    P,
    T,
    const NX: usize,
    const NU: usize,
    const NS: usize,
    const NA: usize,
> = Standalone<
    DirectFeedback<P, Guaranteed<P, T, NX, NU, NS, NA>, T, NX, NU, NS>,
    GuaranteedWorkspace<T, NU, NA>,
>;

/// All states are measured, and no disturbance is looked for.
type DirectFeedback<P, K, T, const NX: usize, const NU: usize, const NS: usize> =
    OutputFeedback<P, K, T, NX, NU, NS, NX, 0>;

impl<P, T, const NX: usize, const NU: usize, const NS: usize> StateFeedback<P, T, NX, NU, NS>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS> + Clone,
{
    /// The regulator with this controller, which sees the reference over its horizon.
    pub fn state_feedback(controller: Controller<P, T, NX, NU, NS>) -> Self {
        Self {
            workspace: controller.workspace(),
            feedback: direct(
                controller.model().clone(),
                controller.settings().u,
                Held::new(controller),
                true,
            ),
        }
    }
}

impl<P, T, const NX: usize, const NU: usize, const NS: usize, const NA: usize>
    GuaranteedFeedback<P, T, NX, NU, NS, NA>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS> + PartialEq + Clone,
{
    /// The regulator with this controller, with `preview` of the reference or without.
    pub fn guaranteed_feedback(
        controller: GuaranteedController<P, T, NX, NU, NS>,
        preview: bool,
    ) -> Self {
        Self {
            workspace: controller.workspace(),
            feedback: direct(
                controller.model().clone(),
                controller.settings().u,
                Guaranteed::allocate(controller),
                preview,
            ),
        }
    }
}

fn direct<P, K, T, const NX: usize, const NU: usize, const NS: usize>(
    model: P,
    u: Bounds<T, NU>,
    planner: K,
    preview: bool,
) -> DirectFeedback<P, K, T, NX, NU, NS>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
    K: Planner<T, NX, NU>,
{
    let settings = FeedbackSettings {
        delay: T::zero(),
        period: planner.t_s(),
        preview,
        u,
    };
    let memory = FeedbackMemory::allocate(2, planner.horizon());
    let belief = Belief::measured(model, planner.t_s());
    OutputFeedback::new(belief, planner, settings, memory)
}
