//! Where a log's quantities stand, and in which units.

use super::channel::{self, Channel};
use super::error::Problem;
use ballbot::{AZIMUTHS_OF_PAPER_DEG, BadWheels, Wheel, Wheels};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Which columns of a file are read, and how; the `[log]` table of a configuration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Columns {
    /// What stands between two fields; a blank stands for any number of blanks and tabs.
    pub delimiter: char,
    /// Names of the columns in a file that has no header.
    pub header: Vec<String>,
    /// Rows before this time are left out, s since the first row.
    pub from_s: Option<f64>,
    /// Rows after this time are left out, s since the first row.
    pub until_s: Option<f64>,
    /// Rows between these times are left out, s since the first row.
    pub leave_out: Vec<[f64; 2]>,
    /// Time stamps.
    #[serde(deserialize_with = "channel::time")]
    pub time: Channel,
    /// Ball angle.
    #[serde(deserialize_with = "channel::phi")]
    pub phi: Channel,
    /// The encoders of the three wheels, whose angles are put together to the ball angle; `phi` is
    /// not read then.
    pub wheels: Option<WheelEncoders>,
    /// Tilt, as the inertial unit gives it.
    #[serde(deserialize_with = "channel::theta")]
    pub theta: Channel,
    /// Tilt rate, as the gyroscope gives it. An empty column name says that there is none.
    #[serde(deserialize_with = "channel::theta_dot")]
    pub theta_dot: Channel,
    /// Torque of the virtual wheel. Without a column name it is `torque_applied_nm` if the file has
    /// that, otherwise `torque_commanded_nm`.
    #[serde(deserialize_with = "channel::torque")]
    pub torque: Channel,
    /// The second plane, where both are identified together: then all of the above is of the first, x.
    pub y: Option<SecondPlane>,
    /// What the ball angle in `phi` is relative to; that of `wheels` is relative to the body.
    pub ball_angle: BallAngle,
    /// Go on although the units look wrong.
    pub accept_suspicious_units: bool,
}

/// The columns of the plane y in a file that holds both planes; time and wheels are those of the plane
/// x.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SecondPlane {
    /// Ball angle, where it is not that of `wheels`.
    #[serde(default)]
    pub phi: Option<Channel>,
    /// Tilt.
    pub theta: Channel,
    /// Tilt rate; without it there is no gyroscope about this axis.
    #[serde(default)]
    pub theta_dot: Option<Channel>,
    /// Torque of the virtual wheel, where it is not that of the motors in `wheels`.
    #[serde(default)]
    pub torque: Option<Channel>,
}

fn azimuths_of_paper() -> [f64; 3] {
    AZIMUTHS_OF_PAPER_DEG
}

/// The encoders of three wheels. The angles m of the wheels against the body are those of the
/// virtual wheels, psi = W' m with the torque map W of [`Wheels`] (virtual work), and a plane's
/// ball angle against the body is r_w / r_b psi.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WheelEncoders {
    /// Which plane of the robot is identified.
    pub plane: WheelPlane,
    /// Angle of the wheels' contact points from the top of the ball, degrees.
    pub zenith_angle_deg: f64,
    /// Azimuths of the wheels from the robot's x axis, counter-clockwise seen from above, degrees.
    #[serde(default = "azimuths_of_paper")]
    pub azimuths_deg: [f64; 3],
    /// Which of the wheels turn by negative angles when the ball turns counter-clockwise, seen from
    /// above.
    #[serde(default)]
    pub reversed: [bool; 3],
    /// The encoders in the order of the wheels; each factor is r_w / r_b for an angle of the wheel,
    /// over the gear's ratio for one of the motor.
    pub encoders: [Channel; 3],
    /// The wheels' torques in the same order, which are put together to that of the virtual wheel;
    /// `torque` is not read then.
    #[serde(default)]
    pub torques: Option<[Channel; 3]>,
}

/// A plane of the robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum WheelPlane {
    /// The one whose ball angle moves the robot along x.
    X,
    /// The one that moves it along y.
    Y,
    /// Both, identified together; the tilt of the plane y is in [`SecondPlane`].
    Both,
    /// The turn about the vertical, which is no plane and has no robot to be found in it.
    #[serde(skip)]
    Turn,
}

impl WheelPlane {
    /// The column of the wheels' matrix that is read. Of both planes a [`super::read`] is of the
    /// first.
    fn column(self) -> usize {
        match self {
            Self::X | Self::Both => 0,
            Self::Y => 1,
            Self::Turn => 2,
        }
    }
}

impl Columns {
    /// The columns of each plane that is identified.
    pub fn planes(&self) -> Vec<Self> {
        let Some(second) = &self.y else {
            return vec![self.clone()];
        };
        let mut planes = [self.of_wheels(WheelPlane::X), self.of_wheels(WheelPlane::Y)];
        let [_, y] = &mut planes;
        y.theta = second.theta.clone();
        y.theta_dot = match &second.theta_dot {
            Some(rate) => rate.clone(),
            None => Channel::new("", Unit::RadianPerSecond),
        };
        y.phi = second.phi.clone().unwrap_or(self.phi.clone());
        y.torque = second.torque.clone().unwrap_or(self.torque.clone());
        planes.into()
    }

