//! The program `ballbot`: its commands, and how their results become text, files and figures. What
//! they compute is in the libraries.
//!
//! ```
//! use ballbot_cli::arguments::Arguments;
//! use clap::Parser;
//!
//! # fn main() -> Result<(), ballbot_cli::commands::CommandError> {
//! let arguments = Arguments::parse_from(["ballbot", "lqr", "--continuous", "--r", "1000"]);
//! println!("{}", ballbot_cli::run(arguments)?);
//! # Ok(())
//! # }
//! ```

#![allow(
    clippy::neg_cmp_op_on_partial_ord,
    reason = "a comparison with NaN must take the failing branch"
)]

pub mod arguments;
pub mod campaign_figure;
pub mod campaign_figures;
pub mod certificate_page;
pub mod commands;
pub mod html;
pub mod identification;
pub mod input;
pub mod json;
pub mod optimality_figure;
pub mod parallel_figure;
pub mod program;
pub mod refinement_file;
pub mod reproduction;
pub mod run_figures;
pub mod tuning_figures;

use arguments::{Arguments, Command};
use commands::CommandError;
pub use lpvmpc_terminal::{interrupt, output, progress, results, table};

/// What the program is called.
pub const PROGRAM: &str = "ballbot";

/// Does what the command line asks for and returns the text for standard output.
///
/// # Errors
/// What kept the command from its result, for a person to read.
pub fn run(arguments: Arguments) -> Result<String, CommandError> {
    if arguments.quiet {
        progress::silence();
    }
    let silent = arguments.quiet && arguments.command.reports_files();
    let text = dispatch(arguments.command)?;
    Ok(if silent { String::new() } else { text })
}

fn dispatch(command: Command) -> Result<String, CommandError> {
    match command {
        Command::Reproduce(arguments) => commands::reproduce::run(&arguments),
        Command::Simulate(arguments) => commands::simulate::run(&arguments),
        Command::Bench(arguments) => commands::bench::run(&arguments),
        Command::Scenario(arguments) => commands::scenario::run(&arguments),
        Command::Excite(arguments) => commands::excite::run(&arguments),
        Command::Identify(arguments) => commands::identify::run(&arguments),
        Command::Rehearse(arguments) => commands::rehearse::run(&arguments),
        Command::Refine(arguments) => commands::refine::run(&arguments),
        Command::Linearize(arguments) => commands::linearize::run(&arguments),
        Command::Lqr(arguments) => commands::lqr::run(&arguments),
        Command::Certify(arguments) => commands::certify::run(&arguments),
        Command::Wheels(arguments) => commands::wheels::run(&arguments),
        Command::Verify(arguments) => commands::verify::run(&arguments),
        Command::View(arguments) => commands::view::run(&arguments),
        Command::Campaign(arguments) => commands::campaign::run(&arguments),
        Command::Tune(arguments) => commands::tune::run(&arguments),
        Command::Optimality(arguments) => commands::optimality::run(&arguments),
        Command::Completions(arguments) => commands::completions::run(&arguments),
    }
}

/// The code of the README, compiled and run with the tests.
#[cfg(doctest)]
#[doc = include_str!("../../../README.md")]
struct Readme;
