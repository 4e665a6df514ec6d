//! The ballbot's controller in `f32` for a microcontroller, with two recorded scenarios to run
//! it on.
#![no_std]

pub mod recorded;
mod recording;

pub use recording::{Plane, Recording};

/// Horizon, samples.
pub const N: usize = 20;

/// Places for simultaneously active bounds: one per input always suffices.
pub const M: usize = N;

/// The controller of one plane.
pub type Controller = lpvmpc::Controller<ballbot::Ballbot<f32>, f32, 4, 1, 3, N, M>;

/// The reference over the horizon of one plane.
pub type Reference = lpvmpc::Reference<f32, 4, N>;

/// Memory of the solver, shared by the planes.
pub type Workspace = lpvmpc::Workspace<f32, 4, 1, N, M>;
