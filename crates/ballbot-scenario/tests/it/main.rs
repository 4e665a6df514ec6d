//! Scenarios: what their files may say, what becomes of it, and how the closed loops end.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::unwrap_used,
    reason = "a test that cannot go on must fail, in its support functions too"
)]

mod document;
mod far_within_bounds;
mod forged_certificates;
mod guarantee;
mod guaranteed_optimum;
mod handover;
mod heading;
mod late_readings;
mod messages;
mod page_types;
mod paper_closed_loops;
mod plausible;
mod predictors;
mod real_robot;
mod robust;
mod rollout;
mod session;
mod stamps;
mod terminal_certificate;
mod weights;
mod words;
mod world_messages;
