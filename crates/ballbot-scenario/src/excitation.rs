//! A torque on top of that of the loop, to identify the robot by.

use crate::error::ScenarioError;
use crate::reference::SAME_TIME;
use crate::time_series::TimeSeries;
use ballbot_control::{Handover, PlaneRegulator};
use lpvmpc::{BoundId, Observation};
use lpvmpc_sim::{Decision, Measurement, Regulator};
use nalgebra::{Vector1, Vector4};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

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
        if let [.., (before, _), (last, _)] = steps[..] {
            steps.push((2.0 * last - before, 0.0));
        }
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

/// A regulator whose command has an excitation added, which it does not know of.
pub(crate) struct Excited {
    pub(crate) regulator: Box<dyn PlaneRegulator>,
    pub(crate) excitation: Excitation,
    /// The regulator's own command.
    pub(crate) command: Vector1<f64>,
    /// Time of the last measurement, s.
    pub(crate) time: f64,
}

impl Excited {
    fn excited(&mut self, command: Vector1<f64>) -> Vector1<f64> {
        self.command = command;
        command.add_scalar(self.excitation.at(self.time))
    }
}

impl PlaneRegulator for Excited {
    fn hand_over(&self) -> Handover {
        let torque = self.command[0];
        self.regulator.hand_over().with_torque(torque)
    }

    fn take_over(&mut self, handover: &Handover) {
        self.command[0] = handover.torque();
        self.regulator.take_over(handover);
    }
}

impl Regulator<4, 1, 4> for Excited {
    fn t_s(&self) -> f64 {
        self.regulator.t_s()
    }

    fn observe(&mut self, measurement: &Measurement<4>) -> Observation<4> {
        self.time = measurement.t;
        self.regulator.observe(measurement)
    }

    fn decide(
        &mut self,
        reference: &dyn Fn(f64) -> Vector4<f64>,
        clock: &dyn Fn() -> Duration,
    ) -> Decision<4, 1> {
        let decision = self.regulator.decide(reference, clock);
        Decision {
            u: self.excited(decision.u),
            ..decision
        }
    }

    fn between(&mut self) -> Option<Vector1<f64>> {
        let command = self.regulator.between().unwrap_or(self.command);
        Some(self.excited(command))
    }

    fn prediction(&self) -> Vec<Vector4<f64>> {
        self.regulator.prediction()
    }

    fn active_bounds(&self) -> Vec<BoundId> {
        self.regulator.active_bounds()
    }
}
