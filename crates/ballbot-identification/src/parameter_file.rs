//! The result as a TOML file: written, and read again.

use crate::config::{Config, ConfigError, GeometryTable};
use crate::joint::PLANES;
use crate::parameter::Parameter;
use crate::robot::{IdentifiedRobot, OfPlane};
use crate::words::number;
use lpvmpc_design::number_text;
use nalgebra::DMatrix;
use serde::Deserialize;
use serde::de::Error as _;
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// What stands in a file of parameters: a table's key, the plane it is read from, the parameter.
type Entry = (String, usize, Parameter);

/// A robot as a file of parameters has it.
#[derive(Clone, Debug, PartialEq)]
pub struct Identified {
    /// Lengths and gravity that the parameters were identified with.
    pub lengths: GeometryTable,
    /// What was found or held.
    pub parameters: Vec<(Parameter, f64)>,
}

/// The robot in the text of a file of parameters.
///
/// # Errors
/// It is not TOML, has no tables `[parameters]` and `[identification]`, or a number in them that no robot
/// has.
pub fn identified_parameters(text: &str) -> Result<Identified, toml::de::Error> {
    let file: IdentifiedFile = toml::from_str(text)?;
    let entries = file.identification.parameters.into_iter();
    let known = entries.filter_map(|(key, entry)| Parameter::from_key(&key).zip(entry.value));
    let parameters: Vec<(Parameter, f64)> = known.collect();
    let gain = parameters
        .iter()
        .find(|(parameter, _)| *parameter == Parameter::TorqueGain);
    let (_, gain) = gain.ok_or_else(|| {
        let key = Parameter::TorqueGain.key();
        toml::de::Error::custom(format!("identification.{key} is missing"))
    })?;
    let Lengths {
        centre_of_mass_m,
        ball_radius_m,
        wheel_radius_m,
        gravity_m_s2,
    } = file.parameters;
    let lengths = GeometryTable {
        centre_of_mass_m,
        ball_radius_m,
        // The file's own has the gain in it.
        wheel_radius_m: wheel_radius_m * gain,
        gravity_m_s2,
    };
    for (key, value) in lengths.entries() {
        if !(value.is_finite() && value > 0.0) {
            let value = number_text(value);
            let problem = format!("{key} = {value}: it must be a positive number");
            return Err(toml::de::Error::custom(problem));
        }
    }
    Ok(Identified {
        lengths,
        parameters,
    })
}

impl Identified {
    /// The configuration with the lengths that the parameters were identified with: they mean nothing
    /// with others.
    ///
    /// # Errors
    /// The configuration gives others.
    pub(crate) fn configured(&self, config: &Config) -> Result<Config, ConfigError> {
        let usual = GeometryTable::default();
        let given = config.geometry.entries().into_iter();
        let known = self.lengths.entries().into_iter().zip(usual.entries());
        for ((key, given), ((_, known), (_, usual))) in given.zip(known) {
            // The gain was divided by and is multiplied with.
            let agrees = (given - known).abs() <= 1e-9 * known;
            if given != usual && !agrees {
                return Err(ConfigError::Value {
                    key: format!("geometry.{key}"),
                    value: given,
                    expected: format!(
                        "{}, with which the parameters were identified, or be left out",
                        number(known)
                    )
                    .into(),
                });
            }
        }
        Ok(Config {
            geometry: self.lengths,
            ..config.clone()
        })
    }
}

/// Lengths and gravity among the parameters of a scenario.
#[derive(Deserialize)]
struct Lengths {
    centre_of_mass_m: f64,
    ball_radius_m: f64,
    wheel_radius_m: f64,
    gravity_m_s2: f64,
}

/// What of the file is needed.
#[derive(Deserialize)]
struct IdentifiedFile {
    parameters: Lengths,
    identification: IdentifiedEntries,
}

#[derive(Deserialize)]
struct IdentifiedEntries {
    #[serde(flatten)]
    parameters: BTreeMap<String, IdentifiedEntry>,
}

/// A parameter; the covariance has no value.
#[derive(Deserialize)]
struct IdentifiedEntry {
    value: Option<f64>,
}

