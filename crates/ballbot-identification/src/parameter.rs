//! The unknowns of a ballbot with its drive and its sensors.

use std::fmt;

/// Something that a log can tell about a robot. All inertias and friction coefficients are per unit
/// of body mass, as in the paper.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Parameter {
    /// b1: inertia of the ball's rolling, m^2.
    B1,
    /// b2: coupling inertia, m^2.
    B2,
    /// b3: inertia of the body's tilt, m^2.
    B3,
    /// b4: viscous friction on phi_dot (rolling), m^2/s.
    RollingFriction,
    /// Viscous friction in the drive, on phi_dot - theta_dot, m^2/s.
    DriveFriction,
    /// Coulomb friction in the drive, against phi_dot - theta_dot, m^2/s^2.
    DriveCoulomb,
    /// 1 / m_a: from torque to torque per body mass, 1/kg.
    TorqueGain,
    /// From the logged torque to the torque that acts, s.
    Delay,
    /// What the tilt sensor shows while the body is balanced, rad.
    TiltOffset,
    /// What the gyroscope shows at rest, rad/s.
    GyroBias,
    /// Torque that acts without being logged, N m.
    TorqueBias,
    /// How far the ball angle that is measured runs ahead per rate of the ball, s. Where the contacts
    /// give way in proportion to their force (creep), the wheels turn further than the ball rolls,
    /// by what the momentum of ball and body takes: by this and [`Self::CreepTilt`]. Negative of
    /// both: encoders that are read late.
    CreepBall,
    /// The same per tilt rate, s.
    CreepTilt,
}

impl Parameter {
    /// All of them, in the order of every vector and matrix of this crate.
    pub const ALL: [Self; 13] = [
        Self::B1,
        Self::B2,
        Self::B3,
        Self::RollingFriction,
        Self::DriveFriction,
        Self::DriveCoulomb,
        Self::TorqueGain,
        Self::Delay,
        Self::TiltOffset,
        Self::GyroBias,
        Self::TorqueBias,
        Self::CreepBall,
        Self::CreepTilt,
    ];

    /// What the robot itself is made of: inertias, friction, and the torque gain.
    pub const ROBOT: [Self; 7] = [
        Self::B1,
        Self::B2,
        Self::B3,
        Self::RollingFriction,
        Self::DriveFriction,
        Self::DriveCoulomb,
        Self::TorqueGain,
    ];

    /// Its place in [`Parameter::ALL`].
    pub const fn index(self) -> usize {
        self as usize
    }

