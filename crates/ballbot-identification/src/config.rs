//! The configuration file of an identification.

mod body;
mod check;
mod error;

pub use body::BodyTable;
pub use error::ConfigError;

use crate::log::Columns;
use crate::parameter::{Choice, Parameter, Values};
use ballbot::Geometry;
use check::{positive, within};
use serde::Deserialize;
use std::collections::BTreeMap;

/// A configuration, as written in a TOML file. Every table may be left out.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// Where the quantities stand.
    pub log: Columns,
    /// Lengths and gravity.
    pub geometry: GeometryTable,
    /// Masses and inertias from a drawing.
    pub body: Option<BodyTable>,
    /// What is done with each parameter, by its key; see [`Parameter::key`].
    pub parameters: BTreeMap<String, ChoiceTable>,
    /// Known noise of the sensors.
    pub noise: NoiseTable,
    /// The fit.
    pub fit: FitTable,
}

/// Lengths and gravity; the paper's robot where nothing is said.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GeometryTable {
    /// l, m.
    pub centre_of_mass_m: f64,
    /// r_b, m.
    pub ball_radius_m: f64,
    /// r_w, m.
    pub wheel_radius_m: f64,
    /// g, m/s^2.
    pub gravity_m_s2: f64,
}

impl Default for GeometryTable {
    fn default() -> Self {
        let paper = Geometry::paper();
        Self {
            centre_of_mass_m: paper.centre_of_mass,
            ball_radius_m: paper.ball_radius,
            wheel_radius_m: paper.wheel_radius,
            gravity_m_s2: paper.gravity,
        }
    }
}

impl GeometryTable {
    /// The values with their keys.
    pub(crate) fn entries(&self) -> [(&'static str, f64); 4] {
        [
            ("centre_of_mass_m", self.centre_of_mass_m),
            ("ball_radius_m", self.ball_radius_m),
            ("wheel_radius_m", self.wheel_radius_m),
            ("gravity_m_s2", self.gravity_m_s2),
        ]
    }
}

/// What is done with a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum ChoiceTable {
    /// `"free"`.
    Free,
    /// `{ fixed = 0.1 }`.
    Fixed(f64),
    /// `{ start = 0.1 }`: free, from there.
    Start(f64),
    /// `{ prior = { mean = 0.1, standard_deviation = 0.02 } }`.
    Prior {
        /// Expected value.
        mean: f64,
        /// Standard deviation.
        standard_deviation: f64,
    },
}

/// Standard deviations of the sensors' noise; what is left out is found from the log.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct NoiseTable {
    /// Of the ball angle, rad.
    pub phi_rad: Option<f64>,
    /// Of the tilt, rad.
    pub theta_rad: Option<f64>,
    /// Of the tilt rate, rad/s.
    pub theta_dot_rad_s: Option<f64>,
}

/// How the fit is made.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FitTable {
    /// Only a robot that mechanics allows.
    pub physical: bool,
    /// Length of a segment, s.
    pub segment_s: f64,
    /// The part of each run, at its end, that is held back to judge the fit.
    pub held_back: f64,
    /// Of both planes: the body has the same inertia about both axes, one b3.
    pub symmetric_body: bool,
}

impl Default for FitTable {
    fn default() -> Self {
        Self {
            physical: true,
            segment_s: 1.0,
            held_back: 0.25,
            symmetric_body: true,
        }
    }
}

impl Config {
    /// A commented example with all keys and their defaults.
    pub const EXAMPLE: &str = include_str!("config.example.toml");

    /// The configuration in a text.
    ///
    /// # Errors
    /// [`ConfigError`].
    pub fn parse(text: &str) -> Result<Self, ConfigError> {
        let config: Self = lpvmpc_words::from_toml(text)
            .map_err(|error| ConfigError::Syntax(error.to_string()))?;
        config.check()?;
        Ok(config)
    }

    /// Lengths and gravity.
    pub fn geometry(&self) -> Geometry<f64> {
        Geometry {
            centre_of_mass: self.geometry.centre_of_mass_m,
            ball_radius: self.geometry.ball_radius_m,
            wheel_radius: self.geometry.wheel_radius_m,
            gravity: self.geometry.gravity_m_s2,
        }
    }

