//! Model predictive control for linear parameter-varying (LPV) models.
#![no_std]
#![allow(
    clippy::neg_cmp_op_on_partial_ord,
    reason = "a comparison with a number that is not one must take the failing branch"
)]

#[cfg(feature = "alloc")]
extern crate alloc;

mod active_set;
mod adjoint;
mod clock;
mod controller;
mod delay;
mod descent;
mod estimator;
mod farkas;
mod first_plan;
mod guarded;
mod held_inputs;
mod kernel;
mod kkt;
mod last_plan;
mod list;
mod memory;
mod model;
mod ocp;
mod plan;
mod policy;
mod predictor;
mod ramp;
mod regulator;
pub mod riccati;
mod rows;
mod settings;
mod settle;
mod shaping;
mod solution;
mod solver;
mod steady_state;
mod working_set;
mod workspace;

pub use clock::{Clock, Tick};
pub use controller::{Controller, Reference};
pub use delay::DelayLine;
pub use estimator::{
    Covariance, Estimator, EstimatorArrays, EstimatorError, EstimatorMemory, EstimatorSettings,
    Gate, Observation, Reading, Restart, Verdict,
};
pub use farkas::infeasibility_margin;
pub use guarded::{
    Decision, GuardedArrays, GuardedController, GuardedError, GuardedIterations, GuardedMemory,
    GuardedSettings, GuardedStep, GuardedWorkspace, GuardedWorkspaceArrays, GuardedWorkspaceMemory,
    Rollout, SetPoints, TerminalSet, share_of_bounds,
};
pub use kkt::{KktResidual, kkt_residual};
pub use list::List;
pub use memory::{
    Capacity, ControllerArrays, ControllerMemory, SolverArrays, SolverMemory, WorkspaceArrays,
    WorkspaceMemory,
};
pub use model::{LpvModel, Scalar};
pub use ocp::{Bounds, Common, GeneralRow, Ocp, Penalty, Softness, Stage, Terminal};
pub use predictor::{Predictor, Rk4};
pub use ramp::RampedInput;
pub use regulator::{
    AnyPlanner, Belief, Command, FeedbackArrays, FeedbackMemory, FeedbackSettings, Guard, Guarded,
    GuardedPlannerMemory, Held, MeasuredState, Measurement, OutputFeedback, Planned, Planner,
    Ramped, Regulator, Standalone,
};
#[cfg(feature = "alloc")]
pub use regulator::{GuardedFeedback, StateFeedback};
pub use settings::{
    ControllerError, ControllerSettings, InputReference, Iterations, Scheduling,
    TerminalIngredient, Weights, exact_prices,
};
pub use shaping::{Motion, MoveLimits, SmoothMove};
pub use solution::{
    ActiveRow, ActiveSet, BoundId, PackedRow, Part, Quantity, Side, Solution, Status,
};
pub use solver::{Solver, SolverSettings, WarmStart, cost};
pub use steady_state::{SteadyState, SteadyStateProblem};
pub use workspace::Workspace;
