//! A motion together with what it changes by per initial state and per parameter.

use crate::log::BallAngle;
use crate::model::Robot;
use crate::parameter::{Parameter, Values};
use ballbot::Sensitivity;
use nalgebra::Vector4;

/// What a motion depends on, in the order of the columns: the initial theta, phi_dot and theta_dot,
/// then [`ACTING`]. The initial phi shifts phi and nothing else.
const COLUMNS: usize = 3 + ACTING.len();

/// The parameters that change the motion; the others are the sensors'. The first six are those of
/// [`Sensitivity::by_parameters`].
const ACTING: [Parameter; 9] = [
    Parameter::B1,
    Parameter::B2,
    Parameter::B3,
    Parameter::RollingFriction,
    Parameter::DriveFriction,
    Parameter::DriveCoulomb,
    Parameter::TorqueGain,
    Parameter::TorqueBias,
    Parameter::Delay,
];

/// A row of derivatives for each state.
type Slopes = [[f64; COLUMNS]; 4];

/// Derivatives that are larger are those of a simulation at its end.
const LARGEST_SLOPE: f64 = 1e12;

/// A state on its way, with its derivatives: those of the numbers that Runge-Kutta steps give, exact
/// but for rounding, from the variational equations integrated by the same steps.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Varied {
    /// The state.
    pub x: Vector4<f64>,
    slopes: Slopes,
}

/// What an output changes by.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OutputSlopes {
    /// Per component of the initial state.
    pub by_state: [f64; 4],
    /// Per parameter.
    pub by_parameter: Values,
}

impl Varied {
    /// At the initial state.
    pub fn start(initial: Vector4<f64>) -> Self {
        let mut slopes = [[0.0; COLUMNS]; 4];
        for state in 1..4 {
            slopes[state][state - 1] = 1.0;
        }
        Self { x: initial, slopes }
    }

    /// One Runge-Kutta step of order 4 over `duration` s under the constant logged `torque` (N m),
    /// whose derivative by the delay is `by_delay` (N m/s).
    pub fn step(&mut self, robot: &Robot, torque: f64, by_delay: f64, duration: f64) {
        let rate = |at: &Self| at.rate(robot, torque, by_delay);
        let k1 = rate(self);
        let k2 = rate(&self.after(&k1, 0.5 * duration));
        let k3 = rate(&self.after(&k2, 0.5 * duration));
        let k4 = rate(&self.after(&k3, duration));
        let sixth = duration / 6.0;
        self.x += (k1.x + (k2.x + k3.x) * 2.0 + k4.x) * sixth;
        for (state, row) in self.slopes.iter_mut().enumerate() {
            for (column, slope) in row.iter_mut().enumerate() {
                let [first, second, third, fourth] =
                    [&k1, &k2, &k3, &k4].map(|k| k.slopes[state][column]);
                *slope += (first + (second + third) * 2.0 + fourth) * sixth;
            }
        }
    }

    /// `duration` s later at this rate.
    fn after(&self, rate: &Self, duration: f64) -> Self {
        let mut slopes = self.slopes;
        for (row, rates) in slopes.iter_mut().zip(&rate.slopes) {
            for (slope, rate) in row.iter_mut().zip(rates) {
                *slope += rate * duration;
            }
        }
        Self {
            x: self.x + rate.x * duration,
            slopes,
        }
    }

    /// The derivative by time of all of it.
    fn rate(&self, robot: &Robot, torque: f64, by_delay: f64) -> Self {
        let gain = robot.values[Parameter::TorqueGain];
        let Sensitivity {
            accelerations: [phi_ddot, theta_ddot],
            by_state: [by_theta, by_phi_dot, by_theta_dot],
            by_torque,
            by_parameters,
        } = robot.plant.sensitivity(&self.x, robot.driving(torque)[0]);
        let [_, theta, phi_dot, theta_dot] = &self.slopes;
        let acceleration = |i: usize| {
            let mut row = [0.0; COLUMNS];
            for (own, by) in row[3..].iter_mut().zip(&by_parameters) {
                *own = by[i];
            }
            row[COLUMNS - 3] = by_torque[i] * (torque + robot.values[Parameter::TorqueBias]);
            row[COLUMNS - 2] = by_torque[i] * gain;
            row[COLUMNS - 1] = by_torque[i] * gain * by_delay;
            for (column, entry) in row.iter_mut().enumerate() {
                *entry += by_theta[i] * theta[column]
                    + by_phi_dot[i] * phi_dot[column]
                    + by_theta_dot[i] * theta_dot[column];
            }
            row
        };
        Self {
            x: Vector4::new(self.x[2], self.x[3], phi_ddot, theta_ddot),
            slopes: [*phi_dot, *theta_dot, acceleration(0), acceleration(1)],
        }
    }

    /// Whether the derivatives are those of a motion that can be followed.
    pub fn is_bounded(&self) -> bool {
        let mut slopes = self.slopes.iter().flatten();
        slopes.all(|slope| slope.abs() < LARGEST_SLOPE)
    }

    /// What the outputs of [`Robot::outputs`] change by.
    pub fn outputs(&self, robot: &Robot, ball_angle: BallAngle) -> [OutputSlopes; 3] {
        let [phi, theta, phi_dot, theta_dot] = &self.slopes;
        let relative = match ball_angle {
            BallAngle::Inertial => 0.0,
            BallAngle::RelativeToBody => 1.0,
        };
        let (ball, tilt) = (
            robot.values[Parameter::CreepBall],
            robot.values[Parameter::CreepTilt],
        );
        let mut angle = OutputSlopes::of(&std::array::from_fn(|column| {
            phi[column] - relative * theta[column]
                + ball * phi_dot[column]
                + tilt * theta_dot[column]
        }));
        angle.by_state[0] = 1.0;
        angle.by_parameter[Parameter::CreepBall] = self.x[2];
        angle.by_parameter[Parameter::CreepTilt] = self.x[3];
        let mut lean = OutputSlopes::of(theta);
        lean.by_parameter[Parameter::TiltOffset] = 1.0;
        let mut rate = OutputSlopes::of(theta_dot);
        rate.by_parameter[Parameter::GyroBias] = 1.0;
        [angle, lean, rate]
    }
}

impl OutputSlopes {
    fn of(columns: &[f64; COLUMNS]) -> Self {
        let [theta, phi_dot, theta_dot, acting @ ..] = columns;
        let mut by_parameter = Values([0.0; Parameter::ALL.len()]);
        for (parameter, slope) in ACTING.into_iter().zip(acting) {
            by_parameter[parameter] = *slope;
        }
        Self {
            by_state: [0.0, *theta, *phi_dot, *theta_dot],
            by_parameter,
        }
    }
}
