//! What is wrong with a plant.

use thiserror::Error;

/// What is wrong with a plant, and where.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{place}: {fault}")]
pub struct PlantError {
    /// The part of the plant or of its file: `operation 17`, `states[2]`.
    pub place: String,
    /// What is wrong with it, and what would be right.
    pub fault: String,
}

impl PlantError {
    pub(crate) fn new(place: impl Into<String>, fault: impl Into<String>) -> Self {
        Self {
            place: place.into(),
            fault: fault.into(),
        }
    }
}
