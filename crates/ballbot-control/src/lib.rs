//! Regulators of one plane of a ballbot: the controller of `lpvmpc` with all that stands around it
//! on a real robot.

mod feedback;
mod guarded;
mod handover;
mod output_feedback;
mod plane_regulator;
mod planner;
mod ramped;
mod regulators;

pub use feedback::Feedback;
pub use guarded::guarded_feedback;
pub use handover::Handover;
pub use plane_regulator::PlaneRegulator;
pub use ramped::ramped_feedback;
pub use regulators::{RegulatorError, output_feedback, state_feedback};
