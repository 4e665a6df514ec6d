//! Why there is no certificate, or why one is refused.

use lpvmpc_certificate::{ClaimError, DocumentError, SynthesisError};
use lpvmpc_plant::PlantError;
use std::fmt::Display;
use thiserror::Error;

/// Why there is no certificate, or why one is refused.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum CertifyError {
    /// A setting, or a part of a certificate, that makes no sense.
    #[error("{place}: {fault}")]
    Setting {
        /// Its name.
        place: String,
        /// What is wrong, and what would be right.
        fault: String,
    },
    /// The plant has no proof.
    #[error("the plant: {0}")]
    Plant(#[from] PlantError),
    /// It is no equilibrium, for certain.
    #[error(
        "equilibrium: it is none: within the claimed distance of it, {state} never stands still"
    )]
    NoEquilibrium {
        /// The state.
        state: String,
    },
    /// That there is an equilibrium nearby was not shown.
    #[error("equilibrium: that the plant stands still {within} of it could not be shown; {hint}")]
    EquilibriumNotShown {
        /// Where.
        within: &'static str,
        /// What may help.
        hint: &'static str,
    },
    /// No law and cost were found.
    #[error("no terminal law was found: {0}")]
    Design(#[from] SynthesisError),
    /// A claim that is false, or that could not be shown.
    #[error(transparent)]
    Claim(#[from] ClaimError),
    /// No certificate, or one that was changed.
    #[error(transparent)]
    Document(#[from] DocumentError),
    /// A certificate of another plant.
    #[error(
        "the certificate is of another plant: of {name:?} with the SHA-256 {claimed}; this one has {found}, with its \
         parameters as they are now"
    )]
    AnotherPlant {
        /// The name in the certificate.
        name: String,
        /// The hash in the certificate.
        claimed: String,
        /// That of the plant.
        found: String,
    },
}

impl CertifyError {
    pub(crate) fn setting(place: impl Display, fault: impl Display) -> Self {
        Self::Setting {
            place: place.to_string(),
            fault: fault.to_string(),
        }
    }

    /// Whether something was claimed that is false: otherwise it is malformed, of another plant, or could not be
    /// shown, and may be true.
    pub fn is_false(&self) -> bool {
        match self {
            Self::NoEquilibrium { .. } => true,
            Self::Claim(claim) => claim.is_false(),
            _ => false,
        }
    }
}
