//! Controllers of any size.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test that cannot go on must fail, in its support functions too"
)]

mod agreement;
mod messages;
mod plants;
mod stages;
mod world;
