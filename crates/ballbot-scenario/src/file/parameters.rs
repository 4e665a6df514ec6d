//! A robot in a file: a table of parameters, or the name of a file that has one.

use ballbot::{AZIMUTHS_OF_PAPER_DEG, BadWheels, Wheel, Wheels};
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use std::fmt;
use std::path::PathBuf;

/// Where the parameters of a robot stand.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Parameters {
    /// Here.
    Table(ParameterTable),
    /// In the table `[parameters]` of this TOML file, relative to the scenario file: the
    /// `parameters.toml` of `ballbot identify`, a result of `ballbot refine`, or another scenario.
    File(PathBuf),
}

impl<'de> Deserialize<'de> for Parameters {
    // By hand, since a derived choice would not say which key of a table is wrong.
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct TableOrFile;

        impl<'de> Visitor<'de> for TableOrFile {
            type Value = Parameters;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a table of parameters, or the path of a file with such a table")
            }

            fn visit_str<E: Error>(self, path: &str) -> Result<Parameters, E> {
                Ok(Parameters::File(path.into()))
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Parameters, A::Error> {
                let table = MapAccessDeserializer::new(map);
                Ok(Parameters::Table(ParameterTable::deserialize(table)?))
            }

            // From a format that reads a table field by field, and so must be told the fields.
            fn visit_newtype_struct<D: Deserializer<'de>>(
                self,
                table: D,
            ) -> Result<Parameters, D::Error> {
                Ok(Parameters::Table(ParameterTable::deserialize(table)?))
            }
        }

        deserializer.deserialize_any(TableOrFile)
    }
}

/// Parameters b and geometry of a ballbot; see [`ballbot::Ballbot`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ParameterTable {
    /// b1, m^2.
    pub b1_m2: f64,
    /// b2, m^2.
    pub b2_m2: f64,
    /// b3, m^2.
    pub b3_m2: f64,
    /// b4, m^2/s.
    pub b4_m2_s: f64,
    /// Viscous friction in the drive, on phi_dot - theta_dot, m^2/s.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub drive_friction_m2_s: f64,
    /// Coulomb friction in the drive, m^2/s^2.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub drive_coulomb_m2_s2: f64,
    /// l, m.
    pub centre_of_mass_m: f64,
    /// r_b, m.
    pub ball_radius_m: f64,
    /// r_w, m.
    pub wheel_radius_m: f64,
    /// g, m/s^2.
    pub gravity_m_s2: f64,
    /// Angle of the wheels' contact points from the top of the ball, degrees.
    #[serde(default = "paper_zenith_angle")]
    pub zenith_angle_deg: f64,
    /// Azimuths of the wheels 1 to 3 from the robot's x axis, counter-clockwise seen from above,
    /// degrees.
    #[serde(default = "paper_azimuths", skip_serializing_if = "is_of_paper")]
    pub wheel_azimuths_deg: [f64; 3],
    /// Which of the wheels turn the ball clockwise, seen from above, when their motors turn by
    /// positive angles.
    #[serde(default, skip_serializing_if = "is_none_reversed")]
    pub wheels_reversed: [bool; 3],
}

pub(crate) fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

/// The arrangement of the torque map of the paper's eq. (6).
fn paper_azimuths() -> [f64; 3] {
    AZIMUTHS_OF_PAPER_DEG
}

fn is_of_paper(azimuths: &[f64; 3]) -> bool {
    *azimuths == paper_azimuths()
}

fn is_none_reversed(reversed: &[bool; 3]) -> bool {
    *reversed == [false; 3]
}

impl ParameterTable {
    /// The wheels as they stand.
    ///
    /// # Errors
    /// [`BadWheels`] where they cannot turn the ball as one likes.
    pub fn wheels(&self) -> Result<Wheels<f64>, BadWheels<f64>> {
        let wheels = std::array::from_fn(|i| Wheel {
            azimuth: self.wheel_azimuths_deg[i].to_radians(),
            reversed: self.wheels_reversed[i],
        });
        Wheels::new(self.zenith_angle_deg.to_radians(), wheels)
    }
}

fn paper_zenith_angle() -> f64 {
    45.0
}
