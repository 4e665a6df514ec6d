//! From a robot's parameters in a file to the robot.

use crate::error::ScenarioError;
use crate::file::parameters::{ParameterTable, Parameters};
use crate::file::schema::BoundsTable;
use crate::number::{finite, positive};
use crate::prepare::files::Files;
use crate::prepare::known_robot::KnownRobot;
use crate::prepare::plausible;
use crate::prepare::uncertainty::{RobotDistribution, Uncertainty};
use crate::words;
use ballbot::{BadWheels, Ballbot, DriveFriction, Geometry};
use serde::Deserialize;
use std::path::Path;

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
    let text = words::read_text(path).map_err(|source| ScenarioError::Read {
        path: path.to_owned(),
        source,
    })?;
    robot(&text).map_err(|source| ScenarioError::InFile {
        path: path.to_owned(),
        source: Box::new(source),
    })
}

fn parsed(text: &str) -> Result<ParameterFile, ScenarioError> {
    words::from_toml(text)
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
