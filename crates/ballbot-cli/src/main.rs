//! The program `ballbot`.

use ballbot_cli::{arguments::Arguments, output};
use clap::Parser;
use std::process::ExitCode;

fn main() -> ExitCode {
    match ballbot_cli::run(Arguments::parse()) {
        Ok(text) => output::print(&text),
        Err(error) => output::fail(&error),
    }
}