    /// The key in files, with the unit.
    pub const fn key(self) -> &'static str {
        match self {
            Self::B1 => "b1_m2",
            Self::B2 => "b2_m2",
            Self::B3 => "b3_m2",
            Self::RollingFriction => "b4_m2_s",
            Self::DriveFriction => "drive_friction_m2_s",
            Self::DriveCoulomb => "drive_coulomb_m2_s2",
            Self::TorqueGain => "torque_gain_1_kg",
            Self::Delay => "delay_s",
            Self::TiltOffset => "tilt_offset_rad",
            Self::GyroBias => "gyro_bias_rad_s",
            Self::TorqueBias => "torque_bias_nm",
            Self::CreepBall => "creep_phi_s",
            Self::CreepTilt => "creep_theta_s",
        }
    }

    /// In words.
    pub const fn words(self) -> &'static str {
        match self {
            Self::B1 => "the inertia of the ball's rolling (b1)",
            Self::B2 => "the coupling inertia (b2)",
            Self::B3 => "the inertia of the body's tilt (b3)",
            Self::RollingFriction => "the friction of rolling (b4)",
            Self::DriveFriction => "the viscous friction in the drive",
            Self::DriveCoulomb => "the Coulomb friction in the drive",
            Self::TorqueGain => "the torque gain (1 / body mass)",
            Self::Delay => "the input delay",
            Self::TiltOffset => "the tilt sensor's offset",
            Self::GyroBias => "the gyroscope's bias",
            Self::TorqueBias => "a constant torque",
            Self::CreepBall => "the creep of the ball angle with the ball's rate",
            Self::CreepTilt => "the creep of the ball angle with the tilt rate",
        }
    }

    /// The unit.
    pub const fn unit(self) -> &'static str {
        match self {
            Self::B1 | Self::B2 | Self::B3 => "m^2",
            Self::RollingFriction | Self::DriveFriction => "m^2/s",
            Self::DriveCoulomb => "m^2/s^2",
            Self::TorqueGain => "1/kg",
            Self::Delay | Self::CreepBall | Self::CreepTilt => "s",
            Self::TiltOffset => "rad",
            Self::GyroBias => "rad/s",
            Self::TorqueBias => "N m",
        }
    }

    /// What excitation tells more of it.
    pub const fn excitation(self) -> &'static str {
        match self {
            Self::B1 | Self::B2 | Self::B3 => {
                "a larger torque around the fastest mode, 1 Hz to 5 Hz"
            }
            Self::TorqueGain => "a larger torque; or weigh the body and give its mass",
            Self::RollingFriction => {
                "faster rolling: slow harmonics, below 0.5 Hz, of larger travel"
            }
            Self::DriveFriction => "faster rolling and tilting, 0.5 Hz to 5 Hz",
            Self::DriveCoulomb => "many reversals at low speed, and fast motion to compare with",
            Self::Delay | Self::CreepBall | Self::CreepTilt => {
                "a torque that changes fast: harmonics above 5 Hz, or a square wave"
            }
            Self::TiltOffset | Self::TorqueBias => "a longer log",
            Self::GyroBias => "a longer log, tilt and rate both recorded",
        }
    }

    /// The parameter with this key.
    pub fn from_key(key: &str) -> Option<Self> {
        Self::ALL
            .into_iter()
            .find(|parameter| parameter.key() == key)
    }
}

impl fmt::Display for Parameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.key())
    }
}

/// One value for each parameter, in the order of [`Parameter::ALL`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Values<T = f64>(pub [T; Parameter::ALL.len()]);

impl<T> std::ops::Index<Parameter> for Values<T> {
    type Output = T;
    fn index(&self, parameter: Parameter) -> &T {
        &self.0[parameter.index()]
    }
}

impl<T> std::ops::IndexMut<Parameter> for Values<T> {
    fn index_mut(&mut self, parameter: Parameter) -> &mut T {
        &mut self.0[parameter.index()]
    }
}

/// What is to be done with a parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Choice {
    /// Held at this value.
    Fixed(f64),
    /// Found from the log; from this value, or from one found beforehand.
    Free {
        /// Where the fit starts.
        start: Option<f64>,
    },
    /// Found from the log and from what is known beforehand.
    Prior {
        /// Expected value.
        mean: f64,
        /// Its standard deviation.
        standard_deviation: f64,
    },
}

impl Choice {
    /// Whether the fit changes the parameter.
    pub fn is_free(self) -> bool {
        !matches!(self, Self::Fixed(_))
    }

    /// Free, without a start.
    pub const FREE: Self = Self::Free { start: None };
}

impl Values<Choice> {
    /// What is fitted unless the builder says otherwise: everything but Coulomb friction, a constant
    /// torque and creep, which are held at zero.
    pub fn usual() -> Self {
        let mut choices = Self([Choice::FREE; Parameter::ALL.len()]);
        choices[Parameter::DriveCoulomb] = Choice::Fixed(0.0);
        choices[Parameter::TorqueBias] = Choice::Fixed(0.0);
        choices[Parameter::CreepBall] = Choice::Fixed(0.0);
        choices[Parameter::CreepTilt] = Choice::Fixed(0.0);
        choices
    }

    /// The choices, with the gyroscope's bias held where there is no gyroscope: no other column tells
    /// of it.
    #[must_use]
    pub fn with_sensors(mut self, gyroscope: bool) -> Self {
        if !gyroscope {
            self[Parameter::GyroBias] = Choice::Fixed(0.0);
        }
        self
    }
}