    /// The columns of the turn about the vertical, as if it were a plane: where all wheels are read,
    /// what they do is known with it.
    pub(super) fn turn(&self) -> Option<Self> {
        let all = self.y.is_some() && self.wheels.is_some();
        all.then(|| self.of_wheels(WheelPlane::Turn))
    }

    /// The first plane's columns, but for the wheels, which are read for another.
    fn of_wheels(&self, plane: WheelPlane) -> Self {
        let wheels = self.wheels.clone();
        Self {
            wheels: wheels.map(|wheels| WheelEncoders { plane, ..wheels }),
            y: None,
            ..self.clone()
        }
    }

    /// What the ball angle that is read is relative to.
    pub fn ball_angle_read(&self) -> BallAngle {
        match self.wheels {
            Some(_) => BallAngle::RelativeToBody,
            None => self.ball_angle,
        }
    }

    /// Whether the torque is put together from those of three motors.
    pub fn has_motors(&self) -> bool {
        let wheels = self.wheels.as_ref();
        wheels.is_some_and(|wheels| wheels.torques.is_some())
    }

    /// Whether the torque is in N m. Where it is a voltage or a duty cycle of unknown torque, the torque
    /// gain is per that, and the back-EMF is a friction in the drive.
    pub fn torque_known(&self) -> bool {
        let torques = self
            .wheels
            .as_ref()
            .and_then(|wheels| wheels.torques.as_ref());
        match torques {
            Some(torques) => torques.iter().all(Channel::is_torque),
            None => self.torque.is_torque(),
        }
    }

    /// Whether the row at a time (s since the first row) is to be read.
    pub(super) fn takes(&self, time: f64) -> bool {
        let out = self.leave_out.iter();
        self.from_s.is_none_or(|from| time >= from)
            && self.until_s.is_none_or(|until| time <= until)
            && !out
                .into_iter()
                .any(|[from, to]| (*from..=*to).contains(&time))
    }

    /// What the ball angle is called in messages.
    pub(super) fn phi_name(&self) -> &str {
        match self.wheels {
            Some(_) => "the ball angle of the wheels",
            None => &self.phi.column,
        }
    }
}

impl WheelEncoders {
    /// The wheels as they stand.
    ///
    /// # Errors
    /// [`Problem::ZenithAngle`] or [`Problem::Azimuths`] where they cannot turn the ball as one likes.
    pub fn wheels(&self) -> Result<Wheels<f64>, Problem> {
        let wheels = std::array::from_fn(|i| Wheel {
            azimuth: self.azimuths_deg[i].to_radians(),
            reversed: self.reversed[i],
        });
        Wheels::new(self.zenith_angle_deg.to_radians(), wheels).map_err(|error| match error {
            BadWheels::ZenithAngle(_) => Problem::ZenithAngle {
                degrees: self.zenith_angle_deg,
            },
            BadWheels::Azimuths(_) => Problem::Azimuths {
                degrees: self.azimuths_deg,
            },
        })
    }

    /// What each encoder contributes to the ball angle.
    pub(super) fn weights(&self) -> Result<[f64; 3], Problem> {
        let matrix = self.wheels()?.matrix();
        Ok([0, 1, 2].map(|wheel| matrix[(wheel, self.plane.column())]))
    }

    /// What each wheel's torque contributes to that of the virtual wheel.
    pub(super) fn torque_weights(&self) -> Result<[f64; 3], Problem> {
        let wheels = self.wheels()?;
        Ok([0, 1, 2].map(|wheel| {
            let alone = Vector3::ith(wheel, 1.0);
            wheels.virtual_torques(&alone)[self.plane.column()]
        }))
    }
}

/// What the ball angle phi of a log is relative to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BallAngle {
    /// The floor: phi of the model, the ball has rolled by r_b phi.
    #[default]
    Inertial,
    /// The body: phi - theta, what an encoder on the body sees.
    RelativeToBody,
}

impl BallAngle {
    /// The other reading.
    #[must_use]
    pub fn other(self) -> Self {
        match self {
            Self::Inertial => Self::RelativeToBody,
            Self::RelativeToBody => Self::Inertial,
        }
    }
}

