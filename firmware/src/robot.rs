//! The regulator of a whole robot in static memory.

use crate::{ControllerMemory, N, WorkspaceMemory};
use ballbot::{EstimatorArrays, Held};
use lpvmpc::FeedbackArrays;

/// Instants that a plane's estimator remembers: those of 0.1 s, with a measurement every 12.5 ms
/// and a change of the torque in between.
const INSTANTS: usize = 16;

/// Torques that are on their way at once.
const COMMANDS: usize = 4;

/// The regulator: both planes and the heading on three motors.
pub type RobotRegulator = ballbot::RobotRegulator<f32, Held<f32>>;

/// Its memory.
#[derive(Clone, Copy, Debug, Default)]
pub struct RobotMemory {
    /// Of each plane.
    pub planes: [PlaneMemory; 2],
    /// Of the program and the solver, which the planes share.
    pub workspace: WorkspaceMemory,
}

/// Memory of one plane.
#[derive(Clone, Copy, Debug, Default)]
pub struct PlaneMemory {
    /// Of the controller.
    pub controller: ControllerMemory,
    /// Of the estimator.
    pub estimator: EstimatorArrays<f32, INSTANTS>,
    /// Of the feedback pipeline around them.
    pub feedback: FeedbackArrays<f32, 4, 1, N, COMMANDS>,
}
