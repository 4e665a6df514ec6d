//! Regulators of one plane of a ballbot: the controller of `lpvmpc` with all that stands around it
//! on a real robot.
//!
//! The method's sizes are known at compile time, a user's horizon at run time. Here is where they
//! meet: a few sizes are compiled, and the smallest that the horizon fits in is taken.

mod boxed;
mod feedback;
mod guarded;
mod output_feedback;
mod planner;
mod ramped;
mod regulators;
mod sharing;

pub use feedback::Feedback;
pub use guarded::{GUARDED_ACTIVE, guarded_feedback};
pub use ramped::ramped_feedback;
pub use regulators::{LONGEST_HORIZON, RegulatorError, output_feedback, state_feedback};
pub use sharing::SharingPlane;
