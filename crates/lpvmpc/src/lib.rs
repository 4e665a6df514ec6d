//! Model predictive control for plants whose linear model changes as they move: linear
//! parameter-varying (LPV) models x_dot = A(s) x + B(s) u + c(s) with s = sigma(x, u). No std, no heap but with
//! the feature `alloc`, bounded work, in `f32` or `f64`.
//!
//! A pendulum with a torque at its joint stands up from 0.8 rad:
//!
//! ```
//! use lpvmpc::*;
//! use nalgebra::{Matrix1, Matrix2, Vector1, Vector2};
//!
//! struct Pendulum; // x = (angle from upright [rad], rate [rad/s]), u = torque [N m]
//! impl Dynamics<2, 1> for Pendulum {
//!     fn f<N: Number>(&self, x: &Vector2<N>, u: &Vector1<N>) -> Vector2<N> {
//!         Vector2::new(x[1], N::constant(9.81) * x[0].sin() + u[0])
//!     }
//! }
//! # fn main() -> Result<(), ControllerError> {
//! let weights = Weights { q: Matrix2::identity(), r: Matrix1::new(0.1) };
//! // Beyond the horizon of 30 samples of 0.05 s it costs what the regulator of the upright costs.
//! let terminal = TerminalIngredient::Cost(Matrix2::new(147.006, 40.381, 40.381, 14.758));
//! let torque = Bounds { lower: Vector1::new(-8.0), upper: Vector1::new(8.0) };
//! let settings = ControllerSettings::new(0.05, 30, weights, terminal, torque);
//! let mut controller = Controller::allocate(AlongMotion::<_, 3>(Pendulum), settings)?;
//! let mut workspace = controller.workspace();
//! let mut x = Vector2::new(0.8, 0.0);
//! for _ in 0..100 {
//!     let upright = Reference::constant(Vector2::zeros());
//!     let u = controller.step(&x, &upright, &mut workspace).first_input();
//!     x = Rk4 { substeps: 1 }.advance(controller.model(), &x, &u, 0.05);
//! }
//! println!("after 5 s: {:.4} rad, {:.4} rad/s", x[0], x[1]);
//! assert!(x.amax() < 0.01);
//! # Ok(())
//! # }
//! ```
//!
//! | for | use |
//! |---|---|
//! | a plant | [`Dynamics`] (f alone), [`Embedding`] (A(s), B(s)), [`LpvModel`] (what is not formulas) |
//! | linear models of f alone | [`AlongMotion`] (its derivatives), [`AlongRay`] (their mean from a steady state on) |
//! | a controller, on the heap or in lent memory | [`Controller`], [`ControllerSettings`], [`ControllerArrays`] |
//! | weights, bounds, rows, outputs, disturbances, scheduling or models that are known ahead | [`Preview`], [`Outputs`], [`Controller::step_with`], [`OutputFeedback::decide_with`] |
//! | what changes while it runs | [`Controller::set_settings`], [`Controller::set_rows`], [`Controller::set_model`] |
//! | one with a guarantee | [`GuaranteedController`] |
//! | all that stands between sensors and actuators | [`OutputFeedback`], [`Regulator`], [`Estimator`] |
//! | a linear-quadratic program with stages by itself | [`Ocp`], [`Solver`], [`kkt_residual`] |
//!
//! A larger plant is in the example `cart_pole` (`cargo run --release -p lpvmpc --example cart_pole`):
//! a cart with a pole on a track with ends. Gains and terminal costs are designed with
//! `lpvmpc-design`, worlds to try a controller in are in `lpvmpc-sim`.
#![no_std]
#![allow(
    clippy::neg_cmp_op_on_partial_ord,
    reason = "a comparison with NaN must take the failing branch"
)]

#[cfg(feature = "alloc")]
extern crate alloc;

