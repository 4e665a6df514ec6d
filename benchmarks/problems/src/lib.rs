//! Sequences of optimal control problems as files: a line of text that says the sizes, then the numbers
//! as little-endian `f64`. The format is described in `benchmarks/problems/README.md`.
//!
//! [`layout`] says where each number of a problem stands, [`header`] what the line says, [`file`] reads
//! and writes.

pub mod file;
pub mod header;
pub mod layout;

use thiserror::Error;

/// Why a problem file cannot be used.
#[derive(Debug, Error)]
pub enum ProblemError {
    /// The file cannot be read or written.
    #[error(transparent)]
    Io(#[from] std::io::Error),
    /// The first line is not one of this format.
    #[error("the header has no usable `{0}`")]
    Header(&'static str),
    /// A different number of numbers than the sizes ask for.
    #[error("{found} numbers, {wanted} are needed")]
    Length {
        /// How many there are.
        found: usize,
        /// How many there should be.
        wanted: usize,
    },
    /// A size that is not the wanted one.
    #[error("{what} is {found}; it must be {wanted}")]
    Size {
        /// Which size.
        what: &'static str,
        /// What it is.
        found: usize,
        /// What it must be.
        wanted: usize,
    },
    /// A problem that the format cannot say.
    #[error("the format has no {0}")]
    NotInFormat(&'static str),
}
