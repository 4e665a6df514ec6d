//! The solver against its optimality conditions, other solvers and exact relations.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::unwrap_used,
    reason = "a test that cannot go on must fail, in its support functions too"
)]

mod support;

mod campaign;
mod changes;
mod fuzz;
mod memory;
mod optimality;
mod regressions;
mod relations;
mod single_precision;
mod verdicts;