/// A unit of a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Unit {
    /// Seconds.
    #[serde(rename = "s")]
    Second,
    /// Milliseconds.
    #[serde(rename = "ms")]
    Millisecond,
    /// Microseconds.
    #[serde(rename = "us")]
    Microsecond,
    /// Nanoseconds.
    #[serde(rename = "ns")]
    Nanosecond,
    /// Radians.
    #[serde(rename = "rad")]
    Radian,
    /// Milliradians.
    #[serde(rename = "mrad")]
    Milliradian,
    /// Degrees.
    #[serde(rename = "deg")]
    Degree,
    /// Metres that the ball has rolled, with 1 / r_b (in 1/m) as the factor.
    #[serde(rename = "m")]
    Metre,
    /// Millimetres that the ball has rolled, with 1 / r_b (in 1/m) as the factor.
    #[serde(rename = "mm")]
    Millimetre,
    /// Turns.
    #[serde(rename = "turn")]
    Turn,
    /// Radians per second.
    #[serde(rename = "rad/s")]
    RadianPerSecond,
    /// Degrees per second.
    #[serde(rename = "deg/s")]
    DegreePerSecond,
    /// Milliradians per second.
    #[serde(rename = "mrad/s")]
    MilliradianPerSecond,
    /// Turns per second.
    #[serde(rename = "turn/s")]
    TurnPerSecond,
    /// Turns per minute.
    #[serde(rename = "rpm")]
    TurnPerMinute,
    /// Newton metres.
    #[serde(rename = "Nm")]
    NewtonMetre,
    /// Millinewton metres.
    #[serde(rename = "mNm")]
    MillinewtonMetre,
    /// Amperes, with the torque per ampere as the factor.
    #[serde(rename = "A")]
    Ampere,
    /// Milliamperes, with the torque per ampere as the factor.
    #[serde(rename = "mA")]
    Milliampere,
    /// Volts at the motor, with the torque per volt at standstill as the factor, if it is known.
    #[serde(rename = "V")]
    Volt,
    /// Duty cycle or counts of a pulse-width modulation, with the torque of one at standstill as the
    /// factor, if it is known.
    #[serde(rename = "1")]
    One,
    /// Duty cycle in per cent; see [`Unit::One`].
    #[serde(rename = "%")]
    Percent,
}

/// What a unit measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Dimension {
    Time,
    Angle,
    Rate,
    Torque,
}

impl fmt::Display for Dimension {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Time => "a time: s, ms, us or ns",
            Self::Angle => "an angle: rad, mrad, deg or turn, or m or mm with 1 / r_b as factor",
            Self::Rate => "a rate: rad/s, mrad/s, deg/s, turn/s or rpm",
            Self::Torque => {
                "a torque: Nm or mNm; A or mA with the torque per ampere as factor; V, %, or 1 for a \
                 duty cycle"
            }
        })
    }
}

impl Unit {
    pub(super) fn dimension(self) -> Dimension {
        match self {
            Self::Second | Self::Millisecond | Self::Microsecond | Self::Nanosecond => {
                Dimension::Time
            }
            Self::Radian
            | Self::Milliradian
            | Self::Degree
            | Self::Turn
            | Self::Metre
            | Self::Millimetre => Dimension::Angle,
            Self::RadianPerSecond
            | Self::MilliradianPerSecond
            | Self::DegreePerSecond
            | Self::TurnPerSecond
            | Self::TurnPerMinute => Dimension::Rate,
            Self::NewtonMetre
            | Self::MillinewtonMetre
            | Self::Ampere
            | Self::Milliampere
            | Self::Volt
            | Self::One
            | Self::Percent => Dimension::Torque,
        }
    }

    /// The SI unit's number for one of this unit.
    pub(super) fn in_si(self) -> f64 {
        use std::f64::consts::{PI, TAU};
        match self {
            Self::Second
            | Self::Radian
            | Self::RadianPerSecond
            | Self::Metre
            | Self::NewtonMetre
            | Self::Ampere
            | Self::Volt
            | Self::One => 1.0,
            Self::Percent => 1e-2,
            Self::Millisecond
            | Self::Milliradian
            | Self::MilliradianPerSecond
            | Self::Millimetre
            | Self::MillinewtonMetre
            | Self::Milliampere => 1e-3,
            Self::Microsecond => 1e-6,
            Self::Nanosecond => 1e-9,
            Self::Degree | Self::DegreePerSecond => PI / 180.0,
            Self::Turn | Self::TurnPerSecond => TAU,
            Self::TurnPerMinute => TAU / 60.0,
        }
    }
}

/// The column of the torque that acted.
pub(super) const APPLIED: &str = "torque_applied_nm";
/// The column of the torque that was asked for.
pub(super) const COMMANDED: &str = "torque_commanded_nm";

impl Default for Columns {
    /// The format that `ballbot simulate --log` writes.
    fn default() -> Self {
        Self {
            delimiter: ',',
            header: Vec::new(),
            from_s: None,
            until_s: None,
            leave_out: Vec::new(),
            time: Channel::new("t_s", Unit::Second),
            phi: Channel::new("phi_rad", Unit::Radian),
            theta: Channel::new("theta_rad", Unit::Radian),
            theta_dot: Channel::new("theta_dot_rad_s", Unit::RadianPerSecond),
            torque: Channel::new("", Unit::NewtonMetre),
            wheels: None,
            y: None,
            ball_angle: BallAngle::Inertial,
            accept_suspicious_units: false,
        }
    }
}
