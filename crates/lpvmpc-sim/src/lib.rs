//! Simulated plants and closed loops: what a controller of [`lpvmpc`] meets before it meets a
//! robot. No files, no clock of its own, no randomness but from a seed.
//!
//! [`advance`] moves a plant under a held input. A [`World`] puts sensors, actuators, a delay
//! and pushes around it. A [`ClosedLoop`] is a world with a [`Regulator`](lpvmpc::Regulator) in it, and [`run`]
//! records one from beginning to end.
//!
//! ```
//! use lpvmpc::LpvModel;
//! use lpvmpc_sim::{Tolerances, Unloaded, World};
//! use nalgebra::{Matrix2, Vector1, Vector2};
//!
//! /// x = (position [m], speed [m/s]), u = force per mass [m/s^2].
//! struct Cart;
//! impl LpvModel<f64, 2, 1, 1> for Cart {
//!     fn scheduling(&self, _: &Vector2<f64>, _: &Vector1<f64>) -> Vector1<f64> {
//!         Vector1::zeros()
//!     }
//!     fn matrices(&self, _: &Vector1<f64>) -> (Matrix2<f64>, Vector2<f64>) {
//!         (Matrix2::new(0.0, 1.0, 0.0, 0.0), Vector2::new(0.0, 1.0))
//!     }
//! }
//! # fn main() -> Result<(), lpvmpc_sim::PlantError> {
//! let tolerances = Tolerances { relative: 1e-10, absolute: 1e-10 };
//! let start = Vector2::new(1.0, 0.0);
//! let mut world = World::ideal(Unloaded::<_, 1>(&Cart), start, 0.01, tolerances);
//! for _ in 0..500 {
//!     let [position, speed] = world.measurement().readings.map(|r| r.map_or(0.0, |r| r.value));
//!     world.command([-4.0 * position - 4.0 * speed].into());
//!     world.advance()?;
//! }
//! println!("after {} s at {:.4} m", world.time(), world.state()[0]);
//! assert!(world.state()[0].abs() < 0.01);
//! # Ok(())
//! # }
//! ```
#![allow(
    clippy::neg_cmp_op_on_partial_ord,
    reason = "a comparison with NaN must take the failing branch"
)]

mod actuator;
pub mod closed_loop;
mod disturbance;
mod guaranteed_loop;
pub mod plant;
mod random;
mod sensor;
mod world;

pub use actuator::Actuator;
pub use closed_loop::{
    ClosedLoop, Experiment, LogRow, OnInfeasible, Recording, RunConfig, Sample, Termination,
    Trajectory, record, run,
};
pub use disturbance::Disturbance;
pub use guaranteed_loop::{Actuation, GuaranteedLoop};
pub use plant::{Plant, PlantError, Tolerances, Unloaded, advance};
pub use random::Random;
pub use sensor::Sensor;
pub use world::{World, WorldError, WorldPart, WorldSettings};
