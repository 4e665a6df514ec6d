//! A torque on top of that of the loop, to identify the robot by.

use crate::error::ScenarioError;
use crate::reference::SAME_TIME;
use crate::time_series::TimeSeries;
use lpvmpc::{BoundId, Command, Measurement, Observation, Regulator};
use nalgebra::{Vector1, Vector4};
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

/// A regulator whose command may have an excitation added, which it does not know of.
pub struct Excited<R> {
    pub(crate) regulator: R,
    pub(crate) excitation: Option<Excitation>,
    /// Stamp of the last measurement, s.
    time: f64,
    /// The regulator's own command, N m.
    command: Vector1<f64>,
}

impl<R> Excited<R> {
    /// The regulator with this excitation, or without any.
    pub(crate) fn new(regulator: R, excitation: Option<Excitation>) -> Self {
        Self {
            regulator,
            excitation,
            time: 0.0,
            command: Vector1::zeros(),
        }
    }

    /// The regulator.
    pub fn regulator(&self) -> &R {
        &self.regulator
    }

    fn excited(&mut self, command: Vector1<f64>) -> Vector1<f64> {
        self.command = command;
        match &self.excitation {
            Some(excitation) => command.add_scalar(excitation.at(self.time)),
            None => command,
        }
    }
}

impl<R: Regulator<f64, 4, 1, 4>> Regulator<f64, 4, 1, 4> for Excited<R> {
    fn t_s(&self) -> f64 {
        self.regulator.t_s()
    }

    fn observe(&mut self, measurement: &Measurement<f64, 4>) -> Observation<4> {
        self.time = measurement.t;
        self.regulator.observe(measurement)
    }

    fn decide(&mut self, reference: &dyn Fn(f64) -> Vector4<f64>) -> Command<f64, 4, 1> {
        let command = self.regulator.decide(reference);
        Command {
            u: self.excited(command.u),
            ..command
        }
    }

    fn between(&mut self) -> Option<Vector1<f64>> {
        let next = self.regulator.between();
        if self.excitation.is_none() {
            return next;
        }
        Some(self.excited(next.unwrap_or(self.command)))
    }

    fn take_over(&mut self, previous: &Self) {
        self.regulator.take_over(&previous.regulator);
        (self.time, self.command) = (previous.time, previous.command);
    }

    fn cost(&self) -> f64 {
        self.regulator.cost()
    }

    fn predicted(&self, i: usize) -> Option<Vector4<f64>> {
        self.regulator.predicted(i)
    }

    fn active_bound(&self, i: usize) -> Option<BoundId> {
        self.regulator.active_bound(i)
    }
}