    /// Known noise of ball angle, tilt and rate.
    pub fn noise(&self) -> [Option<f64>; 3] {
        [
            self.noise.phi_rad,
            self.noise.theta_rad,
            self.noise.theta_dot_rad_s,
        ]
    }

    /// What is done with each parameter.
    ///
    /// # Errors
    /// An unknown key, or a value out of range.
    pub fn choices(&self) -> Result<Values<Choice>, ConfigError> {
        let mut choices = Values::usual();
        if let Some(body) = self.body {
            body.choose(&self.geometry(), &mut choices)?;
        }
        for (key, table) in &self.parameters {
            let parameter = Parameter::from_key(key)
                .ok_or_else(|| ConfigError::UnknownParameter { key: key.clone() })?;
            let key = format!("parameters.{key}");
            choices[parameter] = table.choice(&key)?;
            if let Choice::Fixed(value)
            | Choice::Free { start: Some(value) }
            | Choice::Prior { mean: value, .. } = choices[parameter]
            {
                self.check_size(parameter, &key, value)?;
            }
        }
        Ok(choices)
    }
}

impl ChoiceTable {
    fn choice(self, key: &str) -> Result<Choice, ConfigError> {
        let finite = |value: f64| within(key, value, -1e9, 1e9, "a finite number").map(|()| value);
        Ok(match self {
            Self::Free => Choice::FREE,
            Self::Fixed(value) => Choice::Fixed(finite(value)?),
            Self::Start(value) => Choice::Free {
                start: Some(finite(value)?),
            },
            Self::Prior {
                mean,
                standard_deviation,
            } => {
                positive(
                    &format!("{key}.prior.standard_deviation"),
                    standard_deviation,
                )?;
                Choice::Prior {
                    mean: finite(mean)?,
                    standard_deviation,
                }
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::Unit;

    #[test]
    fn the_example_says_the_defaults() {
        assert_eq!(Config::parse(Config::EXAMPLE).unwrap(), Config::default());
    }

    #[test]
    fn what_the_example_leaves_out_can_be_put_in() {
        let lines = Config::EXAMPLE
            .lines()
            .map(|line| line.strip_prefix("#= ").unwrap_or(line));
        let text = lines.collect::<Vec<_>>().join("\n");
        let config = Config::parse(&text).unwrap();
        assert!(config.body.is_some() && !config.parameters.is_empty());
        assert!(config.noise.phi_rad.is_some());
    }

    #[test]
    fn of_a_column_any_key_may_be_left_out() {
        let log = |text: &str| Config::parse(text).unwrap().log;
        let theta = log("[log.theta]\ncolumn = \"pitch\"").theta;
        assert_eq!((theta.column.as_str(), theta.unit), ("pitch", Unit::Radian));
        let theta = log("[log.theta]\nunit = \"deg\"").theta;
        assert_eq!(
            (theta.column.as_str(), theta.unit),
            ("theta_rad", Unit::Degree)
        );
        let time = log("[log.time]\nfactor = 2.0").time;
        assert_eq!((time.unit, time.factor), (Unit::Second, 2.0));
    }

    #[test]
    fn what_no_ballbot_of_these_lengths_has_may_be_wanted_of_the_data_alone() {
        let text = "[fit]\nphysical = false\n[parameters]\nb1_m2 = { start = 0.01 }";
        assert!(Config::parse(text).is_ok());
    }

    #[test]
    fn a_body_that_was_weighed_holds_the_torque_gain() {
        let config = Config::parse("[body]\nbody_mass_kg = 8.0").unwrap();
        let choices = config.choices().unwrap();
        assert_eq!(choices[Parameter::TorqueGain], Choice::Fixed(0.125));
        assert_eq!(choices[Parameter::B1], Choice::FREE);
    }

    #[test]
    fn wrong_values_are_named() {
        for (text, part) in [
            (
                "[geometry]\nball_radius_m = -1",
                "geometry.ball_radius_m = -1",
            ),
            ("[geometry]\nball_radius_m = 120.0", "lengths are in metres"),
            (
                "[geometry]\ncentre_of_mass_m = 297.8",
                "geometry.centre_of_mass_m = 297.8: it must be from 0.01 to 3 m",
            ),
            ("[geometry]\nwheel_radius_m = 5.0", "lengths are in metres"),
            ("[geometry]\ngravity_m_s2 = 981.0", "from 1 to 30 m/s^2"),
            ("[fit]\nsegment_s = 1e300", "fit.segment_s = 1e300: it"),
            ("[fit]\nsegment_s = nan", "fit.segment_s"),
            ("[fit]\nheld_back = 1.0", "from 0 to 0.8"),
            ("[parameters]\nb7 = \"free\"", "there is no such parameter"),
            ("[parameters]\ndelay_s = { fixed = 3.0 }", "from 0 to 0.1 s"),
            (
                "[parameters]\nb1_m2 = { fixed = -1 }",
                "parameters.b1_m2 = -1: it must be from 0.014402 to 1.5984 m^2",
            ),
            (
                "[parameters]\nb4_m2_s = { start = -5 }",
                "parameters.b4_m2_s = -5: it must be from 0 to 14.4 m^2/s",
            ),
            (
                "[parameters]\ntorque_gain_1_kg = { prior = { mean = -0.1, standard_deviation = 1 } }",
                "parameters.torque_gain_1_kg = -0.1: it must be a positive number",
            ),
            (
                "[log]\nfrom_s = 5\nuntil_s = 2",
                "log.until_s = 2: it must be a time after log.from_s",
            ),
            (
                "[log]\ndelimiter = \"a\"",
                "log.delimiter = 'a': it must be a character",
            ),
            (
                "[log]\ndelimiter = \".\"",
                "log.delimiter = '.': it must be a character",
            ),
            (
                "[parameters]\nb1_m2 = { prior = { mean = 1.0, standard_deviation = 0.0 } }",
                "a positive number",
            ),
            (
                "[body]\nbody_mass_kg = 10.0\nball_mass_kg = 2.0",
                "body.body_inertia_kg_m2 is missing",
            ),
            ("[body]\nbody_mass_kg = 0.0", "body.body_mass_kg = 0"),
            (
                "[body]\nbody_mass_kg = 11000",
                "body.body_mass_kg = 11000: it must be from 0.2641 to 1321 kg, with its centre of mass at 0.2978 m",
            ),
            ("[log.theta]\ncolumn = \"t\"\nunit = \"grad\"", "grad"),
            (
                "[log]\nleave_out = [[3.0, 2.0]]",
                "log.leave_out = 2: it must be a time after",
            ),
            (
                "[body]\nbody_mass_kg = 10.0\n[log.torque]\ncolumn = \"pwm\"\nunit = \"1\"",
                "without the torque per unit",
            ),
            ("[logs]", "logs"),
            (
                "[log.y.theta]\ncolumn = \"theta_y\"\nunit = \"rad\"",
                "log.y.phi: it is missing",
            ),
            (
                "[log.y]\nphi = { column = \"phi_y\", unit = \"rad\" }\n\
                 theta = { column = \"theta_y\", unit = \"rad\" }",
                "log.y.torque: it is missing",
            ),
            (
                "[log.y]\nphi = { column = \"phi_y\", unit = \"rad\" }\n\
                 theta = { column = \"theta_rad\", unit = \"rad\" }\n\
                 torque = { column = \"torque_y\", unit = \"Nm\" }",
                "log.y.theta: it is the same column as that of the plane x",
            ),
            (
                "[log.y]\nphi = { column = \"phi_y\", unit = \"rad\" }\n\
                 theta = { column = \"theta_y\", unit = \"rad\" }\n\
                 torque = { column = \"torque_y\", unit = \"%\" }",
                "log.y.torque: the torque gain is that of both planes",
            ),
        ] {
            let message = Config::parse(text).unwrap_err().to_string();
            assert!(message.contains(part), "{message}");
        }
    }
}
