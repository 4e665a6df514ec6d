//! What is wrong with a controller's settings or with what a step is told.

use lpvmpc_plant::PlantError;
use thiserror::Error;

/// What is wrong, and where.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{place}: {fault}")]
pub struct MpcError {
    /// The setting, or the part of a preview: "q", "x_ref, stage 3".
    pub place: String,
    /// What is wrong with it, and what would be right.
    pub fault: String,
}

impl MpcError {
    pub(crate) fn new(place: impl Into<String>, fault: impl Into<String>) -> Self {
        Self {
            place: place.into(),
            fault: fault.into(),
        }
    }
}

impl From<PlantError> for MpcError {
    fn from(PlantError { place, fault }: PlantError) -> Self {
        Self { place, fault }
    }
}
