//! TOML files that are handed in.

use ballbot::Ballbot;
use ballbot_identification::ConfigError;
use ballbot_scenario::{ScenarioError, words};
use lpvmpc_certificate::DocumentError;
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
    #[error("{}: {source}", path.display())]
    Value {
        /// The file.
        path: PathBuf,
        /// Key, value and what would be right.
        source: ScenarioError,
    },
    /// A configuration of an identification that makes no sense.
    #[error("{}: {source}", path.display())]
    Identification {
        /// The file.
        path: PathBuf,
        /// Key, value and what would be right.
        source: ConfigError,
    },
    /// Not a certificate.
    #[error("{}: {source}", path.display())]
    Certificate {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        source: DocumentError,
    },
}

/// The text of a file.
///
/// # Errors
/// [`InputError::Read`].
pub fn read_text(path: &Path) -> Result<String, InputError> {
    words::read_text(path).map_err(|source| InputError::Read {
        path: path.to_owned(),
        source,
    })
}

/// The content of a TOML file.
///
/// # Errors
/// [`InputError::Read`] or [`InputError::Syntax`].
pub fn read_toml<T: DeserializeOwned>(path: &Path) -> Result<T, InputError> {
    parse(path, |text| words::from_toml(text))
}

/// What `parser` makes of the text of a TOML file.
///
/// # Errors
/// [`InputError::Read`] or [`InputError::Syntax`].
pub fn parse<T>(
    path: &Path,
    parser: impl Fn(&str) -> Result<T, toml::de::Error>,
) -> Result<T, InputError> {
    parser(&read_text(path)?).map_err(|error| InputError::Syntax {
        path: path.to_owned(),
        message: words::toml_message(&error.to_string()),
    })
}

/// The robot with the keys of a `[parameters]` table.
pub fn parameter_entries(ballbot: &Ballbot<f64>) -> [(&'static str, f64); 10] {
    let geometry = &ballbot.geometry;
    [
        ("b1_m2", ballbot.b1),
        ("b2_m2", ballbot.b2),
        ("b3_m2", ballbot.b3),
        ("b4_m2_s", ballbot.b4),
        ("drive_friction_m2_s", ballbot.drive.viscous),
        ("drive_coulomb_m2_s2", ballbot.drive.coulomb),
        ("centre_of_mass_m", geometry.centre_of_mass),
        ("ball_radius_m", geometry.ball_radius),
        ("wheel_radius_m", geometry.wheel_radius),
        ("gravity_m_s2", geometry.gravity),
    ]
}
