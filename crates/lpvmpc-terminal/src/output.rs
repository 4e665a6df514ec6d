//! What leaves the program: files, standard output, messages.

mod draft;
mod files;

pub use draft::Draft;
pub use files::{FileError, abandon, append, check_separate, check_writable, write_files};

use std::fmt::Display;
use std::io::{self, Write};
use std::process::ExitCode;

/// Prints the text of a command that has done its work. A reader that has seen enough, such as
/// `head`, is no failure.
pub fn print(text: &str) -> ExitCode {
    let mut output = io::stdout().lock();
    let written = output.write_all(text.as_bytes());
    printed(written.and_then(|()| output.flush()))
}

/// The end of a program whose result is on standard output, as far as it could be written.
pub fn printed(written: io::Result<()>) -> ExitCode {
    match written {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => ExitCode::SUCCESS,
        Err(error) => complain(&format!("cannot write to standard output: {error}")),
    }
}

/// Reports why a command has no result: by exit code 2 where the command line is not understood, else by 1.
pub fn fail(error: &dyn Display, is_usage: bool) -> ExitCode {
    let code = complain(&error.to_string());
    match is_usage {
        true => ExitCode::from(2),
        false => code,
    }
}

/// Says what the reader of a result should know, beside it.
pub fn warn(message: &str) {
    // Where standard error is closed there is nobody to tell.
    let _ = writeln!(io::stderr(), "note: {message}");
}

fn complain(message: &str) -> ExitCode {
    // Where standard error is closed there is nobody to tell.
    let _ = writeln!(io::stderr(), "error: {message}");
    ExitCode::FAILURE
}
