//! What a run needs, and what it leaves.

use crate::run::motor_sample::MotorSample;
use lpvmpc_sim::{LogRow, Recording};
use std::time::Duration;

/// What the run reads and reports besides its results.
pub struct RunHooks<'a> {
    /// A monotonic clock, for the time per step.
    pub clock: &'a dyn Fn() -> Duration,
    /// Called with the number of samples done, over all planes.
    pub progress: &'a dyn Fn(usize),
}

impl RunHooks<'_> {
    /// A run that is not timed, so that every step takes no time, and tells nobody of its progress.
    pub const NONE: RunHooks<'static> = RunHooks {
        clock: &|| Duration::ZERO,
        progress: &|_| (),
    };
}

/// A recorded run.
#[derive(Clone, Debug, PartialEq)]
pub struct Record {
    /// What happened in each plane.
    pub planes: Vec<Recording<4, 1, 4>>,
    /// The motors at every sample of the control, where the planes share them.
    pub motors: Option<Vec<MotorSample>>,
    /// What the whole robot's sensors delivered, and its motors were commanded; empty where the
    /// planes run one after the other.
    pub robot_log: Vec<LogRow<10, 3>>,
}
