//! Studies of a ballbot and its controllers: results as data, for a command line, tests and other
//! languages alike. No files, no figures; the clock is handed in, and
//! progress is told to whoever asks.
//!
//! | for | use |
//! |---|---|
//! | the nonlinear model's parameters from a linear model | [`RefinementProblem`] |
//! | the linear-quadratic regulator, checked over the tilts | [`RegulatorProblem`] |
//! | four models of the robot side by side | [`ModelComparison`] |
//! | a terminal set, as large as can be proved | [`CertificateSearch`] |
//! | what is guaranteed, counted over many closed loops | [`Campaign`] |
//! | closed-loop costs beside those of nonlinear MPC | [`optimality`] |
//! | how long a step takes on this machine | [`timing`] |
//! | everything that the paper publishes, with its claims | [`reproduction`] |
//! | what a recorded run amounts to | [`recorded`] |
//!
//! # Example
//!
//! ```
//! use ballbot_studies::{LinearModel, RegulatorProblem, Time};
//! use ballbot::Ballbot;
//!
//! # fn main() -> Result<(), ballbot_studies::RegulatorError> {
//! let ballbot = Ballbot::paper();
//! let problem = RegulatorProblem {
//!     linear: LinearModel::from(ballbot.linear_parameters().matrices()),
//!     ballbot,
//!     q: [0.5, 12.0, 0.6, 2.5],
//!     r: 1.0,
//!     time: Time::Continuous,
//! };
//! let regulator = problem.solve()?;
//! println!("K = {}", regulator.lqr.k);
//! assert!(regulator.lqr.poles.iter().all(|pole| pole.re < 0.0));
//! # Ok(())
//! # }
//! ```
#![allow(
    clippy::neg_cmp_op_on_partial_ord,
    reason = "a comparison with NaN must take the failing branch"
)]

mod campaign;
mod certificate_search;
mod error;
mod linear_model;
mod model_comparison;
pub mod optimality;
pub mod recorded;
mod refinement;
mod regulator;
pub mod reproduction;
pub mod timing;

pub use campaign::{
    Campaign, CampaignError, ImpossibleSetPoints, Outcome, Record, Scenarios, SetPoints, Tally,
    Variant,
};
pub use certificate_search::{CertificateSearch, Certified, ProvedSet, SearchError, Searching};
pub use error::StudyError;
pub use linear_model::LinearModel;
pub use model_comparison::{ModelComparison, ModelError};
pub use refinement::{
    Equation, PAPER_START, Refinement, RefinementError, RefinementProblem, start_from,
};
pub use regulator::{Regulator, RegulatorError, RegulatorProblem, Time};
