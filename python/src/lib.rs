//! The native half of the Python package `lpvmpc`: plants, controllers and simulated worlds of any
//! size, and what the program `ballbot` does. What people call is in `lpvmpc/`, with its documentation;
//! numbers arrive here with their shapes checked for form only, and the libraries check what they mean.

mod arrays;
mod ballbot;
mod certify;
mod design;
mod errors;
mod mpc;
mod plan;
mod plant;
mod work;
mod world;

use pyo3::prelude::*;

#[pymodule]
mod _lpvmpc {
    /// Most bytes of a file that is read as a whole.
    #[pymodule_export]
    const MOST_BYTES: u64 = ballbot_scenario::words::MOST_BYTES;
    #[pymodule_export]
    use super::ballbot::{
        Scenario, bench, campaign_example, certify_scenario, count_guarantee, excite,
        identification_example, identify, read_certificate, reproduce, run_campaign,
        timed_scenarios, verify_certificate,
    };
    #[pymodule_export]
    use super::certify::{certify, check_certificate, verify};
    #[pymodule_export]
    use super::design::lqr;
    #[pymodule_export]
    use super::mpc::Mpc;
    #[pymodule_export]
    use super::plant::Plant;
    #[pymodule_export]
    use super::world::World;
}
