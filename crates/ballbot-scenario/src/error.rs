//! What can be wrong with a scenario, said to a person.

use crate::builtin;
use crate::given::Given;
use ballbot::RegulatorError;
use std::fmt::Display;
use std::io;
use std::path::PathBuf;
use thiserror::Error;

/// A scenario that cannot be run.
#[derive(Debug, Error)]
pub enum ScenarioError {
    /// Neither a built-in scenario nor a file.
    #[error(
        "unknown scenario `{name}`: it is neither a built-in scenario ({}) nor a file{}",
        builtin.join(", "),
        nearest.map_or(String::new(), |nearest| format!("; did you mean `{nearest}`?"))
    )]
    Unknown {
        /// What was asked for.
        name: String,
        /// The built-in scenario with the most similar name.
        nearest: Option<&'static str>,
        /// All built-in scenarios.
        builtin: Vec<&'static str>,
    },
    /// A file cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The text is not TOML, or not a scenario: unknown key, wrong type, missing key.
    #[error("{origin} is not a valid scenario:\n{message}")]
    Syntax {
        /// File or name.
        origin: String,
        /// Line, column and what was expected.
        message: String,
    },
    /// A value that makes no sense.
    #[error("{key} = {value}: {expected}")]
    Value {
        /// The key, with the tables it stands in.
        key: String,
        /// What was given.
        value: String,
        /// What would be right.
        expected: String,
    },
    /// A file of parameters is not TOML, or has no such table.
    #[error("a file of parameters needs a table [parameters]:\n{0}")]
    ParameterFile(String),
    /// What is wrong in another file.
    #[error("{}: {source}", path.display())]
    InFile {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        source: Box<Self>,
    },
    /// A CSV file that makes no sense.
    #[error("file {}{}: {problem}", path.display(), line.map_or(String::new(), |line| format!(", line {line}")))]
    CsvFile {
        /// The file.
        path: PathBuf,
        /// The line, where the problem has one.
        line: Option<u64>,
        /// What is wrong, and what would be right.
        problem: String,
    },
    /// There is no LQR, from whose cost terminal cost and prices of bounds are computed.
    #[error("controller.q, controller.r and controller.t_s: no LQR: {0}")]
    Riccati(#[from] lpvmpc_design::RiccatiError),
    /// The sampling time is too long for the predictor.
    #[error("controller.t_s and controller.predictor: {0}")]
    PredictorStep(#[from] lpvmpc_design::Rk4StepError),
    /// The equations of motion have no solution at some tilt within the bounds.
    #[error("parameters: {0}")]
    Parameters(String),
    /// The simulated world refuses its settings.
    #[error("world: {0}")]
    World(#[from] lpvmpc_sim::WorldError),
    /// The estimator refuses its settings.
    #[error("controller.estimator: {0}")]
    Estimator(#[from] lpvmpc::EstimatorError),
    /// The controller refuses its settings.
    #[error("controller: {0}")]
    Controller(#[from] lpvmpc::ControllerError),
    /// The guaranteed controller refuses its settings.
    #[error("controller: {0}")]
    Guaranteed(#[from] lpvmpc::GuaranteedError),
}

impl From<RegulatorError> for ScenarioError {
    fn from(error: RegulatorError) -> Self {
        match error {
            RegulatorError::Estimator(error) => error.into(),
            RegulatorError::Controller(error) => error.into(),
            RegulatorError::Guaranteed(error) => error.into(),
        }
    }
}

impl ScenarioError {
    /// No built-in scenario has this name.
    pub fn unknown(name: &str) -> Self {
        Self::Unknown {
            name: name.to_owned(),
            nearest: builtin::nearest(name),
            builtin: builtin::ALL.iter().map(|builtin| builtin.name).collect(),
        }
    }

    /// A value that makes no sense, with what would be right.
    pub(crate) fn value(key: impl Display, value: impl Given, expected: impl Display) -> Self {
        Self::of(&key, value.given(), &expected)
    }

    /// Not generic: there are many such messages, and a browser has to load their code.
    fn of(key: &dyn Display, value: String, expected: &dyn Display) -> Self {
        Self::Value {
            key: key.to_string(),
            value,
            expected: expected.to_string(),
        }
    }
}