mod active_set;
mod adjoint;
mod at_stage;
mod by_stage;
mod changes;
mod clock;
mod controller;
mod cost;
mod delay;
mod descent;
#[cfg(all(feature = "alloc", not(target_arch = "wasm32")))]
mod elsewhere;
mod embedding;
mod estimator;
mod farkas;
mod first_plan;
mod from_dynamics;
mod guaranteed;
mod hard_bounds;
mod held_bounds;
mod kkt;
mod last_bounds;
mod last_plan;
mod line_search;
mod linearization;
mod list;
mod many_bounds;
mod memory;
mod model;
mod number;
mod ocp;
mod outputs;
mod plan;
mod policy;
mod prediction;
mod predictor;
mod preview;
mod products;

mod ramp;
mod regulator;
mod retries;
pub mod riccati;
mod rows;
mod settings;
mod shaping;
mod small_matrix;
mod soft_bounds;
mod solution;
mod solve_working_set;
mod solver;
mod solver_settings;
mod steady_state;
mod step_with;
mod tracking;
mod transposed;
mod two_parts;
mod working_set;
mod workspace;

pub use clock::{Clock, Tick};
pub use controller::{Controller, Reference};
pub use cost::cost;
pub use delay::DelayLine;
pub use embedding::{Dynamics, Embedding, Tangent, tangent_by_duals};
pub use estimator::{
    Covariance, Estimator, EstimatorArrays, EstimatorError, EstimatorMemory, EstimatorSettings,
    Gate, Observation, Reading, Restart, Verdict,
};
pub use farkas::infeasibility_margin;
pub use from_dynamics::{AlongMotion, AlongRay, GaussLegendre};
pub use guaranteed::{
    Decision, GuaranteedArrays, GuaranteedController, GuaranteedError, GuaranteedIterations,
    GuaranteedMemory, GuaranteedSettings, GuaranteedStep, GuaranteedWorkspace,
    GuaranteedWorkspaceArrays, GuaranteedWorkspaceMemory, NEAR_SAMPLES, Rollout, SetPoints,
    TerminalSet, share_of_bounds,
};
pub use kkt::{KktResidual, kkt_residual};
pub use list::List;
pub use many_bounds::ManyBoundsArrays;
pub use memory::{
    Capacity, ControllerArrays, ControllerMemory, SolverArrays, SolverMemory, WorkspaceArrays,
    WorkspaceMemory,
};
pub use model::{LpvModel, Scalar};
pub use number::{Bivariate, Dual, Elementary, Number, SincSlope};
pub use ocp::{Bounds, Common, GeneralRow, Ocp, Penalty, SoftBounds, Stage, Terminal};
pub use outputs::{OutputGoal, Outputs, VisitTangent};
pub use predictor::{Predictor, Rk4};
pub use preview::{Preview, PreviewError, PreviewMistake, PreviewPart};
pub use ramp::RampedInput;
pub use regulator::{
    AnyPlanner, Belief, Command, FeedbackArrays, FeedbackMemory, FeedbackSettings, Guarantee,
    Guaranteed, GuaranteedPlannerMemory, Held, MeasuredState, Measurement, OutputFeedback, Planned,
    Planner, Ramped, Regulator, Standalone,
};
#[cfg(feature = "alloc")]
pub use regulator::{GuaranteedFeedback, StateFeedback};
pub use settings::{
    ControllerError, ControllerSettings, InputReference, Iterations, Scheduling,
    TerminalIngredient, Weights,
};
pub use shaping::{Motion, MoveLimits, SmoothMove};
pub use soft_bounds::exact_prices;
pub use solution::{
    ActiveRow, ActiveSet, BoundId, PackedRow, Part, Quantity, Side, Solution, Status,
};
pub use solver::Solver;
pub use solver_settings::{SolverSettings, WarmStart};
pub use steady_state::{SteadyState, SteadyStateProblem};
pub use workspace::Workspace;

/// The code of docs/preview.md.
#[cfg(doctest)]
#[doc = include_str!("../../../docs/preview.md")]
struct WhatASampleMayBeTold;
