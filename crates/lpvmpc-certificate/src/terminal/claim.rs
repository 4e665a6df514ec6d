//! What can be wrong with the claims of a certificate.

use lpvmpc_design::number_text;
use thiserror::Error;

/// A claim that is false, or that could not be shown. The two are told apart: see
/// [`Self::is_false`].
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ClaimError {
    /// The plant is not A(s) x + B(s) u alone.
    #[error(
        "the plant has an affine term c(s): a terminal set can be certified for x_dot = A(s) x + B(s) u \
         only, with the equilibrium at x = 0, u = 0"
    )]
    AffineTerm,
    /// The plant is sampled itself, and has no quadratic stability in continuous time.
    #[error(
        "continuous: the plant is in discrete time, and quadratic stability is claimed in continuous time"
    )]
    DiscreteTime,
    /// The plant is sampled itself, with another period.
    #[error("t_s = {t_s}: the plant is in discrete time with a period of {period} s")]
    Period {
        /// The certificate's sampling time, s.
        t_s: f64,
        /// The plant's, s.
        period: f64,
    },
    /// A number that cannot be.
    #[error("{name} = {value}: it must be {expected}", value = number_text(*value))]
    Value {
        /// The key in the file.
        name: String,
        /// Its value.
        value: f64,
        /// What would be right.
        expected: &'static str,
    },
    /// A matrix whose mirrored entries differ.
    #[error(
        "{name} is not symmetric: {name}[{row}][{column}] is {value} but \
         {name}[{column}][{row}] is {mirrored}"
    )]
    NotSymmetric {
        /// The key in the file.
        name: &'static str,
        /// Row, counted from 0.
        row: usize,
        /// Column, counted from 0.
        column: usize,
        /// The entry.
        value: f64,
        /// The entry mirrored at the diagonal.
        mirrored: f64,
    },
    /// A matrix that is not positive definite, or too close to singular to tell.
    #[error("{name} could not be shown to be positive definite")]
    NotPositive {
        /// The key in the file.
        name: &'static str,
    },
    /// A matrix that is not positive semidefinite, or too close to tell.
    #[error(
        "{name} could not be shown to be positive semidefinite; if it is singular, add a tiny \
         multiple of the identity"
    )]
    NotSemidefinite {
        /// The key in the file.
        name: &'static str,
    },
    /// The set is larger than a limit.
    #[error(
        "{name} = {limit}: the set reaches {reach:.9}, as at its state {state:?}",
        limit = number_text(*limit)
    )]
    Limit {
        /// Key and component of the limit.
        name: String,
        /// The largest value in the set, at most.
        reach: f64,
        /// The limit.
        limit: f64,
        /// A state of the set that is beyond it.
        state: Vec<f64>,
    },
    /// The set was not shown to keep a limit.
    #[error(
        "{name} = {limit} could not be shown: all that is known is that nothing in the set \
         exceeds {reach:.9}", limit = number_text(*limit))]
    LimitNotShown {
        /// Key and component of the limit.
        name: String,
        /// What was shown.
        reach: f64,
        /// The limit.
        limit: f64,
    },
    /// The decrease is false.
    #[error(
        "terminal: the claimed decrease of x'Px is false with this K, P, contraction and plant: \
         from the state {state:?} of the set, x'Px is a sample later above what is claimed by \
         {excess:.1e} of itself, rounding accounted for"
    )]
    NoDecrease {
        /// The state, whose motion was enclosed.
        state: Vec<f64>,
        /// By so much of x'Px, at least.
        excess: f64,
    },
    /// The decrease was neither proved nor refuted.
    #[error(
        "terminal: the claimed decrease of x'Px could not be shown: the proof ended near the state \
         {state:?} after {boxes} boxes. It may hold all the same; a smaller set or more \
         contraction in the design may help"
    )]
    DecreaseNotShown {
        /// A state nearby.
        state: Vec<f64>,
        /// Boxes that were looked at.
        boxes: usize,
    },
    /// Quadratic stability is false.
    #[error(
        "continuous: (A - BK)'P + P(A - BK) <= -2 rate P is false at the scheduling {scheduling:?}"
    )]
    NotQuadraticallyStable {
        /// The scheduling.
        scheduling: Vec<f64>,
    },
    /// Quadratic stability was neither proved nor refuted.
    #[error(
        "continuous: (A - BK)'P + P(A - BK) <= -2 rate P could not be shown near the scheduling \
         {scheduling:?}"
    )]
    QuadraticStabilityNotShown {
        /// The scheduling.
        scheduling: Vec<f64>,
    },
}

impl ClaimError {
    /// Whether a claim is known to be false, by a state or a scheduling at which its violation is
    /// verified with rounding accounted for, or by a number that cannot be. Otherwise it could not
    /// be shown, and may be true.
    pub fn is_false(&self) -> bool {
        match self {
            Self::Value { .. }
            | Self::NotSymmetric { .. }
            | Self::Limit { .. }
            | Self::NoDecrease { .. }
            | Self::NotQuadraticallyStable { .. } => true,
            Self::NotPositive { .. }
            | Self::NotSemidefinite { .. }
            | Self::LimitNotShown { .. }
            | Self::AffineTerm
            | Self::DiscreteTime
            | Self::Period { .. }
            | Self::DecreaseNotShown { .. }
            | Self::QuadraticStabilityNotShown { .. } => false,
        }
    }

    /// What this makes of the certificate: it "is false" or "is not proved".
    pub fn verdict(&self) -> &'static str {
        if self.is_false() {
            "is false"
        } else {
            "is not proved"
        }
    }
}
