//! The ballbot: scenarios, identification, certificates, studies, as the program `ballbot` has them.

mod certificate;
mod identification;
mod run;
mod scenario;
mod studies;
mod values;

pub use certificate::{certify, verify};
pub use identification::{excite, identification_example, identify};
pub use scenario::Scenario;
pub use studies::{bench, campaign, reproduce, timed_scenarios};
