//! `[heading]` of a scenario file, key by key. What it means is in `heading`.

use serde::{Deserialize, Serialize};

/// How the robot turns about the vertical, and where it has to look. For two planes with
/// `[controller.motors]`; without it the robot keeps its heading of zero.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HeadingTable {
    /// Moment of inertia of the body about the vertical, per body mass, m^2.
    pub inertia_m2: f64,
    /// Viscous friction of turning against the ball, per body mass, m^2/s.
    #[serde(default)]
    pub friction_m2_s: f64,
    /// Heading at time zero, counter-clockwise seen from above, degrees.
    #[serde(default)]
    pub initial_deg: f64,
    /// Where the robot has to look at time zero, degrees.
    #[serde(default)]
    pub target_deg: f64,
    /// How fast that turns, degrees/s.
    #[serde(default)]
    pub target_rate_deg_s: f64,
    /// Yaw torque per angle that is missing, N m/rad. The torque's limit is
    /// `controller.motors.yaw_reserve_nm`.
    pub stiffness_nm_rad: f64,
    /// Yaw torque per rate that is missing, N m s/rad.
    pub damping_nm_s_rad: f64,
    /// Standard deviation of the noise of the measured heading, rad.
    #[serde(default)]
    pub noise_rad: f64,
    /// Constant error of the measured heading, rad.
    #[serde(default)]
    pub bias_rad: f64,
}
