//! `[world]` of a scenario file, key by key. What it means is in `world`.

use crate::file::parameters::Parameters;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// What is not ideal about the simulated world.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct WorldTable {
    /// Seed of all noise: the same seed, the same run.
    pub seed: u64,
    /// Time from one sample of the sensors to the next, s; `controller.t_s` when absent, else a
    /// whole fraction of it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sensor_period_s: Option<f64>,
    /// What happens when the controller has no plan.
    pub without_plan: WithoutPlan,
    /// The sensors.
    pub sensors: SensorsTable,
    /// The drive.
    pub actuator: ActuatorTable,
    /// From the measurement to the torque.
    pub delay: DelayTable,
    /// The robot that is really there, as a table or a file like `parameters` of the scenario; the
    /// controller's model when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub parameters: Option<Parameters>,
    /// The robot is drawn from the covariance in the file of its parameters, by this seed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub draw: Option<u64>,
    /// How the robot that is there differs from what its parameters say.
    pub robot: DeviationsTable,
    /// Torque that is added to the controller's in the x plane: a CSV file of `ballbot excite`,
    /// relative to the scenario file. The controller does not know of it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub excitation: Option<PathBuf>,
    /// The floor.
    pub floor: FloorTable,
    /// What pushes the robot.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub pushes: Vec<PushTable>,
}

/// What happens in a world when the controller has no plan.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum WithoutPlan {
    /// The torque that comes with the answer is applied.
    #[default]
    Apply,
    /// The run ends, as in an ideal world.
    End,
}

/// The sensors of a plane.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SensorsTable {
    /// Ball angle, from the wheels' encoders.
    pub phi: AngleSensorTable,
    /// Tilt, from the inertial measurement unit.
    pub theta: AngleSensorTable,
    /// Ball speed, as far as it is measured; an estimator does without it.
    pub phi_dot: RateSensorTable,
    /// Tilt rate, from the gyroscope.
    pub theta_dot: RateSensorTable,
}

/// What is wrong with the measurement of an angle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct AngleSensorTable {
    /// Standard deviation of the noise of a sample, rad.
    pub noise_rad: f64,
    /// Constant error, rad.
    pub bias_rad: f64,
    /// Step between two readings, rad; 0 for none.
    pub resolution_rad: f64,
    /// Probability that a sample is missing, 0 to 1.
    pub dropout: f64,
    /// Time from one measurement to the next, s: a whole number of `world.sensor_period_s`, which
    /// it is when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub period_s: Option<f64>,
    /// Time from the measurement to its delivery, s: a whole number of `world.sensor_period_s`.
    pub delay_s: f64,
    /// Probability that the last reading is delivered again, with its old time stamp, 0 to 1.
    pub stale: f64,
}

/// What is wrong with the measurement of a rate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RateSensorTable {
    /// Standard deviation of the noise of a sample, rad/s.
    pub noise_rad_s: f64,
    /// Constant error, rad/s.
    pub bias_rad_s: f64,
    /// Step between two readings, rad/s; 0 for none.
    pub resolution_rad_s: f64,
    /// Probability that a sample is missing, 0 to 1.
    pub dropout: f64,
    /// Time from one measurement to the next, s: a whole number of `world.sensor_period_s`, which
    /// it is when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub period_s: Option<f64>,
    /// Time from the measurement to its delivery, s: a whole number of `world.sensor_period_s`.
    pub delay_s: f64,
    /// Probability that the last reading is delivered again, with its old time stamp, 0 to 1.
    pub stale: f64,
}

/// What is wrong with the drive.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ActuatorTable {
    /// Largest torque of the virtual wheel that the drive delivers, N m; inf for no limit.
    pub limit_nm: f64,
    /// Smaller torques have no effect, larger ones lose this, N m.
    pub dead_zone_nm: f64,
    /// Time constant with which the torque follows its command, s.
    pub lag_s: f64,
    /// Coulomb friction between body and ball on top of the robot's own, as torque of the virtual
    /// wheel, N m.
    pub coulomb_friction_nm: f64,
    /// A constant torque on top of every command, N m.
    pub bias_nm: f64,
}

