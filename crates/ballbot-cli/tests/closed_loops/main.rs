//! The commands of the program `ballbot` that run closed loops: `simulate`, `scenario`,
//! `rehearse`, `reproduce`, `campaign`.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test that cannot go on must fail, in its support functions too"
)]

mod both_planes;
mod campaign;
mod failures;
mod interrupt;
mod optimality;
mod recorded;
mod rehearsal;
mod reproduce;
mod scenario;
mod simulate;

use std::path::Path;
use std::process::{Command, Output};

/// Runs the program in `folder` to its end.
fn ballbot(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_ballbot"))
        .current_dir(folder)
        .args(arguments)
        .output()
        .unwrap()
}

/// Standard output of a run that succeeds.
fn succeed(folder: &Path, arguments: &[&str]) -> String {
    let output = ballbot(folder, arguments);
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {message}");
    assert!(message.is_empty(), "{arguments:?}: {message}");
    String::from_utf8(output.stdout).unwrap()
}

/// The message of a run that exits with `code`.
fn fail(folder: &Path, arguments: &[&str], code: i32) -> String {
    let output = ballbot(folder, arguments);
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {message}");
    assert!(output.stdout.is_empty(), "{arguments:?} printed a result");
    assert!(message.starts_with("error: "), "{arguments:?}: {message}");
    assert!(!message.contains("panicked"), "{arguments:?}: {message}");
    message
}

/// The text has all of these parts.
fn assert_says(text: &str, parts: &[&str]) {
    for part in parts {
        assert!(text.contains(part), "`{part}` is not in: {text}");
    }
}

/// The text with one part of it, which must be there, replaced.
fn edited(text: &str, from: &str, to: &str) -> String {
    assert!(text.contains(from), "`{from}` is not in: {text}");
    text.replacen(from, to, 1)
}

/// The text with everything from `from` to just before `to` replaced.
fn with_section(text: &str, from: &str, to: &str, new: &str) -> String {
    let start = text.find(from).unwrap();
    let end = start + text[start..].find(to).unwrap();
    format!("{}{new}\n\n{}", &text[..start], &text[end..])
}

/// The files below `folder` but for the lists of them, sorted, with `/` between the parts of their
/// paths.
fn files(folder: &Path) -> Vec<String> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap();
        if name == ballbot_cli::results::LIST {
            continue;
        }
        if path.is_dir() {
            found.extend(files(&path).iter().map(|inner| format!("{name}/{inner}")));
        } else {
            found.push(name.to_owned());
        }
    }
    found.sort();
    found
}
