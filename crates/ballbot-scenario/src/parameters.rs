//! The robot: a table of parameters, or a file that has one.

use crate::error::ScenarioError;
use crate::files::Files;
use crate::number::{finite, positive};
use crate::plausible;
use crate::schema::{BoundsTable, ParameterTable};
use crate::uncertainty::{RobotDistribution, Uncertainty};
use crate::words;
use ballbot::{BadWheels, Ballbot, DriveFriction, Geometry, Wheels};
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use std::fmt;
use std::path::{Path, PathBuf};

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

/// A robot whose parameters have been read and checked.
#[derive(Debug)]
pub struct KnownRobot {
    /// The plant.
    pub ballbot: Ballbot<f64>,
    /// The torque map to the motors.
    pub wheels: Wheels<f64>,
    /// How far the parameters may be off, where the file says so.
    pub uncertainty: Option<Box<dyn RobotDistribution>>,
}

/// Other tables may stand beside these.
#[derive(Deserialize)]
struct ParameterFile {
    parameters: ParameterTable,
    identification: Option<Uncertainty>,
    #[serde(default)]
    accept_unusual_values: bool,
}

impl Parameters {
    /// The robot. `key` is where the parameters stand in the scenario, for messages; files are
    /// looked for in `files`.
    ///
    /// # Errors
    /// A file that cannot be read or has no such table, a number that is not finite, or a
    /// length that is not positive.
    pub fn read(&self, key: &str, files: &dyn Files) -> Result<KnownRobot, ScenarioError> {
        match self {
            Self::Table(table) => table.robot(key),
            Self::File(file) => files.robot(file),
        }
    }
}

/// The robot in the table `[parameters]` of a TOML file, for a command that has no scenario.
///
/// # Errors
/// As [`Parameters::read`], or a number that no ballbot has where the file does not say that it is
/// meant (`accept_unusual_values = true`).
pub fn read_robot(file: &Path) -> Result<KnownRobot, ScenarioError> {
    in_file(file, |text| {
        let file = parsed(text)?;
        let unusual = file.accept_unusual_values;
        let robot = file.robot()?;
        match unusual {
            true => Ok(robot),
            false => plausible::check_robot("parameters", &robot).map(|()| robot),
        }
    })
}

/// The robot in a file of `directory`.
pub(crate) fn read(file: &Path, directory: &Path) -> Result<KnownRobot, ScenarioError> {
    in_file(&directory.join(file), |text| parsed(text)?.robot())
}

fn in_file(
    path: &Path,
    robot: impl Fn(&str) -> Result<KnownRobot, ScenarioError>,
) -> Result<KnownRobot, ScenarioError> {
    let text = std::fs::read_to_string(path).map_err(|source| ScenarioError::Read {
        path: path.to_owned(),
        source,
    })?;
    robot(&text).map_err(|source| ScenarioError::InFile {
        path: path.to_owned(),
        source: Box::new(source),
    })
}

fn parsed(text: &str) -> Result<ParameterFile, ScenarioError> {
    toml::from_str(text)
        .map_err(|error| ScenarioError::ParameterFile(words::toml_message(&error.to_string())))
}

impl ParameterFile {
    fn robot(self) -> Result<KnownRobot, ScenarioError> {
        let uncertainty = self.identification;
        Ok(KnownRobot {
            uncertainty: uncertainty.map(|known| Box::new(known) as Box<dyn RobotDistribution>),
            ..self.parameters.robot("parameters")?
        })
    }
}

impl ParameterTable {
    fn robot(&self, key: &str) -> Result<KnownRobot, ScenarioError> {
        let finite = |name: &str, value| finite(&format!("{key}.{name}"), value);
        let positive = |name: &str, value| positive(&format!("{key}.{name}"), value);
        Ok(KnownRobot {
            ballbot: Ballbot {
                b1: finite("b1_m2", self.b1_m2)?,
                b2: finite("b2_m2", self.b2_m2)?,
                b3: finite("b3_m2", self.b3_m2)?,
                b4: finite("b4_m2_s", self.b4_m2_s)?,
                drive: DriveFriction {
                    viscous: finite("drive_friction_m2_s", self.drive_friction_m2_s)?,
                    coulomb: finite("drive_coulomb_m2_s2", self.drive_coulomb_m2_s2)?,
                },
                geometry: Geometry {
                    centre_of_mass: positive("centre_of_mass_m", self.centre_of_mass_m)?,
                    ball_radius: positive("ball_radius_m", self.ball_radius_m)?,
                    wheel_radius: positive("wheel_radius_m", self.wheel_radius_m)?,
                    gravity: positive("gravity_m_s2", self.gravity_m_s2)?,
                },
            },
            wheels: self.wheels().map_err(|error| {
                let (name, value) = match error {
                    BadWheels::ZenithAngle(_) => {
                        ("zenith_angle_deg", self.zenith_angle_deg.to_string())
                    }
                    BadWheels::Azimuths(_) => {
                        let azimuths = self.wheel_azimuths_deg;
                        ("wheel_azimuths_deg", format!("{azimuths:?}"))
                    }
                };
                ScenarioError::value(format!("{key}.{name}"), value, error.to_string())
            })?,
            uncertainty: None,
        })
    }
}

/// The equations of motion must have a solution at every tilt within the bounds.
pub(crate) fn check_motion(
    ballbot: &Ballbot<f64>,
    bounds: &BoundsTable,
) -> Result<(), ScenarioError> {
    let [lower, upper] = bounds.theta_rad;
    let tilt = lower.abs().max(upper.abs()).min(std::f64::consts::PI);
    let consistency = ballbot.consistency(tilt);
    if consistency.mass_invertible {
        Ok(())
    } else {
        Err(ScenarioError::Parameters(consistency.to_string()))
    }
}
