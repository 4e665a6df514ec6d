//! The program `ballbot`.

use ballbot_cli::{arguments::Arguments, commands::CommandError, interrupt, output};
use clap::{CommandFactory, FromArgMatches};
use std::process::ExitCode;

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
    // A server is ended by an interrupt as a rule.
    if let Some(name) = matches.subcommand_name().filter(|name| *name != "view") {
        interrupt::watch(format!("{} {name}", ballbot_cli::PROGRAM));
    }
    match ballbot_cli::run(arguments) {
        Ok(text) => output::print(&text),
        Err(error) => output::fail(&error, matches!(error, CommandError::Usage(_))),
    }
}
