//! The ballbot's regulators in `f32` for a microcontroller, with recorded scenarios to run them
//! on: bare controllers, and a whole robot's.
#![no_std]

pub mod recorded;
mod recording;
mod robot;
mod robot_recording;

use lpvmpc::Reference;
use nalgebra::Vector4;
pub use recording::{Descent, Plane, Recording};
pub use robot::{PlaneMemory, RobotMemory, RobotRegulator};
pub use robot_recording::{RobotRecording, RobotSettings};

/// Horizon, samples.
pub const N: usize = 20;

/// Places for simultaneously active bounds: one per input always suffices.
pub const M: usize = N;

/// The controller of one plane.
pub type Controller = ballbot::Controller<f32>;

/// Its memory.
pub type ControllerMemory = lpvmpc::ControllerArrays<f32, 4, 1, N, M>;

/// The program of a sample and the solver, shared by the planes.
pub type Workspace = ballbot::Workspace<f32>;

/// Their memory.
pub type WorkspaceMemory = lpvmpc::WorkspaceArrays<f32, 4, 1, N, M>;

/// The reference of one plane over a horizon.
#[derive(Clone, Copy, Debug)]
pub struct Window {
    /// x_ref at the stages.
    pub stages: [Vector4<f32>; N],
    /// x_ref at the end of the horizon.
    pub terminal: Vector4<f32>,
}

impl Window {
    /// The same as the controller takes it.
    pub fn reference(&self) -> Reference<'_, f32, 4> {
        Reference {
            stages: &self.stages,
            terminal: self.terminal,
        }
    }
}
