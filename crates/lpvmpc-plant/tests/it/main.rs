//! Plants from files are the plants that they say, and nothing else is one.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot go on must fail, in its support functions too"
)]

mod about;
mod derivatives;
mod firmware;
mod hostile;
mod printed;
mod ray;
mod recording;
mod reference;
mod refused;
mod round_trip;
mod sized;
