//! The native half of the Python package `lpvmpc`: plants, controllers and simulated worlds of any
//! size, and what the program `ballbot` does. What people call is in `lpvmpc/`, with its documentation; numbers arrive here with their
//! shapes checked for form only, and the libraries check what they mean.

mod arrays;
mod ballbot;
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
    #[pymodule_export]
    use super::ballbot::{
        Scenario, bench, campaign, certify, excite, identification_example, identify, reproduce,
        timed_scenarios, verify,
    };
    #[pymodule_export]
    use super::design::lqr;
    #[pymodule_export]
    use super::mpc::Mpc;
    #[pymodule_export]
    use super::plant::Plant;
    #[pymodule_export]
    use super::world::World;
}
