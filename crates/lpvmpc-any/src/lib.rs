//! Predictive control of any plant: states, inputs and horizon are chosen at run time, and answers
//! speak the plant's own names.
//!
//! A [`Plant`](lpvmpc_plant::Plant) is formulas from a file. An [`Mpc`] is its controller, with up to
//! [`MOST_STATES`] states and [`MOST_INPUTS`] inputs. A pendulum stands up from 0.8 rad:
//!
//! ```
//! use lpvmpc_any::{Mpc, MpcSettings, Preview};
//! use lpvmpc_plant::Plant;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let plant = Plant::from_json(r#"{
//!     "schema": 1,
//!     "name": "pendulum",
//!     "states": [{"name": "angle", "unit": "rad"}, {"name": "rate", "unit": "rad/s"}],
//!     "inputs": [{"name": "torque", "unit": "N m", "lower": -8, "upper": 8}],
//!     "operations": [
//!         ["state", 0], ["state", 1], ["input", 0], ["constant", 9.81],
//!         ["sin", 0], ["mul", 3, 4], ["add", 5, 2]
//!     ],
//!     "derivative": [1, 6]
//! }"#)?;
//! let mut mpc = Mpc::new(&plant, &MpcSettings::new(0.05, 30, &[1.0, 1.0], &[0.1]))?;
//! let plan = mpc.step(&[0.8, 0.0], &Preview::default())?;
//! println!("{}: {:.2} N m now, {}", plan.status, plan.u[(0, 0)], plan.active_bounds());
//! assert!(plan.is_solved() && plan.u[(0, 0)] == -8.0);
//! # Ok(())
//! # }
//! ```
//!
//! | for | use |
//! |---|---|
//! | weights, bounds, prices, rows, horizon | [`MpcSettings`] |
//! | costs and bounds of outputs y = g(x, u): nonlinear costs and constraints | [`MpcSettings::q_y`], [`MpcSettings::y_bounds`] |
//! | costs and bounds of what the inputs change | [`MpcSettings::r_du`], [`MpcSettings::du_bounds`], [`Mpc::set_last_input`] |
//! | what is known ahead, stage by stage | [`Preview`]: references, weights, bounds, rows, disturbances, parameters, [matrices](StageMatrices), scheduling |
//! | readings, disturbances and a delay | [`EstimatorSettings`], [`Mpc::observe`], [`Mpc::decide`] |
//! | another value of a parameter, other settings | [`Mpc::set_parameter`], [`Mpc::set_settings`] |
//! | a guaranteed loop to an equilibrium | [`Terminal::Certified`] |
//! | a simulated plant with sensors, actuators, delay and pushes | [`World`] |
//! | where a plant can stand | [`steady_state`] |
//! | its derivatives, and the regulator of these | [`jacobian`], [`lqr`] |
//!
//! It is the controller of `lpvmpc`, compiled for a few sizes. A plant that is smaller than the
//! size that serves it leaves places over; what stands there stays zero, and nothing depends on it.
#![allow(
    clippy::neg_cmp_op_on_partial_ord,
    reason = "a comparison with NaN must take the failing branch"
)]

mod answers;
mod check;
mod controller_settings;
mod error;
mod estimator;
mod filter;
mod firmware;
mod guaranteed;
mod horizon;
mod last_input;
mod linear_model;
mod linearise;
mod model;
mod mpc;
mod plan;
mod preview;
mod sampling;
mod settings;
mod size;
mod sized;
mod stage_lists;
mod steady_state;
mod target;
mod tasks;
mod words;
mod world;

pub use controller_settings::AT_REST;
pub use error::MpcError;
pub use estimator::{Disturbance, Estimate, EstimatorSettings};
pub use firmware::{Demonstration, firmware};
pub use linearise::{jacobian, lqr};
pub use lpvmpc::{Decision, Gate, Iterations, Penalty, Reading, Verdict};
pub use lpvmpc_sim::{Actuator, Tolerances};
pub use model::USUAL_NODES;
pub use mpc::Mpc;
pub use plan::{ActiveBound, Plan, Target};
pub use preview::{Preview, StageMatrices};
pub use settings::{
    FIRST_PROGRAMS, Limits, LinearModels, MpcSettings, Row, StateBounds, Terminal, TerminalSet,
};
pub use size::{MOST_INPUTS, MOST_STATES};
pub use steady_state::{SteadyState, steady_state};
pub use world::{Push, Quantity, Sensor, World, WorldSettings};
