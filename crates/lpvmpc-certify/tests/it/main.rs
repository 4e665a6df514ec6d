//! Certificates of plants that are data: what is proved holds, and what does not is refused.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that cannot go on must fail, in its support functions too"
)]

mod ahead;
mod claims;
mod controller;
mod discrete;
mod forgeries;
mod functions;
mod plants;
