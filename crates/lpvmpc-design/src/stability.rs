//! Checks of stability: of a fixed gain over a scheduling box, and of an integration step.

mod frozen;
mod rk4_step;

pub use frozen::{FrozenError, FrozenStability, SchedulingGrid, frozen_stability};
pub use rk4_step::{
    MOST_RK4_SUBSTEPS, Rk4Step, Rk4StepError, accurate_rk4_substeps, check_rk4_step,
};
