//! The command line.

use crate::commands::{
    bench::BenchArguments, campaign::CampaignArguments, certify::CertifyArguments,
    completions::CompletionsArguments, excite::ExciteArguments, identify::IdentifyArguments,
    linearize::LinearizeArguments, lqr::LqrArguments, optimality::OptimalityArguments,
    refine::RefineArguments, rehearse::RehearseArguments, reproduce::ReproduceArguments,
    scenario::ScenarioArguments, simulate::SimulateArguments, verify::VerifyArguments,
    view::ViewArguments, wheels::WheelsArguments,
};
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

Exit codes: 0 done, 1 no result (the message says why), 2 the command line is not understood."
)]
pub struct Arguments {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
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
    /// Design a safe torque that tells a robot's parameters
    Excite(ExciteArguments),
    /// Find a robot's parameters, with error bars, from its logs
    Identify(IdentifyArguments),
    /// See by hand, before power-on, whether the wheels are as a configuration says
    Wheels(WheelsArguments),
    /// From an excitation to a controller, on a simulated robot
    Rehearse(RehearseArguments),
    /// Find the nonlinear model's parameters b from a linear model's parameters p
    Refine(RefineArguments),
    /// Show the linear model: A, B, poles, controllability
    Linearize(LinearizeArguments),
    /// Design a linear-quadratic regulator u = -K x and check it at frozen scheduling
    Lqr(LqrArguments),
    /// Find a terminal set and prove what holds in it
    Certify(CertifyArguments),
    /// Prove the claims of a certificate again
    Verify(VerifyArguments),
    /// Serve the ballbot in the browser, to this machine only
    View(ViewArguments),
    /// Run many closed loops and count what is guaranteed, and where that ends
    Campaign(CampaignArguments),
    /// Compare closed-loop costs with those of nonlinear MPC, converged by IPOPT
    Optimality(OptimalityArguments),
    /// Print the completions for a shell
    Completions(CompletionsArguments),
}

/// A finite number.
pub fn finite(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        Ok(value) => Err(format!("{value} is not a finite number")),
        Err(_) => Err(format!("`{text}` is not a number")),
    }
}

/// A finite number above zero.
pub fn positive(text: &str) -> Result<f64, String> {
    let value = finite(text)?;
    if value > 0.0 {
        Ok(value)
    } else {
        Err(format!("{value} is not positive"))
    }
}
