//! Regulators of one plane of a ballbot: the controller of `lpvmpc` with all that stands around it
//! on a real robot.
//!
//! The method's sizes are known at compile time, a user's horizon at run time. Here is where they
//! meet: a few sizes are compiled, and the smallest that the horizon fits in is taken.

mod boxed;
mod feedback;
mod guarded;
mod handover;
mod output_feedback;
mod plane_regulator;
mod planner;
mod ramped;
mod regulators;

pub use feedback::Feedback;
pub use guarded::{GUARDED_ACTIVE, guarded_feedback};
pub use handover::Handover;
pub use plane_regulator::PlaneRegulator;
pub use ramped::ramped_feedback;
pub use regulators::{LONGEST_HORIZON, RegulatorError, output_feedback, state_feedback};
