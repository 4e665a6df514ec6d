//! The ballbot in a certificate of a terminal set.

use crate::error::ScenarioError;
use crate::file::parameters::is_zero;
use ballbot::{Accelerations, Ballbot, DriveFriction, Geometry, Tilt};
use lpvmpc::LpvModel;
use lpvmpc_certificate::{AnalyticModel, Arithmetic, Certificate, MOST_BYTES};
use nalgebra::{Matrix4, Vector2, Vector3, Vector4};
use serde::{Deserialize, Serialize};
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// The certificate of a ballbot's terminal set: states (phi, theta, phi_dot, theta_dot), torque,
/// scheduling (theta, theta_dot).
pub type TerminalCertificate = Certificate<RobotTable, 4, 1, 2>;

/// The text of a certificate's file, of which not more is read than a certificate can have: what
/// follows makes it none ([`TerminalCertificate::from_json`]).
///
/// # Errors
/// The file cannot be read, or is not text.
pub fn read_certificate(path: &Path) -> io::Result<String> {
    let mut text = String::new();
    let most = MOST_BYTES as u64 + 1;
    File::open(path)?.take(most).read_to_string(&mut text)?;
    Ok(text)
}

/// The parameters that the motion of one plane depends on; see [`ballbot::Ballbot`]. Robots with
/// Coulomb friction have no such table: without them the scheduling is (theta, theta_dot).
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
    /// The drive's viscous friction, m^2/s; 0 when absent.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub drive_friction_m2_s: f64,
    /// l, m.
    pub centre_of_mass_m: f64,
    /// r_b, m.
    pub ball_radius_m: f64,
    /// r_w, m.
    pub wheel_radius_m: f64,
    /// g, m/s^2.
    pub gravity_m_s2: f64,
}

impl TryFrom<&Ballbot<f64>> for RobotTable {
    type Error = ScenarioError;

    /// # Errors
    /// The robot has Coulomb friction.
    fn try_from(ballbot: &Ballbot<f64>) -> Result<Self, ScenarioError> {
        let coulomb = ballbot.drive.coulomb;
        if coulomb != 0.0 {
            return Err(ScenarioError::value(
                "parameters.drive_coulomb_m2_s2",
                coulomb,
                "there are no certificates for robots with Coulomb friction; leave it out",
            ));
        }
        let geometry = &ballbot.geometry;
        Ok(Self {
            b1_m2: ballbot.b1,
            b2_m2: ballbot.b2,
            b3_m2: ballbot.b3,
            b4_m2_s: ballbot.b4,
            drive_friction_m2_s: ballbot.drive.viscous,
            centre_of_mass_m: geometry.centre_of_mass,
            ball_radius_m: geometry.ball_radius,
            wheel_radius_m: geometry.wheel_radius,
            gravity_m_s2: geometry.gravity,
        })
    }
}

impl RobotTable {
    /// The parameters with their keys.
    pub fn entries(&self) -> [(&'static str, f64); 9] {
        [
            ("b1_m2", self.b1_m2),
            ("b2_m2", self.b2_m2),
            ("b3_m2", self.b3_m2),
            ("b4_m2_s", self.b4_m2_s),
            ("drive_friction_m2_s", self.drive_friction_m2_s),
            ("centre_of_mass_m", self.centre_of_mass_m),
            ("ball_radius_m", self.ball_radius_m),
            ("wheel_radius_m", self.wheel_radius_m),
            ("gravity_m_s2", self.gravity_m_s2),
        ]
    }

    fn lift<T>(&self, constant: fn(f64) -> T) -> Ballbot<T> {
        Ballbot {
            b1: constant(self.b1_m2),
            b2: constant(self.b2_m2),
            b3: constant(self.b3_m2),
            b4: constant(self.b4_m2_s),
            drive: DriveFriction {
                viscous: constant(self.drive_friction_m2_s),
                coulomb: constant(0.0),
            },
            geometry: Geometry {
                centre_of_mass: constant(self.centre_of_mass_m),
                ball_radius: constant(self.ball_radius_m),
                wheel_radius: constant(self.wheel_radius_m),
                gravity: constant(self.gravity_m_s2),
            },
        }
    }

    /// The robot.
    pub fn ballbot(&self) -> ViscousBallbot {
        ViscousBallbot(self.lift(|value| value))
    }
}

impl AnalyticModel<4, 1, 2> for RobotTable {
    fn scheduling<T: Arithmetic>(&self, x: &[T; 4]) -> [T; 2] {
        [x[1], x[3]]
    }

    fn matrices<T: Arithmetic>(&self, &[theta, rate]: &[T; 2]) -> ([[T; 4]; 4], [[T; 1]; 4]) {
        let (zero, one) = (T::constant(0.0), T::constant(1.0));
        let robot = self.lift(T::constant);
        let tilt = Tilt {
            sin: theta.sin(),
            cos: theta.cos(),
            sinc: theta.sinc(),
            rate,
            one,
        };
        let bare = robot.accelerations(tilt);
        let Accelerations { a: [phi, body], b } = if self.drive_friction_m2_s == 0.0 {
            bare
        } else {
            let gear = robot.geometry.ball_radius / robot.geometry.wheel_radius;
            bare.with_drive_friction(robot.drive.viscous / gear)
        };
        let a = [
            [zero, zero, one, zero],
            [zero, zero, zero, one],
            [zero, phi[0], phi[1], phi[2]],
            [zero, body[0], body[1], body[2]],
        ];
        (a, [[zero], [zero], [b[0]], [b[1]]])
    }
}

/// A ballbot without Coulomb friction, so that the scheduling is (theta, theta_dot).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ViscousBallbot(Ballbot<f64>);

impl LpvModel<f64, 4, 1, 2> for ViscousBallbot {
    /// sigma(x) = (theta, theta_dot), rad and rad/s.
    fn scheduling(&self, x: &Vector4<f64>) -> Vector2<f64> {
        Vector2::new(x[1], x[3])
    }

    fn matrices(&self, scheduling: &Vector2<f64>) -> (Matrix4<f64>, Vector4<f64>) {
        // The drive's speed is for Coulomb friction alone.
        let scheduling = Vector3::new(scheduling[0], scheduling[1], 0.0);
        self.0.matrices(&scheduling)
    }
}
