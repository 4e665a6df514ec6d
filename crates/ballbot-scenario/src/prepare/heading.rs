//! The robot turning about the vertical: mechanics, law and target, checked.

use crate::error::ScenarioError;
use crate::file::heading_table::HeadingTable;
use crate::number::{finite, not_negative, positive};
use ballbot::YawLaw;
use lpvmpc_sim::Sensor;
use nalgebra::Vector2;

/// How the robot turns, and where it has to look.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Turning {
    /// Moment of inertia about the vertical, per body mass, m^2.
    pub inertia: f64,
    /// Viscous friction, per body mass, m^2/s.
    pub friction: f64,
    /// Heading at time zero, rad.
    pub initial: f64,
    /// Target at time zero, rad, and its rate, rad/s.
    pub target: (f64, f64),
    /// The law of the yaw torque.
    pub law: YawLaw<f64>,
    /// Standard deviation of the noise of the measured heading, and its constant error, rad.
    pub sensor: (f64, f64),
}

impl Turning {
    /// A robot that nothing turns.
    pub(crate) fn none() -> Self {
        Self {
            inertia: 1.0,
            friction: 0.0,
            initial: 0.0,
            target: (0.0, 0.0),
            law: YawLaw {
                stiffness: 0.0,
                damping: 0.0,
            },
            sensor: (0.0, 0.0),
        }
    }

    /// Acceleration in rad/s^2 at the heading's rate (rad/s) under the yaw torque (N m); `gear`
    /// is r_b / r_w. The torque turns the ball, which the floor holds, so the body turns the
    /// other way.
    pub(crate) fn acceleration(&self, rate: f64, yaw: f64, gear: f64) -> f64 {
        (-gear * yaw - self.friction * rate) / self.inertia
    }

    /// Where the robot has to look at the time `t` s, rad, and how fast that turns, rad/s.
    pub(crate) fn target(&self, t: f64) -> Vector2<f64> {
        let (angle, rate) = self.target;
        Vector2::new(angle + rate * t, rate)
    }

    /// The sensors of heading and rate on the rows `first` and the next of a state.
    pub(crate) fn sensors<const NX: usize>(&self, first: usize) -> [Sensor<NX>; 2] {
        let ideal = Sensor::<NX>::ideal_states();
        let (noise, bias) = self.sensor;
        let angle = Sensor {
            noise,
            bias,
            ..ideal[first]
        };
        [angle, ideal[first + 1]]
    }
}

impl HeadingTable {
    /// # Errors
    /// [`ScenarioError::Value`] with the key.
    pub(crate) fn check(&self) -> Result<Turning, ScenarioError> {
        for (key, value) in [
            ("initial_deg", self.initial_deg),
            ("target_deg", self.target_deg),
            ("target_rate_deg_s", self.target_rate_deg_s),
            ("bias_rad", self.bias_rad),
        ] {
            finite(&format!("heading.{key}"), value)?;
        }
        let size = |key: &str, value| not_negative(&format!("heading.{key}"), value);
        Ok(Turning {
            inertia: positive("heading.inertia_m2", self.inertia_m2)?,
            friction: size("friction_m2_s", self.friction_m2_s)?,
            initial: self.initial_deg.to_radians(),
            target: (
                self.target_deg.to_radians(),
                self.target_rate_deg_s.to_radians(),
            ),
            law: YawLaw {
                stiffness: size("stiffness_nm_rad", self.stiffness_nm_rad)?,
                damping: size("damping_nm_s_rad", self.damping_nm_s_rad)?,
            },
            sensor: (size("noise_rad", self.noise_rad)?, self.bias_rad),
        })
    }
}
