//! The robot as its log shows it: plant, drive and sensors, simulated at the log's own times.

use crate::coordinates::Coordinates;
use crate::line::Line;
use crate::log::{BallAngle, Run};
use crate::parameter::{Parameter, Values};
use ballbot::{Ballbot, DriveFriction, Geometry};
use lpvmpc_design::ShootingModel;
use nalgebra::{Vector3, Vector4};

/// The longest step of the integration, s. The fastest mode of a robot whose body weighs more than
/// its ball is slower than 1 kHz: one step is well within the stability limit, and for the 50 1/s
/// of the paper's robot its error is 1e-8 of the state.
pub const LONGEST_STEP: f64 = 2e-3;

/// A robot with its drive and sensors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Robot {
    /// The plant, per unit of body mass: its torque is what the torque gain makes of the logged one.
    pub plant: Ballbot<f64>,
    /// All parameters, those of the plant included.
    pub values: Values,
}

impl Robot {
    /// The robot with these parameters.
    pub fn new(values: Values, geometry: Geometry<f64>) -> Self {
        Self {
            plant: Ballbot {
                b1: values[Parameter::B1],
                b2: values[Parameter::B2],
                b3: values[Parameter::B3],
                b4: values[Parameter::RollingFriction],
                drive: DriveFriction {
                    viscous: values[Parameter::DriveFriction],
                    coulomb: values[Parameter::DriveCoulomb],
                },
                geometry,
            },
            values,
        }
    }

    /// x_dot at the state (phi, theta, phi_dot, theta_dot) under a torque that acts, N m.
    #[inline(always)]
    pub fn f(&self, x: &Vector4<f64>, torque: f64) -> Vector4<f64> {
        let driving =
            self.values[Parameter::TorqueGain] * (torque + self.values[Parameter::TorqueBias]);
        self.plant.f(x, driving)
    }

    /// The state `duration` seconds later under a constant torque: one Runge-Kutta step of order 4.
    #[inline(always)]
    pub fn step(&self, x: &Vector4<f64>, torque: f64, duration: f64) -> Vector4<f64> {
        let k1 = self.f(x, torque);
        let k2 = self.f(&(x + k1 * (0.5 * duration)), torque);
        let k3 = self.f(&(x + k2 * (0.5 * duration)), torque);
        let k4 = self.f(&(x + k3 * duration), torque);
        x + (k1 + (k2 + k3) * 2.0 + k4) * (duration / 6.0)
    }

    /// What the sensors show: ball angle, tilt, tilt rate.
    #[inline(always)]
    pub fn outputs(&self, x: &Vector4<f64>, ball_angle: BallAngle) -> Vector3<f64> {
        let phi = match ball_angle {
            BallAngle::Inertial => x[0],
            BallAngle::RelativeToBody => x[0] - x[1],
        };
        let creep =
            self.values[Parameter::CreepBall] * x[2] + self.values[Parameter::CreepTilt] * x[3];
        Vector3::new(
            phi + creep,
            x[1] + self.values[Parameter::TiltOffset],
            x[3] + self.values[Parameter::GyroBias],
        )
    }

    /// The state that the sensors show, with the ball's speed given.
    pub fn state(
        &self,
        outputs: &Vector3<f64>,
        phi_dot: f64,
        ball_angle: BallAngle,
    ) -> Vector4<f64> {
        let theta = outputs[1] - self.values[Parameter::TiltOffset];
        let theta_dot = outputs[2] - self.values[Parameter::GyroBias];
        let (phi, phi_dot) = match ball_angle {
            BallAngle::Inertial => (outputs[0], phi_dot),
            BallAngle::RelativeToBody => (outputs[0] + theta, phi_dot + theta_dot),
        };
        Vector4::new(phi, theta, phi_dot, theta_dot)
    }
}

/// Rows of one run, without gap between them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Segment {
    /// Which run.
    pub run: usize,
    /// First row.
    pub first: usize,
    /// One past the last row.
    pub end: usize,
}

/// Segments of runs, as data of a multiple-shooting fit with NX = 4 states and the NY = 3 outputs
/// ball angle, tilt, tilt rate.
#[derive(Clone, Debug)]
pub struct SegmentedRuns<'a> {
    /// The runs.
    pub runs: &'a [Run],
    /// The segments.
    pub segments: Vec<Segment>,
    /// What the fit's parameters are.
    pub coordinates: Coordinates,
    /// What phi is relative to.
    pub ball_angle: BallAngle,
}

impl SegmentedRuns<'_> {
    /// A start for each segment's initial state from the measured values around its first row.
    pub fn initial_states(&self, values: &Values) -> Vec<Vector4<f64>> {
        let robot = Robot::new(*values, self.coordinates.geometry);
        let segments = self.segments.iter();
        segments
            .map(|segment| {
                let run = &self.runs[segment.run];
                let (outputs, phi_dot) = first_outputs(run, *segment);
                robot.state(&outputs, phi_dot, self.ball_angle)
            })
            .collect()
    }
}

/// The first outputs of a segment, and the slope of its ball angle, from lines through its first
/// 30 ms. A missing value is taken from the next row that has one.
fn first_outputs(run: &Run, segment: Segment) -> (Vector3<f64>, f64) {
    let rows = segment.first..segment.end;
    let first = |output: usize| {
        let values = run.outputs[rows.clone()].iter().map(|row| row[output]);
        values
            .into_iter()
            .find(|value| !value.is_nan())
            .unwrap_or(0.0)
    };
    let start = run.time[segment.first];
    let window = rows
        .clone()
        .enumerate()
        .take_while(|(place, row)| *place < 4 || run.time[*row] - start <= 0.03)
        .map(|(_, row)| (run.time[row] - start, run.outputs[row][0]))
        .filter(|(_, phi)| !phi.is_nan());
    let line = Line::through(window);
    (Vector3::new(line.at(0.0), first(1), first(2)), line.slope)
}

impl ShootingModel<4, 3> for SegmentedRuns<'_> {
    fn segments(&self) -> usize {
        self.segments.len()
    }

    fn measured(&self, segment: usize) -> &[Vector3<f64>] {
        let Segment { run, first, end } = self.segments[segment];
        &self.runs[run].outputs[first..end]
    }

    fn simulate(
        &self,
        segment: usize,
        parameters: &[f64],
        initial: &Vector4<f64>,
        outputs: &mut Vec<Vector3<f64>>,
    ) {
        let Segment { run, first, end } = self.segments[segment];
        let run = &self.runs[run];
        let values = self.coordinates.values(parameters);
        let robot = Robot::new(values, self.coordinates.geometry);
        let mut torque = run.torque_from(run.time[first] - robot.values[Parameter::Delay]);
        let mut x = *initial;
        outputs.push(robot.outputs(&x, self.ball_angle));
        for row in first + 1..end {
            let interval = run.time[row] - run.time[row - 1];
            let steps = (interval / LONGEST_STEP).ceil().max(1.0);
            let duration = interval / steps;
            for _ in 0..steps as usize {
                // The mean over the step is continuous in the delay.
                x = robot.step(&x, torque.mean_over(duration), duration);
            }
            if !(x[2].abs() < 1e6 && x[3].abs() < 1e6) {
                return;
            }
            outputs.push(robot.outputs(&x, self.ball_angle));
        }
    }
}
