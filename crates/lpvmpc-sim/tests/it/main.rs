//! The simulated world and the loops closed around it.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::unwrap_used,
    reason = "a test that cannot go on must fail, in its support functions too"
)]

mod closed_loop;
mod guaranteed_loop;
mod plant;
mod tight_bounds;
mod world;
