//! One module per command: its arguments, and what it prints.

pub mod bench;
pub mod campaign;
pub mod certify;
pub mod completions;
pub mod excite;
pub mod hyperqueue;
pub mod identify;
pub mod linearize;
pub mod lqr;
pub mod model;
pub mod optimality;
pub mod refine;
pub mod rehearse;
pub mod reproduce;
pub mod robot;
pub mod scenario;
pub mod simulate;
pub mod tune;
pub mod verify;
pub mod view;
pub mod wheels;

use crate::input::InputError;
use crate::output::FileError;
use ballbot_identification::{EstimateError, ExcitationError, log::LogError};
use ballbot_scenario::ScenarioError;
use ballbot_studies::{CampaignError, RefinementError, RegulatorError, SearchError, StudyError};
use lpvmpc_certificate::{ClaimError, DocumentError};
use lpvmpc_design::MatrixError;
use lpvmpc_figures::FigureError;
use lpvmpc_sim::PlantError;
use std::path::PathBuf;

/// Why a command has no result. The message says what is wrong, where, and what would be right.
#[derive(Debug, thiserror::Error)]
pub enum CommandError {
    /// Options that do not go together.
    #[error("{0}")]
    Usage(String),
    /// What stands in a folder, or the room on the disk, does not allow it.
    #[error("{0}")]
    Impossible(String),
    /// A file that was handed in.
    #[error(transparent)]
    Input(#[from] InputError),
    /// A file that was to be written.
    #[error(transparent)]
    Output(#[from] FileError),
    /// The parameters b.
    #[error(transparent)]
    Refinement(#[from] RefinementError),
    /// The regulator.
    #[error(transparent)]
    Regulator(#[from] RegulatorError),
    /// The linear model.
    #[error("the linear model: {0}")]
    LinearModel(#[from] MatrixError),
    /// A scenario that cannot be run.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// The plant cannot be integrated.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// The page cannot be served.
    #[error(transparent)]
    View(#[from] view::ViewError),
    /// A figure that cannot be drawn.
    #[error(transparent)]
    Figure(#[from] FigureError),
    /// The built-in campaign cannot be run.
    #[error(transparent)]
    BuiltInCampaign(#[from] CampaignError),
    /// A campaign of one's own that has no result.
    #[error(transparent)]
    Campaign(#[from] ballbot_campaign::CampaignError),
    /// A tuning that has no result.
    #[error(transparent)]
    Tuning(#[from] ballbot_tuning::TuningError),
    /// The cluster.
    #[error("{0}")]
    Cluster(String),
    /// A study that has no result.
    #[error(transparent)]
    Study(#[from] StudyError),
    /// No set could be certified.
    #[error(transparent)]
    Certify(#[from] SearchError),
    /// A claim of a certificate is false, or could not be shown.
    #[error("the certificate {verdict}: {0}", verdict = .0.verdict())]
    Claim(#[from] ClaimError),
    /// A certificate that cannot be written down.
    #[error(transparent)]
    Certificate(#[from] DocumentError),
    /// A log that cannot be used.
    #[error(transparent)]
    Log(#[from] LogError),
    /// A log that no robot could be found from.
    #[error(transparent)]
    Estimate(#[from] EstimateError),
    /// What was identified is no robot.
    #[error(
        "no parameters: what was found is no robot.{reasons}{seen}\nwhat was fitted is in {}{}",
        report.display(),
        old.as_ref().map_or(String::new(), |old| format!(
            "; {} is of an earlier identification", old.display()
        ))
    )]
    NoRobot {
        /// Why, a line each.
        reasons: String,
        /// What the logs have shown, a line each.
        seen: String,
        /// The report.
        report: PathBuf,
        /// Parameters of an earlier identification that still stand there.
        old: Option<PathBuf>,
    },
    /// An excitation that cannot be.
    #[error(transparent)]
    Excitation(#[from] ExcitationError),
    /// Wheels that are not as a configuration says.
    #[error("{0}")]
    Wheels(String),
    /// A run that ended before its time.
    #[error(
        "the {what} ended early, {termination}\nat phi = {:.4} rad, theta = {:.4} rad, phi_dot = {:.4} \
         rad/s, theta_dot = {:.4} rad/s\nwhat was recorded until then is in {}",
        state[0], state[1], state[2], state[3], folder.display()
    )]
    EndedEarly {
        /// The run, with its plane where there are two.
        what: &'static str,
        /// When and why.
        termination: String,
        /// The state then.
        state: [f64; 4],
        /// Where the recorded part is.
        folder: PathBuf,
    },
    /// A guarantee that did not hold on the plant that it is for.
    #[error("the guarantee was violated {broken} times:\n{table}")]
    GuaranteeViolated {
        /// How often.
        broken: usize,
        /// All counts.
        table: String,
    },
    /// Published numbers that were not reproduced.
    #[error(
        "{differing} of the statements do not agree:\n{table}\nsee {}",
        report.display()
    )]
    Disagreement {
        /// The whole table.
        table: String,
        /// How many.
        differing: usize,
        /// The report.
        report: PathBuf,
    },
}
