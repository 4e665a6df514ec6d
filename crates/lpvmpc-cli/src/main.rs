//! The program `lpvmpc`: plants from files, their controllers, and what is proved of them. What the commands
//! compute is in the libraries.

#![allow(
    clippy::neg_cmp_op_on_partial_ord,
    reason = "a comparison with NaN must take the failing branch"
)]

mod arguments;
mod certificate;
mod closed_loop;
mod describe;
mod error;
mod estimator;
mod experiment;
mod figure;
mod firmware;
mod gain;
mod simulate;

use arguments::{Arguments, Command};
use clap::{CommandFactory, FromArgMatches};
use error::CommandError;
use lpvmpc_terminal::{interrupt, output, progress};
use std::process::ExitCode;

/// What the program is called.
const PROGRAM: &str = "lpvmpc";

fn main() -> ExitCode {
    let matches = match Arguments::command().try_get_matches() {
        Ok(matches) => matches,
        // Help and version are results, too.
        Err(asked) if !asked.use_stderr() => return output::printed(asked.print()),
        Err(error) => error.exit(),
    };
    let arguments = match Arguments::from_arg_matches(&matches) {
        Ok(arguments) => arguments,
        Err(error) => error.exit(),
    };
    if let Some(name) = matches.subcommand_name() {
        interrupt::watch(format!("{PROGRAM} {name}"));
    }
    if arguments.quiet {
        progress::silence();
    }
    match run(&arguments) {
        Ok(_) if arguments.quiet && arguments.command.reports_files() => ExitCode::SUCCESS,
        Ok(text) => output::print(&text),
        Err(error) => output::fail(&error, false),
    }
}

/// The text for standard output.
fn run(arguments: &Arguments) -> Result<String, CommandError> {
    match &arguments.command {
        Command::Plant(given) => describe::run(given),
        Command::Example(given) => Ok(experiment::example(given).to_owned()),
        Command::Simulate(given) => simulate::run(given),
        Command::Bench(given) => simulate::bench(given),
        Command::Lqr(given) => gain::run(given),
        Command::Certify(given) => certificate::certify(given),
        Command::Verify(given) => certificate::verify(given),
        Command::Firmware(given) => firmware::run(given),
    }
}
