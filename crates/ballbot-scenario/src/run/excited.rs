//! A regulator with a torque on top, to identify the robot by.

use crate::prepare::excitation::Excitation;
use lpvmpc::{BoundId, Command, Measurement, Observation, Regulator};
use nalgebra::{Vector1, Vector4};

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
