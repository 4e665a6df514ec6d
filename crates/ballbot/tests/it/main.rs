//! The ballbot's model against the equations of motion, mechanics and the paper's numbers.
#![allow(
    clippy::expect_used,
    clippy::panic,
    reason = "a test that cannot go on must fail, in its support functions too"
)]

mod consistency;
mod disturbed;
mod dynamics;
mod embedding;
mod equations;
mod friction;
mod linear;
mod robots;
mod sensitivity;
mod single_precision;
mod wheels;
