//! What the tests and benchmarks share. No crate needs it but to test or to compare.
//!
//! - [`rng`]: reproducible random numbers
//! - [`problems`]: random optimal control problems by family
//! - [`dense`]: an [`lpvmpc::Ocp`] condensed to its inputs
//! - [`sparse`]: the same in inputs and states
//! - `clarabel` (feature): the sparse form solved by an interior-point method

#[cfg(feature = "clarabel")]
pub mod clarabel;
pub mod dense;
pub mod problems;
pub mod rng;
pub mod sparse;
