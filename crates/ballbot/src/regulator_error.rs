//! What can be wrong with a regulator.

use core::fmt;
use lpvmpc::{ControllerError, EstimatorError, GuaranteedError};

/// A regulator refuses its settings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RegulatorError {
    /// The estimator does.
    Estimator(EstimatorError),
    /// The controller does.
    Controller(ControllerError),
    /// The guaranteed controller does.
    Guaranteed(GuaranteedError),
}

impl fmt::Display for RegulatorError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Estimator(error) => write!(f, "estimator: {error}"),
            Self::Controller(error) => write!(f, "controller: {error}"),
            Self::Guaranteed(error) => write!(f, "guaranteed controller: {error}"),
        }
    }
}

impl core::error::Error for RegulatorError {}

impl From<EstimatorError> for RegulatorError {
    fn from(error: EstimatorError) -> Self {
        Self::Estimator(error)
    }
}

impl From<ControllerError> for RegulatorError {
    fn from(error: ControllerError) -> Self {
        Self::Controller(error)
    }
}

impl From<GuaranteedError> for RegulatorError {
    fn from(error: GuaranteedError) -> Self {
        Self::Guaranteed(error)
    }
}
