//! Ballbot experiments as TOML files: parameters, controller, bounds, reference, simulated
//! plant, and the run itself.
//!
//! ```
//! use ballbot_scenario::{Scenario, Surroundings};
//! use std::{path::Path, time::Duration};
//!
//! # fn main() -> Result<(), ballbot_scenario::ScenarioError> {
//! let mut scenario = Scenario::load("single-setpoint")?;
//! scenario.controller.horizon = 30;
//! let prepared = scenario.prepare(Path::new("."))?;
//! let trajectories = prepared.run(&Surroundings {
//!     clock: &|| Duration::ZERO,
//!     progress: &|_| (),
//! })?;
//! let end = trajectories[0].final_state;
//! assert!((end[0] - std::f64::consts::PI).abs() < 0.05, "phi has reached pi: {end}");
//! # Ok(())
//! # }
//! ```
#![allow(
    clippy::neg_cmp_op_on_partial_ord,
    reason = "a comparison with a number that is not one must take the failing branch"
)]

pub mod builtin;
mod certificate;
mod error;
mod excitation;
mod feedback;
mod feedback_table;
mod files;
mod guarantee;
mod heading;
mod heading_table;
mod load;
pub mod number;
mod parameters;
pub mod plausible;
mod prepare;
mod problem;
mod reference;
mod rollout;
mod run;
mod schema;
mod session;
mod three_motors;
mod time_series;
mod uncertainty;
mod weights;
mod whole_robot;
mod whole_run;
pub mod words;
mod world;
mod world_table;

pub use certificate::{RobotTable, TerminalCertificate, ViscousBallbot, read_certificate};
pub use error::ScenarioError;
pub use excitation::Excitation;
pub use feedback_table::{
    DisturbancesTable, EstimatorTable, MotorsTable, ShapingTable, TorqueRateTable,
};
pub use files::Files;
pub use guarantee::Standing;
pub use heading::Turning;
pub use heading_table::HeadingTable;
pub use parameters::{KnownRobot, Parameters, read_robot};
pub use prepare::{Plane, Prepared, Problem};
pub use reference::PhiReference;
pub use run::{PlaneLoop, Record, Surroundings};
pub use schema::{
    BoundsTable, CertifiedTable, ControllerTable, CsvTable, IntegrationTable, IterationsTable,
    LinearModelTable, LissajousTable, ModelKind, ParameterTable, PointTable, PredictorTable,
    ReferenceTable, Scenario, SineTable, StateBounds, StateTable, TerminalTable,
};
pub use session::{Phase, Session, Trouble};
pub use three_motors::{MotorSample, ThreeMotors};
pub use uncertainty::{RobotDistribution, Uncertainty};
pub use weights::bryson;
pub use world::{PlaneWorld, Robot};
pub use world_table::{
    ActuatorTable, AngleSensorTable, DelayTable, DeviationsTable, FloorTable, PlaneName, PushTable,
    RateSensorTable, SensorsTable, WorldTable,
};

/// The code of the README, compiled and run with the tests.
#[cfg(doctest)]
#[doc = include_str!("../../../README.md")]
struct Readme;

/// The code of docs/robust-control.md.
#[cfg(doctest)]
#[doc = include_str!("../../../docs/robust-control.md")]
struct RobustControl;

/// The code of docs/embedded.md.
#[cfg(doctest)]
#[doc = include_str!("../../../docs/embedded.md")]
struct Embedded;
