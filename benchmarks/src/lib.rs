//! The solver of `lpvmpc` beside published solvers, on the same quadratic programs.
//!
//! [`closed_loop`] records sequences of problems, `lpvmpc-sequences` makes others, [`contenders`] solve
//! them, and [`comparison`] checks every answer before it takes the time.

pub mod closed_loop;
pub mod comparison;
pub mod contenders;
mod error;

pub use error::BenchmarkError;
