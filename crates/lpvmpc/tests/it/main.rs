//! What the method promises, from its parts to the regulator made of them.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::unwrap_used,
    reason = "a test that cannot go on must fail, in its support functions too"
)]

mod estimation;
mod method;
mod pendulum;
mod preview;
mod solver;
