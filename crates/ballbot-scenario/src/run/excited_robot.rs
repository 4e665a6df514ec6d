//! A whole robot's regulator with a torque on top in the x plane, to identify the robot by.

use crate::prepare::excitation::Excitation;
use crate::run::motor_sample::WholeRegulator;
use ballbot::{Heading, RobotState};
use lpvmpc::{Command, Measurement, Observation, Regulator, Restart};
use nalgebra::{Vector2, Vector3};

/// A whole robot's regulator to whose command an excitation may be added, which it does not know of.
pub(crate) struct ExcitedRobot {
    regulator: WholeRegulator,
    excitation: Option<Excitation>,
    /// Stamp of the last measurement, s.
    time: f64,
    /// The torques of the planes on top of those that were decided last, N m.
    on_top: Vector2<f64>,
    /// Why the planes began anew, at each measurement since this was asked for last.
    restarts: Vec<[Option<Restart>; 2]>,
}

impl ExcitedRobot {
    /// The regulator with this excitation, or without any.
    pub(crate) fn new(regulator: WholeRegulator, excitation: Option<Excitation>) -> Self {
        Self {
            regulator,
            excitation,
            time: 0.0,
            on_top: Vector2::zeros(),
            restarts: Vec::new(),
        }
    }

    /// The regulator.
    pub(crate) fn regulator(&self) -> &WholeRegulator {
        &self.regulator
    }

    /// The torques of the planes on top of those that the regulator decided last, N m.
    pub(crate) fn on_top(&self) -> &Vector2<f64> {
        &self.on_top
    }

    /// Why the planes began anew, at each measurement since the last call.
    pub(crate) fn take_restarts(&mut self) -> Vec<[Option<Restart>; 2]> {
        std::mem::take(&mut self.restarts)
    }

    /// What is added to the planes' torques now, N m.
    fn excitation(&self) -> Vector2<f64> {
        let excitation = self.excitation.as_ref();
        Vector2::new(excitation.map_or(0.0, |one| one.at(self.time)), 0.0)
    }

    fn excited(&self, motors: Vector3<f64>, on_top: &Vector2<f64>) -> Vector3<f64> {
        let planes = Heading::new(self.regulator.heading()).to_robot(on_top);
        motors + self.regulator.wheels().motors(&planes.push(0.0))
    }
}

impl Regulator<f64, 10, 3, 10> for ExcitedRobot {
    fn t_s(&self) -> f64 {
        self.regulator.t_s()
    }

    fn observe(&mut self, measurement: &Measurement<f64, 10>) -> Observation<10> {
        self.time = measurement.t;
        let observation = self.regulator.observe(measurement);
        self.restarts.push(*self.regulator.restarts());
        observation
    }

    fn decide(&mut self, reference: &dyn Fn(f64) -> RobotState<f64>) -> Command<f64, 10, 3> {
        let command = self.regulator.decide(reference);
        self.on_top = self.excitation();
        Command {
            u: self.excited(command.u, &self.on_top),
            ..command
        }
    }

    fn between(&mut self) -> Option<Vector3<f64>> {
        let motors = self.regulator.between()?;
        Some(self.excited(motors, &self.excitation()))
    }

    fn take_over(&mut self, previous: &Self) {
        self.regulator.take_over(&previous.regulator);
        (self.time, self.on_top) = (previous.time, previous.on_top);
    }

    fn cost(&self) -> f64 {
        self.regulator.cost()
    }
}
