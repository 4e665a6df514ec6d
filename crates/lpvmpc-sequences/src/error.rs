//! Why there is no sequence.

use thiserror::Error;

/// Why there is no sequence for a recipe.
#[derive(Debug, Error)]
pub enum SequenceError {
    /// A recipe that makes no sense.
    #[error("{what} is {value}; it must be {right}")]
    Recipe {
        /// The part of it.
        what: &'static str,
        /// What it is.
        value: String,
        /// What would be right.
        right: &'static str,
    },
    /// No bounds of this kind lead to the share.
    #[error("a share of {wanted} active bounds is not reached: the nearest is {nearest:.3}")]
    Share {
        /// What was asked for.
        wanted: f64,
        /// The nearest that was found.
        nearest: f64,
    },
    /// The solver leaves a problem unsolved.
    #[error("problem {sample} is not solved: {status}")]
    NotSolved {
        /// Number in the sequence, from 0.
        sample: usize,
        /// The status in words.
        status: String,
    },
}
