//! Which robot, and which of its linear models.

use super::robot::RobotArguments;
use ballbot::{Ballbot, LinearParameters};
use ballbot_studies::LinearModel;
use clap::{Args, ValueEnum};
use lpvmpc::LpvModel;
use nalgebra::Vector3;

/// The robot and its linear model.
#[derive(Debug, Args)]
pub struct ModelArguments {
    /// The linear model
    #[arg(long, value_enum, default_value_t = ModelChoice::B)]
    pub model: ModelChoice,
    /// The robot.
    #[command(flatten)]
    pub robot: RobotArguments,
}

/// Where the linear model comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ModelChoice {
    /// The nonlinear model with parameters b, upright
    B,
    /// The paper's identified linear model with parameters p (p6 negative)
    P,
}

impl ModelChoice {
    /// As on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::B => "b",
            Self::P => "p",
        }
    }

    /// In words.
    pub fn description(self) -> &'static str {
        match self {
            Self::B => "model b (nonlinear model, upright)",
            Self::P => "model p (identified linear model of the paper)",
        }
    }
}

impl ModelArguments {
    /// The linear model that was chosen, at the upright equilibrium of `ballbot`, without Coulomb
    /// friction.
    pub fn upright(&self, ballbot: &Ballbot<f64>) -> LinearModel {
        match self.model {
            ModelChoice::B => {
                LinearModel::from(ballbot.without_coulomb().matrices(&Vector3::zeros()))
            }
            ModelChoice::P => LinearModel::from(LinearParameters::paper().matrices()),
        }
    }
}
