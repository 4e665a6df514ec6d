//! The program `ballbot` as its users run it.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test that cannot go on must fail, in its support functions too"
)]

mod bench;
mod certify;
mod closed_loops;
mod identify;
mod linearize;
mod lqr;
mod program;
mod refine;
mod wheels;

use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output};

/// Runs the program in `folder` to its end.
fn ballbot_in(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_ballbot"))
        .current_dir(folder)
        .args(arguments)
        .env("XDG_CACHE_HOME", env!("CARGO_TARGET_TMPDIR"))
        .output()
        .unwrap()
}

/// Standard output of a run in `folder` that succeeds.
fn succeed(folder: &Path, arguments: &[&str]) -> String {
    let output = ballbot_in(folder, arguments);
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {message}");
    assert!(message.is_empty(), "{arguments:?}: {message}");
    String::from_utf8(output.stdout).unwrap()
}

/// The message of a run in `folder` that exits with `code` and prints no result.
fn fail(folder: &Path, arguments: &[&str], code: i32) -> String {
    let output = ballbot_in(folder, arguments);
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {message}");
    assert!(output.stdout.is_empty(), "{arguments:?} printed a result");
    assert!(message.starts_with("error: "), "{arguments:?}: {message}");
    assert!(!message.contains("panicked"), "{arguments:?}: {message}");
    message
}

/// The three of them where the folder does not matter.
fn ballbot(arguments: &[&str]) -> Output {
    ballbot_in(Path::new("."), arguments)
}

fn text(arguments: &[&str]) -> String {
    succeed(Path::new("."), arguments)
}

fn failure(arguments: &[&str], code: i32) -> String {
    fail(Path::new("."), arguments, code)
}

fn json(arguments: &[&str]) -> Value {
    serde_json::from_str(&text(arguments)).unwrap()
}

/// The text has all of these parts.
fn assert_says(text: &str, parts: &[&str]) {
    for part in parts {
        assert!(text.contains(part), "`{part}` is not in: {text}");
    }
}

fn numbers(value: &Value) -> Vec<f64> {
    let entries = value.as_array().unwrap();
    entries
        .iter()
        .map(|entry| entry.as_f64().unwrap())
        .collect()
}

/// Each number within `relative` of the expected one.
fn assert_close(found: &[f64], expected: &[f64], relative: f64) {
    assert_eq!(found.len(), expected.len());
    for (found, expected) in found.iter().zip(expected) {
        assert!(
            (found - expected).abs() <= relative * expected.abs(),
            "{found} for {expected}"
        );
    }
}