impl IdentifiedRobot {
    /// The files of parameters with their names: `parameters.toml`, or, of a body that is not
    /// symmetric, whose planes are two robots, `parameters_x.toml` and `parameters_y.toml`. Each has
    /// the robot as a `[parameters]` table of a scenario, what does not fit into that, and the
    /// covariance.
    ///
    /// # Errors
    /// The verdicts that forbid it: what was found is no robot.
    pub fn parameter_files(&self) -> Result<Vec<(String, String)>, Vec<OfPlane>> {
        let refusals = self.refusals();
        if !refusals.is_empty() {
            return Err(refusals);
        }
        if !self.variables.is_own(Parameter::B3) {
            let variables = self.variables.all();
            let entries = variables.map(|(plane, one)| (self.key(plane, one), plane, one));
            let text = self.text(0, &entries.collect::<Vec<_>>(), self.covariance());
            return Ok(vec![("parameters.toml".to_owned(), text)]);
        }
        let planes = self.planes.iter().enumerate();
        let files = planes.map(|(plane, identification)| {
            let entries = Parameter::ALL.map(|one| (one.key().to_owned(), plane, one));
            let text = self.text(plane, &entries, identification.covariance());
            (format!("parameters_{}.toml", PLANES[plane]), text)
        });
        Ok(files.collect())
    }

    /// The file of the robot that a plane shows.
    fn text(&self, plane: usize, entries: &[Entry], covariance: &DMatrix<f64>) -> String {
        let identification = &self.planes[plane];
        let mut text = String::new();
        let robot = identification.ballbot();
        let geometry = &robot.geometry;
        // Writing to a string cannot fail; {:?} gives the shortest digits that read back the same.
        let _ = write!(
            text,
            "# A ballbot identified by `ballbot identify`.\n\
             # Scenarios take it as `parameters = \"this file\"`, and all commands with a robot as \
             `--parameters`.\n\n\
             [parameters]\nb1_m2 = {:?}\nb2_m2 = {:?}\nb3_m2 = {:?}\nb4_m2_s = {:?}\n\
             drive_friction_m2_s = {:?}\ndrive_coulomb_m2_s2 = {:?}\n\
             centre_of_mass_m = {:?}\nball_radius_m = {:?}\n\
             # r_w / gain = {:?} / {:?}: torque enters by r_b / r_w alone, so the gain (1 / body mass) is\n\
             # in it, and the model's torque is in N m.\n\
             wheel_radius_m = {:?}\ngravity_m_s2 = {:?}\n",
            robot.b1,
            robot.b2,
            robot.b3,
            robot.b4,
            robot.drive.viscous,
            robot.drive.coulomb,
            geometry.centre_of_mass,
            geometry.ball_radius,
            identification.geometry.wheel_radius,
            identification.estimate.values[Parameter::TorqueGain],
            geometry.wheel_radius,
            geometry.gravity,
        );
        if let Some(wheels) = &self.wheels {
            let _ = write!(
                text,
                "zenith_angle_deg = {:?}\nwheel_azimuths_deg = {:?}\nwheels_reversed = {:?}\n",
                wheels.zenith_angle_deg, wheels.azimuths_deg, wheels.reversed,
            );
        }
        let _ = write!(
            text,
            "\n# All that was found or held, with standard deviations.\n"
        );
        for (key, plane, parameter) in entries {
            let (identification, parameter) = (&self.planes[*plane], *parameter);
            let status = identification.estimate.status[parameter].word();
            let _ = write!(
                text,
                "\n[identification.{key}] # {}\nvalue = {:?} # {}\nstandard_deviation = {:?}\n\
                 status = \"{status}\"\n",
                parameter.words(),
                identification.estimate.values[parameter],
                parameter.unit(),
                identification.standard_deviation(parameter),
            );
        }
        let keys: Vec<String> = entries
            .iter()
            .map(|(key, ..)| format!("\"{key}\""))
            .collect();
        let _ = write!(
            text,
            "\n[identification.covariance]\nparameters = [{}]\nmatrix = [\n",
            keys.join(", ")
        );
        for row in covariance.row_iter() {
            let entries: Vec<String> = row.iter().map(|entry| format!("{entry:?}")).collect();
            let _ = writeln!(text, "    [{}],", entries.join(", "));
        }
        text + "]\n"
    }
}
