//! TOML files that are handed in.

use ballbot::Ballbot;
use ballbot_identification::ConfigError;
use ballbot_scenario::{ParameterTable, ScenarioError};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use std::path::{Path, PathBuf};

/// A file that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum InputError {
    /// The file cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the file system said.
        source: std::io::Error,
    },
    /// Not TOML, an unknown or missing key, or a value of the wrong type.
    #[error("{}: {}", path.display(), message.trim_end())]
    Syntax {
        /// The file.
        path: PathBuf,
        /// Line, column and what was expected.
        message: String,
    },
    /// A value that makes no sense.
    #[error("{}: {key} = {value}: {expected}", path.display())]
    Value {
        /// The file.
        path: PathBuf,
        /// The key with its table.
        key: String,
        /// What was given.
        value: f64,
        /// What would be right.
        expected: &'static str,
    },
    /// A configuration of an identification that makes no sense.
    #[error("{}: {source}", path.display())]
    Identification {
        /// The file.
        path: PathBuf,
        /// Key, value and what would be right.
        source: ConfigError,
    },
    /// Parameters that make no sense.
    #[error("{}: {source}", path.display())]
    Parameters {
        /// The file.
        path: PathBuf,
        /// Key, value and what would be right.
        source: ScenarioError,
    },
}

/// The text of a file.
///
/// # Errors
/// [`InputError::Read`].
pub fn read_text(path: &Path) -> Result<String, InputError> {
    std::fs::read_to_string(path).map_err(|source| InputError::Read {
        path: path.to_owned(),
        source,
    })
}

/// The content of a TOML file.
///
/// # Errors
/// [`InputError::Read`] or [`InputError::Syntax`].
pub fn read_toml<T: DeserializeOwned>(path: &Path) -> Result<T, InputError> {
    toml::from_str(&read_text(path)?).map_err(|error| InputError::Syntax {
        path: path.to_owned(),
        message: error.to_string(),
    })
}

/// Other tables may stand beside this one, so that a scenario file will do.
#[derive(Deserialize)]
struct WithParameters {
    parameters: ParameterTable,
}

/// The robot in the `[parameters]` table of a file.
///
/// # Errors
/// As [`read_toml`], or a parameter makes no sense.
pub fn read_parameters(path: &Path) -> Result<Ballbot<f64>, InputError> {
    let file: WithParameters = read_toml(path)?;
    file.parameters
        .ballbot()
        .map_err(|source| InputError::Parameters {
            path: path.to_owned(),
            source,
        })
}

/// The robot with the keys of a `[parameters]` table.
pub fn parameter_entries(ballbot: &Ballbot<f64>) -> [(&'static str, f64); 8] {
    let geometry = &ballbot.geometry;
    [
        ("b1_m2", ballbot.b1),
        ("b2_m2", ballbot.b2),
        ("b3_m2", ballbot.b3),
        ("b4_m2_s", ballbot.b4),
        ("centre_of_mass_m", geometry.centre_of_mass),
        ("ball_radius_m", geometry.ball_radius),
        ("wheel_radius_m", geometry.wheel_radius),
        ("gravity_m_s2", geometry.gravity),
    ]
}
