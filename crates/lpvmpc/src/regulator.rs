//! All that stands between the sensors and the actuators: what is simulated is what ships.
//!
//! ```text
//! observe    the readings become a state           Belief: measured, or the Kalman filter
//! decide     the state is carried on to the moment when the input acts      DelayLine
//!            the reference is looked up over the horizon                    Window
//!            a plan is made, within what is left of the bounds              Planner
//!            its first input is commanded                                   Command
//! between    an input that moves in a ramp goes on
//! ```
//!
//! [`OutputFeedback`] is that, for any plant, without heap and without a clock of its own. A
//! simulator, a page and a microcontroller step the same object.

mod any_planner;
mod belief;
mod decide_with;
#[cfg(feature = "alloc")]
mod direct;
mod guaranteed;
mod held;
mod measured;
mod output_feedback;
mod planner;
mod ramped;
mod standalone;
mod window;

use crate::estimator::{Observation, Reading};
use crate::guaranteed::Decision;
use crate::model::Scalar;
use crate::solution::{BoundId, Status};
pub use any_planner::AnyPlanner;
pub use belief::Belief;
#[cfg(feature = "alloc")]
pub use direct::{GuaranteedFeedback, StateFeedback};
pub use guaranteed::{Guaranteed, GuaranteedPlannerMemory};
pub use held::Held;
pub use measured::MeasuredState;
use nalgebra::SVector;
pub use output_feedback::{FeedbackArrays, FeedbackMemory, FeedbackSettings, OutputFeedback};
pub use planner::{Planned, Planner};
pub use ramped::Ramped;
pub use standalone::Standalone;

/// What `NY` sensors deliver at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measurement<T, const NY: usize> {
    /// Its stamp, s (see [`Clock`](crate::Clock)).
    pub t: f64,
    /// The readings, in the units of the measured quantities, with the time since each was taken;
    /// `None` where one is missing.
    pub readings: [Option<Reading<T>>; NY],
}

/// What was decided at a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Command<T, const NX: usize, const NU: usize> {
    /// The input from now on: finite and within its bounds, whatever the status.
    pub u: SVector<T, NU>,
    /// The state at the last measurement, as the sensors see it.
    pub estimate: SVector<T, NX>,
    /// State reference at the sample.
    pub x_ref: SVector<T, NX>,
    /// What the plan is worth.
    pub status: Status<T>,
    /// Bounds that are active in the plan.
    pub active_bounds: usize,
    /// Nonlinear rollout minus prediction at the end of the horizon, in state units.
    pub gap: SVector<T, NX>,
    /// What only a guaranteed controller knows.
    pub guarantee: Option<Guarantee<T>>,
}

/// What a guaranteed controller says of a sample besides its plan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Guarantee<T> {
    /// What the input is backed by.
    pub decision: Decision,
    /// The artificial set point z: the plan ends at z times the direction of the set points.
    pub set_point: T,
}

/// What stands between `NY` sensors and the actuators of a plant of `NX` states and `NU` inputs.
pub trait Regulator<T: Scalar, const NX: usize, const NU: usize, const NY: usize> {
    /// Time from one decision to the next, s.
    fn t_s(&self) -> T;

    /// Takes in what the sensors deliver, and says what became of it. Called at every sample of
    /// the sensors, in order; at a control sample before [`decide`](Self::decide).
    fn observe(&mut self, measurement: &Measurement<T, NY>) -> Observation<NY>;

    /// The command from the last measurement on. `reference` is the state reference at a time in
    /// s, on the clock of the measurements' stamps.
    fn decide(&mut self, reference: &dyn Fn(f64) -> SVector<T, NX>) -> Command<T, NX, NU>;

    /// The command at a sample of the sensors between two control samples, called after
    /// [`observe`](Self::observe); `None` to hold the last one, as most do.
    fn between(&mut self) -> Option<SVector<T, NU>> {
        None
    }

    /// Goes on from where `previous` stands, which has other settings: what it knows, what it has
    /// commanded, what it plans. With the same settings it goes on as that one would have, to the
    /// last bit.
    fn take_over(&mut self, previous: &Self);

    /// The cost J of the last plan (Algorithm 1), constant terms included; NaN before the first.
    fn cost(&self) -> T;

    /// The state that the model reaches under the last plan `i` + 1 samples after the input acts,
    /// in the model's coordinates; `None` beyond the horizon, and from one that has no such plan.
    fn predicted(&self, _i: usize) -> Option<SVector<T, NX>> {
        None
    }

    /// The states that the model reaches under the last plan, one per sample of the horizon.
    fn prediction(&self) -> impl Iterator<Item = SVector<T, NX>> {
        (0..).map_while(|i| self.predicted(i))
    }

    /// The bound `i` of those that are active in the last plan; `None` from where there are no
    /// more.
    fn active_bound(&self, _i: usize) -> Option<BoundId> {
        None
    }

    /// The bounds that are active in the last plan; none from a regulator that does not tell.
    fn active_bounds(&self) -> impl Iterator<Item = BoundId> {
        (0..).map_while(|i| self.active_bound(i))
    }
}
