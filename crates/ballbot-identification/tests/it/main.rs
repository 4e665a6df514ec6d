//! Identification of simulated robots whose truth is known.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot go on must fail, in its support functions too"
)]

mod accuracy;
mod chain;
mod columns;
mod creep;
mod excite;
mod integration;
mod laboratory;
mod left_out;
mod long;
mod malformed;
mod planes;
mod stretches;
