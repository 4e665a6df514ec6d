//! What can be wrong with a configuration.

use crate::parameter::Parameter;
use lpvmpc_design::number_text;
use std::borrow::Cow;

/// What makes no sense in a configuration.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ConfigError {
    /// Not TOML, an unknown or missing key, or a value of the wrong type.
    #[error("{0}")]
    Syntax(String),
    /// A parameter that does not exist.
    #[error("parameters.{key}: there is no such parameter; there are {}", Parameter::ALL.map(Parameter::key).join(", "))]
    UnknownParameter {
        /// What was written.
        key: String,
    },
    /// A mass beside a torque in no unit of torque.
    #[error(
        "[body] has a mass, and the torque is a current, a voltage or a duty cycle without the torque \
         per unit: give that as factor, or leave [body] out"
    )]
    NoTorque,
    /// A character that names and numbers have, too.
    #[error(
        "log.delimiter = {0:?}: it must be a character that no name and no number has, such as \",\", \";\", \
         \"\\t\" or \" \""
    )]
    Delimiter(char),
    /// Tables about the planes of a log that contradict each other.
    #[error("{key}: {expected}")]
    Planes {
        /// The key with its table.
        key: &'static str,
        /// What would be right.
        expected: &'static str,
    },
    /// A part of a drawing.
    #[error(
        "{key} is missing: [body] has either body_mass_kg alone, or all of a drawing (`ballbot \
         identify --example`)"
    )]
    IncompleteBody {
        /// The key with its table.
        key: &'static str,
    },
    /// A value out of range.
    #[error("{key} = {value}: it must be {expected}", value = number_text(*value))]
    Value {
        /// The key with its table.
        key: String,
        /// What was given.
        value: f64,
        /// What would be right.
        expected: Cow<'static, str>,
    },
}
