//! The command line.

use crate::commands::{
    bench::BenchArguments, campaign::CampaignArguments, certify::CertifyArguments,
    completions::CompletionsArguments, excite::ExciteArguments, identify::IdentifyArguments,
    linearize::LinearizeArguments, lqr::LqrArguments, optimality::OptimalityArguments,
    refine::RefineArguments, rehearse::RehearseArguments, reproduce::ReproduceArguments,
    scenario::ScenarioArguments, simulate::SimulateArguments, tune::TuneArguments,
    verify::VerifyArguments, view::ViewArguments, wheels::WheelsArguments,
};
use ballbot_scenario::number;
use clap::{Parser, Subcommand};

/// Predictive control of a ballbot, a robot that balances on one ball.
#[derive(Debug, Parser)]
#[command(
    name = "ballbot",
    version,
    after_help = "\
Examples:
  ballbot reproduce                   the paper, with a report
  ballbot simulate two-setpoints      one closed loop
  ballbot refine                      the paper's parameters b from its linear model p
  ballbot lqr --ts 0.05 --substeps 4  a gain and its terminal cost
  ballbot help lqr                    options and examples of one command

Exit codes: 0 done, 1 no result (the message says why), 2 the command line is not understood, 130
interrupted (what was written by then is listed; no file is half-written)."
)]
pub struct Arguments {
    /// No progress bar, and no report where the results are in files; errors are still printed
    #[arg(long, short, global = true)]
    pub quiet: bool,
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

impl Command {
    /// Whether what it prints is a report of files that it has written.
    pub fn reports_files(&self) -> bool {
        match self {
            Self::Reproduce(_) => true,
            Self::Excite(arguments) => !arguments.json,
            Self::Refine(arguments) => arguments.writes_a_file() && !arguments.json,
            Self::Identify(arguments) => !arguments.example && !arguments.json,
            Self::Simulate(arguments) => !(arguments.json || arguments.logs_to_standard_output()),
            Self::Rehearse(arguments) => !arguments.json,
            Self::Certify(arguments) => !arguments.json,
            Self::Campaign(arguments) => !arguments.json,
            Self::Tune(arguments) => !arguments.json && arguments.action.is_none(),
            Self::Optimality(arguments) => !arguments.json,
            _ => false,
        }
    }
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Reproduce the paper: every figure, every table, published beside computed
    Reproduce(ReproduceArguments),
    /// Run a closed loop and record it
    Simulate(SimulateArguments),
    /// Time the controller on this machine
    Bench(BenchArguments),
    /// List or show the built-in scenarios
    Scenario(ScenarioArguments),
    /// Design a safe torque that identifies a robot's parameters
    Excite(ExciteArguments),
    /// Find a robot's parameters, with error bars, from its logs
    Identify(IdentifyArguments),
    /// Check by hand, before power-on, that the wheels match a configuration
    Wheels(WheelsArguments),
    /// From an excitation to a controller, on a simulated robot
    Rehearse(RehearseArguments),
    /// Find the nonlinear model's parameters b from a linear model's parameters p
    Refine(RefineArguments),
    /// Show the linear model: A, B, poles, controllability
    Linearize(LinearizeArguments),
    /// Design a linear-quadratic regulator u = -K x and check it at frozen scheduling
    Lqr(LqrArguments),
    /// Find a terminal set and certify it
    Certify(CertifyArguments),
    /// Prove the claims of a certificate again
    Verify(VerifyArguments),
    /// Serve the browser page, to this machine only
    View(ViewArguments),
    /// Run many closed loops: where the guarantee holds, and where it ends
    Campaign(CampaignArguments),
    /// Search for a controller's weights, horizon and other keys, for goals and within limits
    Tune(TuneArguments),
    /// Compare closed-loop costs with those of nonlinear MPC, converged by IPOPT
    Optimality(OptimalityArguments),
    /// Print the completions for a shell
    Completions(CompletionsArguments),
}

/// A finite number.
pub fn finite(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        Ok(value) => Err(format!("{} is not a finite number", number::text(value))),
        Err(_) => Err(format!("`{text}` is not a number")),
    }
}

/// N finite numbers with commas between them.
pub fn finite_list<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let numbers: Vec<f64> = text.split(',').map(finite).collect::<Result<_, _>>()?;
    let found = numbers.len();
    numbers
        .try_into()
        .map_err(|_| format!("{N} numbers with commas between them are needed, not {found}"))
}

/// A finite number above zero.
pub fn positive(text: &str) -> Result<f64, String> {
    let value = finite(text)?;
    if value > 0.0 {
        Ok(value)
    } else {
        Err(format!("{} is not positive", number::text(value)))
    }
}
