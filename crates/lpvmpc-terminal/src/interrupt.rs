//! What an interrupt (Ctrl-C) leaves behind: files that are whole or not there, and a line that says
//! which.

use crate::output;
use std::io::{self, IsTerminal, Write};
use std::path::PathBuf;

/// The exit code of a program that an interrupt ended: 128 and the number of the signal, as shells
/// count it.
const INTERRUPTED: i32 = 130;
/// As many files are named.
const NAMED: usize = 4;

/// From here on an interrupt ends the program in order. `command` is what the message calls it, `ballbot certify`. Who
/// started the program with interrupts ignored, as a shell does in the background, has them ignored.
pub fn watch(command: String) {
    // Where there is no handler an interrupt ends the program all the same, without a word.
    let _ = ctrlc::try_set_handler(move || {
        let written = output::abandon();
        let mut standard_error = io::stderr().lock();
        // The progress bar's line stays as it is.
        let line = match standard_error.is_terminal() {
            true => "\n",
            false => "",
        };
        // Where standard error is closed there is nobody to tell.
        let _ = writeln!(standard_error, "{line}{}", message(&command, &written));
        std::process::exit(INTERRUPTED);
    });
}

fn message(command: &str, written: &[PathBuf]) -> String {
    if written.is_empty() {
        return format!("interrupted: `{command}` was stopped, nothing was written");
    }
    let named = written.iter().take(NAMED);
    let named: Vec<String> = named.map(|path| path.display().to_string()).collect();
    let more = match written.len().saturating_sub(NAMED) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    format!(
        "interrupted: `{command}` was stopped after it had written {}{more}",
        named.join(", ")
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_written_is_named() {
        let all: Vec<PathBuf> = ["a", "b", "c", "d", "e", "f"].map(PathBuf::from).into();
        assert!(message("ballbot certify", &[]).ends_with("nothing was written"));
        assert!(message("ballbot rehearse", &all[..2]).ends_with("had written a, b"));
        assert!(message("ballbot rehearse", &all).ends_with("had written a, b, c, d and 2 more"));
    }
}
