//! `ballbot completions`.

use super::CommandError;
use crate::arguments::Arguments;
use clap::{Args, CommandFactory};
use clap_complete::Shell;

/// Arguments of `ballbot completions`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  ballbot completions bash > ~/.local/share/bash-completion/completions/ballbot
  ballbot completions fish > ~/.config/fish/completions/ballbot.fish")]
pub struct CompletionsArguments {
    /// The shell
    pub shell: Shell,
}

/// The completion script.
///
/// # Errors
/// None.
pub fn run(arguments: &CompletionsArguments) -> Result<String, CommandError> {
    // Generated into memory: the generator panics when its writer fails, as a closed pipe does.
    let mut script = Vec::new();
    let mut command = Arguments::command();
    clap_complete::generate(arguments.shell, &mut command, "ballbot", &mut script);
    Ok(String::from_utf8_lossy(&script).into_owned())
}
