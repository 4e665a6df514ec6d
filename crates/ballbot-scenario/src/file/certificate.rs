//! The ballbot in a certificate of a terminal set.

use crate::error::ScenarioError;
use crate::file::parameters::is_zero;
use ballbot::{Ballbot, DriveFriction, Geometry};
use lpvmpc::{Embedding, Number};
use lpvmpc_certificate::Certificate;
use nalgebra::{Matrix4, Vector1, Vector2, Vector4};
use serde::{Deserialize, Serialize};

/// The certificate of a ballbot's terminal set: states (phi, theta, phi_dot, theta_dot), torque,
/// scheduling (theta, theta_dot).
pub type TerminalCertificate = Certificate<RobotTable, 4, 1, 2>;

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

    /// The robot.
    pub fn ballbot(&self) -> ViscousBallbot {
        ViscousBallbot(Ballbot {
            b1: self.b1_m2,
            b2: self.b2_m2,
            b3: self.b3_m2,
            b4: self.b4_m2_s,
            drive: DriveFriction {
                viscous: self.drive_friction_m2_s,
                coulomb: 0.0,
            },
            geometry: Geometry {
                centre_of_mass: self.centre_of_mass_m,
                ball_radius: self.ball_radius_m,
                wheel_radius: self.wheel_radius_m,
                gravity: self.gravity_m_s2,
            },
        })
    }
}

impl Embedding<4, 1, 2> for RobotTable {
    fn scheduling<N: Number>(&self, x: &Vector4<N>, torque: &Vector1<N>) -> Vector2<N> {
        self.ballbot().scheduling(x, torque)
    }

    fn matrices<N: Number>(&self, scheduling: &Vector2<N>) -> (Matrix4<N>, Vector4<N>) {
        self.ballbot().matrices(scheduling)
    }
}

/// A ballbot without Coulomb friction, so that the scheduling is (theta, theta_dot).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ViscousBallbot(Ballbot<f64>);

impl Embedding<4, 1, 2> for ViscousBallbot {
    /// sigma(x) = (theta, theta_dot), rad and rad/s.
    fn scheduling<N: Number>(&self, x: &Vector4<N>, _torque: &Vector1<N>) -> Vector2<N> {
        Vector2::new(x[1], x[3])
    }

    fn matrices<N: Number>(&self, scheduling: &Vector2<N>) -> (Matrix4<N>, Vector4<N>) {
        // The drive's speed is for Coulomb friction alone.
        let speed = N::constant(0.0);
        self.0
            .over()
            .matrices_at(scheduling[0], scheduling[1], speed)
    }
}
