//! Estimator, delay line, ramped input, set points and smooth moves.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test that cannot go on must fail, in its support functions too"
)]

mod clock;
mod delay;
mod estimator;
mod gate;
mod late;
mod pendulum;
mod ramp;
mod regulator;
mod set_points;
mod shaping;

#[allow(dead_code, reason = "the tests of the solver use more of it")]
#[path = "../it/support/rng.rs"]
mod rng;