impl Default for ActuatorTable {
    fn default() -> Self {
        Self {
            limit_nm: f64::INFINITY,
            dead_zone_nm: 0.0,
            lag_s: 0.0,
            coulomb_friction_nm: 0.0,
            bias_nm: 0.0,
        }
    }
}

/// The time from a measurement to the torque that answers it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DelayTable {
    /// To compute, s.
    pub computation_s: f64,
    /// On the way to the motors, s.
    pub transport_s: f64,
}

/// How the simulated robot differs from what its parameters say: factors of them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DeviationsTable {
    /// Of b1.
    pub b1_factor: f64,
    /// Of b2.
    pub b2_factor: f64,
    /// Of b3.
    pub b3_factor: f64,
    /// Of b4.
    pub b4_factor: f64,
    /// Of the drive's viscous friction.
    pub drive_friction_factor: f64,
    /// Of the drive's Coulomb friction.
    pub drive_coulomb_factor: f64,
    /// Of the distance from the ball's centre to the centre of mass.
    pub centre_of_mass_factor: f64,
    /// Angle from the body's axis to its centre of mass, x plane, rad.
    pub tilt_offset_x_rad: f64,
    /// The same in the y plane, rad.
    pub tilt_offset_y_rad: f64,
}

impl Default for DeviationsTable {
    fn default() -> Self {
        Self {
            b1_factor: 1.0,
            b2_factor: 1.0,
            b3_factor: 1.0,
            b4_factor: 1.0,
            drive_friction_factor: 1.0,
            drive_coulomb_factor: 1.0,
            centre_of_mass_factor: 1.0,
            tilt_offset_x_rad: 0.0,
            tilt_offset_y_rad: 0.0,
        }
    }
}

/// The floor.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FloorTable {
    /// Inclination along x, positive uphill, degrees.
    pub slope_x_deg: f64,
    /// Inclination along y, positive uphill, degrees.
    pub slope_y_deg: f64,
    /// Mass of ball and body over that of the body; what the slope pulls at.
    pub total_mass_ratio: f64,
}

impl Default for FloorTable {
    fn default() -> Self {
        Self {
            slope_x_deg: 0.0,
            slope_y_deg: 0.0,
            total_mass_ratio: 1.0,
        }
    }
}

/// A plane of the robot.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PlaneName {
    /// The one that moves the robot along x; the only one of a scenario with one plane.
    #[default]
    X,
    /// The one that moves it along y.
    Y,
}

/// A push in one plane.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum PushTable {
    /// The rates change at once.
    Rates {
        /// In which plane.
        #[serde(default)]
        plane: PlaneName,
        /// When, s.
        time_s: f64,
        /// Change of the ball's speed, rad/s.
        #[serde(default)]
        phi_dot_rad_s: f64,
        /// Change of the tilt rate, rad/s.
        #[serde(default)]
        theta_dot_rad_s: f64,
    },
    /// A blow against the body: its momentum per body mass, N s/kg.
    Impulse {
        /// In which plane.
        #[serde(default)]
        plane: PlaneName,
        /// When, s.
        time_s: f64,
        /// Momentum per body mass, positive along the plane's axis, m/s.
        momentum_m_s: f64,
        /// Height above the ball's centre, m.
        height_m: f64,
    },
    /// A constant force against the body, per body mass, N/kg.
    Force {
        /// In which plane.
        #[serde(default)]
        plane: PlaneName,
        /// From when on, s.
        from_s: f64,
        /// Until when, s; inf for ever.
        until_s: f64,
        /// Force per body mass, positive along the plane's axis, m/s^2.
        force_m_s2: f64,
        /// Height above the ball's centre, m.
        height_m: f64,
    },
}
