//! The ballbot: scenarios, identification, certificates, campaigns and studies, as the program `ballbot`
//! has them.

mod campaign;
mod certificate;
mod identification;
mod run;
mod scenario;
mod studies;
mod values;

pub use campaign::{campaign_example, run_campaign};
pub use certificate::{certify_scenario, read_certificate, verify_certificate};
pub use identification::{excite, identification_example, identify};
pub use scenario::Scenario;
pub use studies::{bench, count_guarantee, reproduce, timed_scenarios};
