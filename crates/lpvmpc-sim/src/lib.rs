//! Simulated plants and closed loops: what a controller of [`lpvmpc`] meets before it meets a
//! robot. No files, no clock of its own.

pub mod closed_loop;
pub mod plant;

pub use closed_loop::{Ending, Experiment, Sample, Trajectory, run};
pub use plant::{PlantError, Tolerances, advance};
