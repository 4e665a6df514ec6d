//! Controllers of any size.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test that cannot go on must fail, in its support functions too"
)]

mod agreement;
mod discrete;
mod messages;
mod plants;
mod quadratic;
mod stages;
