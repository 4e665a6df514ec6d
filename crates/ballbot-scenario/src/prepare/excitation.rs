//! A torque on top of that of the loop, to identify the robot by.

use crate::error::ScenarioError;
use crate::prepare::time_series::{SAME_TIME, TimeSeries};
use std::path::PathBuf;
use std::sync::Arc;

/// Torque over time; each value holds until the next, and the last as long as the interval
/// before it.
#[derive(Clone, Debug, PartialEq)]
pub struct Excitation {
    /// Times (s) and torques (N m), the last torque zero.
    steps: Arc<[(f64, f64)]>,
}

impl Excitation {
    /// Reads a file of `ballbot excite`.
    ///
    /// # Errors
    /// The file cannot be read, or a row makes no sense.
    pub(crate) fn read(path: PathBuf) -> Result<Self, ScenarioError> {
        let series = TimeSeries::read(path, ["t_s", "torque_excitation_nm"])?;
        let mut steps: Vec<(f64, f64)> = series.rows().collect();
        let [.., (before, _), (last, _)] = steps[..] else {
            let problem =
                "there is one row only, so it is not known when its torque ends; add one of zero";
            return Err(series.problem(None, problem.to_owned()));
        };
        steps.push((2.0 * last - before, 0.0));
        Ok(Self {
            steps: steps.into(),
        })
    }

    /// The torque at the time `t` (s), N m; zero before and after the recording.
    pub fn at(&self, t: f64) -> f64 {
        let passed = self
            .steps
            .partition_point(|(time, _)| *time <= t + SAME_TIME);
        passed
            .checked_sub(1)
            .map_or(0.0, |place| self.steps[place].1)
    }
}
