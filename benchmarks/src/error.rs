//! Why a comparison cannot be made.

use ballbot_scenario::ScenarioError;
use lpvmpc::ControllerError;
use lpvmpc_sequences::SequenceError;
use lpvmpc_sim::PlantError;
use thiserror::Error;

/// A comparison that cannot be made, or would mean nothing.
#[derive(Debug, Error)]
pub enum BenchmarkError {
    /// A built-in scenario does not load.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// A sequence of problems cannot be made.
    #[error(transparent)]
    Sequence(#[from] SequenceError),
    /// The controller refuses the scenario's settings.
    #[error("controller: {0}")]
    Controller(#[from] ControllerError),
    /// The plant cannot be integrated.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// The scenario has no plane to control.
    #[error("scenario {0} has no plane")]
    NoPlane(String),
    /// Data that a solver does not take.
    #[error("{solver} refuses the problem: {reason}")]
    Refused {
        /// The solver.
        solver: &'static str,
        /// Its own words.
        reason: String,
    },
    /// A problem of the sequence is left unsolved.
    #[error("{solver} does not solve problem {problem}: {status}")]
    NotSolved {
        /// The solver.
        solver: &'static str,
        /// Number in the sequence, from 0.
        problem: usize,
        /// Its own words.
        status: String,
    },
    /// An answer differs from the expected one.
    #[error(
        "{contender}, problem {problem} of {sequence}: first input off by {deviation:.1e} of the \
         sequence's largest, allowed is {tolerance:.1e}"
    )]
    Disagrees {
        /// What was to be timed.
        contender: String,
        /// The sequence.
        sequence: String,
        /// Number in the sequence, from 0.
        problem: usize,
        /// Largest difference in a component of u_0, relative to the sequence's largest.
        deviation: f64,
        /// What is allowed.
        tolerance: f64,
    },
}
