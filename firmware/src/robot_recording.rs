//! A whole robot's settings and what its sensors deliver, as they stand in the flash.

use crate::recording::{Descent, Recording};
use crate::robot::{PlaneMemory, RobotMemory, RobotRegulator};
use ballbot::{
    Belief, Controller, Estimator, EstimatorSettings, Held, MotorLimits, OutputFeedback,
    RegulatorError, RobotState, Wheels, YawLaw,
};
use lpvmpc::{FeedbackSettings, Gate, Measurement, Reading, Workspace};
use nalgebra::{Matrix1x2, Matrix4, Matrix4x2, Vector2, Vector4};

/// A robot, and what its sensors delivered.
#[derive(Clone, Copy, Debug)]
pub struct RobotRecording {
    /// The robot.
    pub robot: RobotSettings,
    /// phi_ref of the x and the y plane at every measurement, and on to the end of the last
    /// sample's horizon, rad.
    pub phi_ref: [&'static [f32]; 2],
    /// Value and age (s) of each reading of a [`RobotState`], at every measurement.
    pub rows: &'static [[Option<[f32; 2]>; 10]],
}

/// A robot's regulator.
#[derive(Clone, Copy, Debug)]
pub struct RobotSettings {
    /// Robot and controller of a plane; no states.
    pub plane: Recording,
    /// The controllers' iterations.
    pub descent: Descent,
    /// Time from a measurement to the torque that answers it, s.
    pub delay: f32,
    /// Time from one measurement to the next, s.
    pub period: f32,
    /// The estimator's longest Runge-Kutta step, s.
    pub longest_step: f32,
    /// See [`EstimatorSettings`]; its disturbances are a torque and an angle of the tilt.
    pub state_noise: [f32; 4],
    /// Variances of the readings of (phi, theta, phi_dot, theta_dot).
    pub measurement_noise: [f32; 4],
    /// Variances of the state at the start.
    pub initial_state: [f32; 4],
    /// Variances that the disturbances gain per second.
    pub disturbance_noise: [f32; 2],
    /// Variances of the disturbances at the start.
    pub initial_disturbance: [f32; 2],
    /// Which readings are not believed.
    pub gate: Gate<f32>,
    /// What the motors have.
    pub limits: MotorLimits<f32>,
    /// The law of the heading.
    pub yaw: YawLaw<f32>,
    /// Heading at the start, rad.
    pub heading: f32,
    /// Where the robot has to look at time zero, rad, and its rate, rad/s.
    pub target: (f32, f32),
}

impl RobotSettings {
    /// The robot's regulator on these wheels, in this memory.
    ///
    /// # Errors
    /// Its settings make no sense.
    pub fn regulator(
        &self,
        wheels: Wheels<f32>,
        memory: &'static mut RobotMemory,
    ) -> Result<RobotRegulator, RegulatorError> {
        let RobotMemory {
            planes: [x, y],
            workspace,
        } = memory;
        Ok(RobotRegulator::new(
            [self.feedback(x)?, self.feedback(y)?],
            Workspace::new(workspace.lend()),
            wheels,
            self.limits,
            self.yaw,
            self.heading,
        ))
    }

    /// One plane.
    fn feedback(
        &self,
        memory: &'static mut PlaneMemory,
    ) -> Result<OutputFeedback<f32, Held<f32>>, RegulatorError> {
        let Recording {
            ballbot, substeps, ..
        } = self.plane;
        let settings = self.plane.with_descent(&self.descent, substeps);
        let controller = Controller::new(ballbot, settings, memory.controller.lend())?;
        let start = Vector4::zeros();
        let estimator = Estimator::new(ballbot, self.estimator(), start, memory.estimator.lend())?;
        let feedback = FeedbackSettings {
            delay: self.delay,
            period: self.period,
            preview: true,
            u: settings.u,
        };
        Ok(OutputFeedback::new(
            Belief::Estimated(estimator),
            Held::new(controller),
            feedback,
            memory.feedback.lend(),
        ))
    }

    fn estimator(&self) -> EstimatorSettings<f32> {
        let mut settings = EstimatorSettings {
            longest_step: self.longest_step,
            c: Matrix4::identity(),
            state_offset: Matrix4x2::zeros(),
            input_offset: Matrix1x2::new(1.0, 0.0),
            state_noise: Vector4::from(self.state_noise),
            disturbance_noise: Vector2::from(self.disturbance_noise),
            measurement_noise: Vector4::from(self.measurement_noise),
            initial_state: Vector4::from(self.initial_state),
            initial_disturbance: Vector2::from(self.initial_disturbance),
            gate: self.gate,
        };
        settings.state_offset[(1, 1)] = 1.0;
        settings
    }

    /// Measurements per decision.
    pub fn per_sample(&self) -> usize {
        (self.plane.t_s / self.period + 0.5) as usize
    }
}

impl RobotRecording {
    /// The measurement `k`.
    pub fn measurement(&self, k: usize) -> Option<Measurement<f32, 10>> {
        let row = self.rows.get(k)?;
        Some(Measurement {
            t: k as f64 * f64::from(self.robot.period),
            readings: row.map(|reading| reading.map(|[value, age]| Reading { value, age })),
        })
    }

    /// The reference at the time `t`, s; beyond the recording it is zero.
    pub fn reference(&self, t: f64) -> RobotState<f32> {
        let place = (t / f64::from(self.robot.period) + 0.5) as usize;
        let mut state = RobotState::zeros();
        let [x, y] = self.phi_ref;
        (state[0], state[4]) = (at(x, place), at(y, place));
        let (angle, rate) = self.robot.target;
        (state[8], state[9]) = (angle + rate * t as f32, rate);
        state
    }
}

fn at(numbers: &[f32], place: usize) -> f32 {
    numbers.get(place).copied().unwrap_or(0.0)
}
