//! Why a campaign has no result.

use ballbot_scenario::ScenarioError;
use parquet::errors::ParquetError;
use std::io;
use std::path::{Path, PathBuf};

/// Why a campaign has no result. The message says what is wrong, where, and what would be right.
#[derive(Debug, thiserror::Error)]
pub enum CampaignError {
    /// A file cannot be read or written.
    #[error("{}: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What the file system said.
        source: io::Error,
    },
    /// Not TOML, an unknown or missing key, or a value of the wrong type.
    #[error("{} is not a valid campaign:\n{message}", path.display())]
    Syntax {
        /// The campaign.
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
    /// The scenario.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// A drawn scenario is none.
    #[error(
        "run {run} draws {drawn}, and that is no scenario: {source}\nnarrow the distribution (a \
         normal one takes lower and upper), or have such runs counted apart (refused = \"count\"), if \
         there are others"
    )]
    Refused {
        /// Number of the run.
        run: u64,
        /// What it draws.
        drawn: String,
        /// What the scenario says.
        source: ScenarioError,
    },
    /// A file of results.
    #[error("{}: {problem}", path.display())]
    Results {
        /// The file.
        path: PathBuf,
        /// What is wrong, and what to do.
        problem: String,
    },
    /// Shards that do not make a whole.
    #[error("{0}")]
    Shards(String),
    /// The threads.
    #[error("cannot start the threads: {0}")]
    Threads(#[from] rayon::ThreadPoolBuildError),
}

impl CampaignError {
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

    /// For `map_err`, with the path.
    pub(crate) fn at(path: &Path) -> impl Fn(io::Error) -> Self {
        move |source| Self::File {
            path: path.to_owned(),
            source,
        }
    }

    /// A file of results that cannot be what it should be.
    pub(crate) fn results(path: &Path, problem: impl Into<String>) -> Self {
        Self::Results {
            path: path.to_owned(),
            problem: problem.into(),
        }
    }

    /// For `map_err`, with the path of a file of results that cannot be written.
    pub(crate) fn unwritable(path: &Path) -> impl Fn(ParquetError) -> Self {
        move |error| Self::results(path, format!("it cannot be written: {error}"))
    }

    /// For `map_err`, with the path of a file of results that cannot be read.
    pub(crate) fn unreadable(path: &Path) -> impl Fn(ParquetError) -> Self {
        move |error| {
            Self::results(
                path,
                format!("it is cut off or no file of results ({error}); remove it and run again"),
            )
        }
    }
}
