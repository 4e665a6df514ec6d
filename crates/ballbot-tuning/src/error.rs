//! Why a tuning has no result.

use ballbot_campaign::CampaignError;
use ballbot_scenario::ScenarioError;
use std::path::PathBuf;

/// Why a tuning has no result. The message says what is wrong, where, and what would be right.
#[derive(Debug, thiserror::Error)]
pub enum TuningError {
    /// The file cannot be read.
    #[error("{}: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What the file system said.
        source: std::io::Error,
    },
    /// Not TOML, an unknown or missing key, or a value of the wrong type.
    #[error("{} is not a valid tuning:\n{message}", path.display())]
    Syntax {
        /// The tuning.
        path: PathBuf,
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
    /// A table of ranges or worlds, or a run.
    #[error(transparent)]
    Campaign(#[from] CampaignError),
    /// The scenario.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// The journal is of another tuning, or was changed.
    #[error(
        "the journal, line {line}: {problem}; move it away, or choose another folder with --out"
    )]
    Journal {
        /// The line, from 1.
        line: usize,
        /// What is wrong.
        problem: String,
    },
    /// A world does not take the start or the result.
    #[error(
        "world {world} ({drawn}) takes no such scenario: {problem}; narrow what varies in [worlds]"
    )]
    Refused {
        /// Its number.
        world: u64,
        /// What it draws.
        drawn: String,
        /// What the scenario says.
        problem: String,
    },
    /// Closed loops for other processes, or what these made of them.
    #[error("{0}")]
    Batch(String),
    /// No candidate keeps all limits.
    #[error(
        "no candidate keeps all limits, of {evaluations}; the closest one, {number}, has {closest}"
    )]
    Nothing {
        /// How many were tried.
        evaluations: usize,
        /// The closest one.
        number: usize,
        /// Its goals and limits.
        closest: String,
    },
}

impl TuningError {
    /// A value that makes no sense, with what would be right.
    pub(crate) fn value(
        key: impl Into<String>,
        value: impl Into<String>,
        expected: impl Into<String>,
    ) -> Self {
        Self::Value {
            key: key.into(),
            value: value.into(),
            expected: expected.into(),
        }
    }

    /// What a campaign says of its keys, which stand in a table of the tuning.
    pub(crate) fn within(table: &str, error: CampaignError) -> Self {
        match error {
            CampaignError::Value {
                key,
                value,
                expected,
            } => Self::value(format!("{table}.{key}"), value, expected),
            other => other.into(),
        }
    }
}
