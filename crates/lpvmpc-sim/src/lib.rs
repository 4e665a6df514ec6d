//! Simulated plants and closed loops: what a controller of [`lpvmpc`] meets before it meets a
//! robot. No files, no clock of its own, no randomness but from a seed.
//!
//! [`advance`] moves a plant under a held input. A [`World`] puts sensors, actuators, a delay
//! and pushes around it. A [`ClosedLoop`] is a world with a [`Regulator`](lpvmpc::Regulator) in it, and [`run`]
//! records one from beginning to end.
#![allow(
    clippy::neg_cmp_op_on_partial_ord,
    reason = "a comparison with a number that is not one must take the failing branch"
)]

mod actuator;
pub mod closed_loop;
mod disturbance;
mod guarded_loop;
pub mod plant;
mod random;
mod sensor;
mod world;

pub use actuator::Actuator;
pub use closed_loop::{
    ClosedLoop, Course, Ending, Experiment, LogRow, Recording, Sample, Trajectory, WithoutPlan,
    record, run,
};
pub use disturbance::Disturbance;
pub use guarded_loop::{Actuation, GuardedLoop};
pub use plant::{Plant, PlantError, Tolerances, Unloaded, advance};
pub use random::Random;
pub use sensor::Sensor;
pub use world::{World, WorldError, WorldSettings};
