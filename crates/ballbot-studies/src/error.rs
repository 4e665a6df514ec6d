//! Why a study has no result.

use crate::{ModelError, RefinementError, RegulatorError};
use ballbot_scenario::ScenarioError;
use lpvmpc_sequences::SequenceError;
use lpvmpc_sim::PlantError;

/// Why a study has no result. Those of the paper have no input, and none of this should happen.
#[derive(Debug, thiserror::Error)]
pub enum StudyError {
    /// A scenario that cannot be run.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// The plant cannot be integrated.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// The parameters b.
    #[error(transparent)]
    Refinement(#[from] RefinementError),
    /// The regulator.
    #[error(transparent)]
    Regulator(#[from] RegulatorError),
    /// Models that cannot be compared.
    #[error(transparent)]
    Models(#[from] ModelError),
    /// Problems to be timed that cannot be made.
    #[error(transparent)]
    Sequence(#[from] SequenceError),
    /// A row of the reference costs lacks a number.
    #[error("the reference costs have no number in column `{column}` of the row {row}")]
    ReferenceCosts {
        /// The column.
        column: String,
        /// The row.
        row: String,
    },
    /// A scenario for a study that it does not suit.
    #[error("{0}")]
    Unsuitable(&'static str),
}
