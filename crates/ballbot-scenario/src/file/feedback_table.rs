//! The feedback pipeline around the controller of a real robot, key by key: estimator, delay, ramps,
//! motors. What it means is in `feedback`.

use serde::{Deserialize, Serialize};

/// A Kalman filter on (phi, theta, theta_dot). Without it the controller gets the readings.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct EstimatorTable {
    /// Standard deviation of the measured ball angle, rad.
    pub phi_noise_rad: f64,
    /// Standard deviation of the measured tilt, rad.
    pub theta_noise_rad: f64,
    /// Standard deviation of the measured tilt rate, rad/s.
    pub theta_dot_noise_rad_s: f64,
    /// What the model does not know about the ball's speed: standard deviation gained in 1 s,
    /// rad/s; it grows with the root of time.
    pub phi_dot_drift_rad_s: f64,
    /// The same for the tilt rate, rad/s.
    pub theta_dot_drift_rad_s: f64,
    /// Constants that are to be found.
    pub disturbances: DisturbancesTable,
    /// Readings further off than this many standard deviations are not believed; inf for none.
    pub outlier_deviations: f64,
    /// After so many outliers of a sensor in a row the state must be wrong, and they are.
    pub outlier_patience: usize,
    /// Readings older than this are not believed, s; inf for any age.
    pub oldest_s: f64,
    /// Without a reading that is believed for longer than this, s, there is no estimate until the
    /// next one, with which it begins anew; inf to predict for ever.
    pub longest_gap_s: f64,
}

impl Default for EstimatorTable {
    fn default() -> Self {
        Self {
            phi_noise_rad: 1e-3,
            theta_noise_rad: 2e-3,
            theta_dot_noise_rad_s: 1e-2,
            phi_dot_drift_rad_s: 0.5,
            theta_dot_drift_rad_s: 0.3,
            disturbances: DisturbancesTable::default(),
            outlier_deviations: 6.0,
            outlier_patience: 2,
            oldest_s: f64::INFINITY,
            longest_gap_s: 0.5,
        }
    }
}

/// Constants that the estimator finds, so that they leave no error in phi.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum DisturbancesTable {
    /// Nothing.
    None,
    /// A torque of the virtual wheel, and the angle by which tilt sensor or centre of mass are
    /// off. A slope, at rest, is both together.
    TorqueAndTilt {
        /// How fast the torque may wander: standard deviation gained in 1 s, N m.
        torque_drift_nm: f64,
        /// How fast the angle may wander: standard deviation gained in 1 s, rad.
        tilt_drift_rad: f64,
    },
}

impl Default for DisturbancesTable {
    fn default() -> Self {
        Self::TorqueAndTilt {
            torque_drift_nm: 0.01,
            tilt_drift_rad: 0.002,
        }
    }
}

/// Bound and cost of the torque's rate of change.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TorqueRateTable {
    /// Largest rate, N m/s; inf for none.
    pub limit_nm_s: f64,
    /// Weight of its square, 1/(N m/s)^2.
    pub weight: f64,
}

/// Set points become smooth moves that the robot can follow.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ShapingTable {
    /// Tilt that a move may ask for, rad.
    pub tilt_rad: f64,
    /// Ball speed that a move may ask for, rad/s.
    pub phi_dot_rad_s: f64,
}

/// The limits of the three motors, which two planes share. In `[world.actuator]`, `limit_nm` and
/// `dead_zone_nm` are then those of each motor.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MotorsTable {
    /// Largest torque of each motor, N m.
    pub limit_nm: f64,
    /// Yaw torque that is kept free, N m; what yaw does not use, the planes get.
    #[serde(default)]
    pub yaw_reserve_nm: f64,
}
