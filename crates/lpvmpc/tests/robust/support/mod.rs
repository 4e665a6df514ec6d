//! Shared with the other tests of this crate.

#[path = "../../it/support/rng.rs"]
pub mod rng;
