//! Controllers of any size.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test that cannot go on must fail, in its support functions too"
)]

mod agreement;
mod changes;
mod discrete;
mod estimation;
mod matrices;
mod messages;
mod outputs;
mod plants;
mod quadratic;
mod stages;
mod valleys;
mod world;
