//! The ballbot in a certificate of a terminal set.

use ballbot::{Accelerations, Ballbot, Geometry, Tilt};
use lpvmpc_design::{AnalyticModel, Arithmetic, Certificate};
use serde::{Deserialize, Serialize};

/// The certificate of a ballbot's terminal set: states (phi, theta, phi_dot, theta_dot), torque,
/// scheduling (theta, theta_dot).
pub type TerminalCertificate = Certificate<RobotTable, 4, 1, 2>;

/// The parameters that the motion of one plane depends on; see [`ballbot::Ballbot`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RobotTable {
    /// b1, m^2.
    pub b1_m2: f64,
    /// b2, m^2.
    pub b2_m2: f64,
    /// b3, m^2.
    pub b3_m2: f64,
    /// b4, m^2/s.
    pub b4_m2_s: f64,
    /// l, m.
    pub centre_of_mass_m: f64,
    /// r_b, m.
    pub ball_radius_m: f64,
    /// r_w, m.
    pub wheel_radius_m: f64,
    /// g, m/s^2.
    pub gravity_m_s2: f64,
}

impl From<&Ballbot<f64>> for RobotTable {
    fn from(ballbot: &Ballbot<f64>) -> Self {
        let geometry = &ballbot.geometry;
        Self {
            b1_m2: ballbot.b1,
            b2_m2: ballbot.b2,
            b3_m2: ballbot.b3,
            b4_m2_s: ballbot.b4,
            centre_of_mass_m: geometry.centre_of_mass,
            ball_radius_m: geometry.ball_radius,
            wheel_radius_m: geometry.wheel_radius,
            gravity_m_s2: geometry.gravity,
        }
    }
}

impl RobotTable {
    fn lift<T>(&self, constant: fn(f64) -> T) -> Ballbot<T> {
        Ballbot {
            b1: constant(self.b1_m2),
            b2: constant(self.b2_m2),
            b3: constant(self.b3_m2),
            b4: constant(self.b4_m2_s),
            geometry: Geometry {
                centre_of_mass: constant(self.centre_of_mass_m),
                ball_radius: constant(self.ball_radius_m),
                wheel_radius: constant(self.wheel_radius_m),
                gravity: constant(self.gravity_m_s2),
            },
        }
    }

    /// The robot.
    pub fn ballbot(&self) -> Ballbot<f64> {
        self.lift(|value| value)
    }
}

impl AnalyticModel<4, 1, 2> for RobotTable {
    fn scheduling<T: Arithmetic>(&self, x: &[T; 4]) -> [T; 2] {
        [x[1], x[3]]
    }

    fn matrices<T: Arithmetic>(&self, &[theta, rate]: &[T; 2]) -> ([[T; 4]; 4], [[T; 1]; 4]) {
        let (zero, one) = (T::constant(0.0), T::constant(1.0));
        let tilt = Tilt {
            sin: theta.sin(),
            cos: theta.cos(),
            sinc: theta.sinc(),
            rate,
            one,
        };
        let Accelerations { a: [phi, body], b } = self.lift(T::constant).accelerations(tilt);
        let a = [
            [zero, zero, one, zero],
            [zero, zero, zero, one],
            [zero, phi[0], phi[1], phi[2]],
            [zero, body[0], body[1], body[2]],
        ];
        (a, [[zero], [zero], [b[0]], [b[1]]])
    }
}
