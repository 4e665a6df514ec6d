//! Ballbot experiments as TOML files: parameters, controller, bounds, reference, simulated
//! plant, and the run itself.
//!
//! ```
//! use ballbot_scenario::{RunHooks, Scenario};
//! use std::path::Path;
//!
//! # fn main() -> Result<(), ballbot_scenario::ScenarioError> {
//! let mut scenario = Scenario::load("single-setpoint")?;
//! scenario.controller.horizon = 30;
//! let prepared = scenario.prepare(Path::new("."))?;
//! let trajectories = prepared.run(&RunHooks::NONE)?;
//! let end = trajectories[0].final_state;
//! println!("phi = {:.3} rad after {} s", end[0], trajectories[0].final_time);
//! assert!((end[0] - std::f64::consts::PI).abs() < 0.05, "phi has reached pi: {end}");
//! # Ok(())
//! # }
//! ```
#![allow(
    clippy::neg_cmp_op_on_partial_ord,
    reason = "a comparison with NaN must take the failing branch"
)]

pub mod builtin;
mod error;
mod file;
mod given;
pub mod number;
mod prepare;
mod run;
pub mod words;

pub use error::ScenarioError;
pub use file::certificate::{RobotTable, TerminalCertificate, ViscousBallbot};
pub use file::document::Document;
pub use file::feedback_table::{
    DisturbancesTable, EstimatorTable, MotorsTable, ShapingTable, TorqueRateTable,
};
pub use file::heading_table::HeadingTable;
pub use file::parameters::{ParameterTable, Parameters};
pub use file::schema::{
    BoundsTable, CertifiedTable, ControllerTable, CsvTable, IntegrationTable, IterationsTable,
    LinearModelTable, LissajousTable, ModelKind, PointTable, PredictorTable, ReferenceTable,
    Scenario, SineTable, StateBounds, StateTable, TerminalTable,
};
pub use file::world_table::{
    ActuatorTable, AngleSensorTable, DelayTable, DeviationsTable, FloorTable, PlaneName, PushTable,
    RateSensorTable, SensorsTable, WithoutPlan, WorldTable,
};
pub use prepare::excitation::Excitation;
pub use prepare::files::Files;
pub use prepare::heading::Turning;
pub use prepare::known_robot::KnownRobot;
pub use prepare::parameters::read_robot;
pub use prepare::plausible;
pub use prepare::prepared::{Plane, Prepared, Problem};
pub use prepare::proofs;
pub use prepare::reference::PhiReference;
pub use prepare::rollout;
pub use prepare::standing::Standing;
pub use prepare::three_motors::ThreeMotors;
pub use prepare::uncertainty::{RobotDistribution, Uncertainty};
pub use prepare::weights::bryson;
pub use prepare::world::{PlaneWorld, Robot};
pub use run::excited::Excited;
pub use run::motor_sample::MotorSample;
pub use run::planes::PlaneLoop;
pub use run::record::{Record, RunHooks};
pub use run::session::{FailureCause, Phase, Session};

/// The code of docs/robust-control.md.
#[cfg(doctest)]
#[doc = include_str!("../../../docs/robust-control.md")]
struct RobustControl;

/// The code of docs/embedded.md.
#[cfg(doctest)]
#[doc = include_str!("../../../docs/embedded.md")]
struct Embedded;
