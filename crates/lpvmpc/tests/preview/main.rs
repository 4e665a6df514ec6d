//! What a controller may be told ahead: references, weights, bounds, rows, disturbances, scheduling and
//! models by stage, against problems that are written out anew here.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that cannot go on must fail, in its support functions too"
)]

mod case;
mod changes;
mod closed_loop;
mod dense;
mod linear;
mod nonlinear;
mod parts;
mod plants;
mod refused;
mod short_case;

#[allow(dead_code, reason = "the tests of the solver use more of it")]
#[path = "../it/support/rng.rs"]
mod rng;
