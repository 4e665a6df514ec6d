//! Robustness of the solver: arbitrary numbers, planted mistakes, relations between answers that
//! hold exactly, and single precision.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot go on must fail, in its support functions too"
)]

mod nonsense;
mod numbers;
mod optimality;
mod planted;
mod relations;
mod single_precision;
mod support;
mod well_scaled;
