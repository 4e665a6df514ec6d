//! Help, completions, streams.

use crate::{assert_says, ballbot, failure, text};
use std::process::{Command, ExitStatus, Stdio};

const COMMANDS: [&str; 4] = ["refine", "linearize", "lqr", "completions"];

#[test]
fn the_help_lists_every_command_and_each_has_examples() {
    let help = text(&["--help"]);
    for command in COMMANDS {
        assert_says(&help, &[command]);
        let example = format!("ballbot {command}");
        assert_says(
            &text(&[command, "--help"]),
            &["Examples:", &example, "Usage:"],
        );
    }
    assert_says(
        &text(&["--version"]),
        &["ballbot ", env!("CARGO_PKG_VERSION")],
    );
}

#[test]
fn every_example_of_the_help_is_understood() {
    let folder = tempfile::tempdir().unwrap();
    let robot = folder.path().join("robot.toml");
    let example = text(&["refine", "--example"]);
    let with_parameters = text(&["refine"]);
    let table = with_parameters.split("[parameters]").nth(1).unwrap();
    let table = table.split("\n\n").next().unwrap();
    // As a file for `refine` it is the example, as one for the others a [parameters] table.
    for command in COMMANDS {
        let content = match command {
            "refine" => example.clone(),
            _ => format!("[parameters]{table}"),
        };
        std::fs::write(&robot, content).unwrap();
        let help = text(&[command, "--help"]);
        let examples = help.split("Examples:\n").nth(1).unwrap();
        let lines: Vec<&str> = examples
            .lines()
            .filter_map(|line| line.strip_prefix("  ballbot "))
            .collect();
        assert!(!lines.is_empty());
        for line in lines {
            // Explanations stand two spaces off, redirections are the shell's.
            let line = line.split("  ").next().unwrap();
            let line = line.split(" > ").next().unwrap();
            let output = Command::new(env!("CARGO_BIN_EXE_ballbot"))
                .current_dir(folder.path())
                .args(line.split_whitespace())
                .output()
                .unwrap();
            let message = String::from_utf8_lossy(&output.stderr);
            assert!(output.status.success(), "ballbot {line}: {message}");
        }
    }
}

#[test]
fn completions_know_the_commands() {
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        assert_says(&text(&["completions", shell]), &COMMANDS);
    }
    assert_says(&failure(&["completions", "dos"], 2), &["dos", "bash"]);
}

#[test]
fn a_command_that_does_not_exist_is_refused_with_the_nearest_one() {
    assert_says(&failure(&["refin"], 2), &["refin", "'refine'"]);
    assert_eq!(ballbot(&[]).status.code(), Some(2));
}

/// How the program ends that prints its result there, and what it says beside it.
fn printing_to(output: impl Into<Stdio>, arguments: &[&str]) -> (ExitStatus, String) {
    let ended = Command::new(env!("CARGO_BIN_EXE_ballbot"))
        .args(arguments)
        .stdout(output)
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
        .wait_with_output()
        .unwrap();
    let said = String::from_utf8_lossy(&ended.stderr);
    (ended.status, said.into_owned())
}

#[test]
fn a_reader_that_has_seen_enough_is_no_failure() {
    for arguments in [
        &["refine"][..],
        &["completions", "bash"],
        &["lqr", "--help"],
    ] {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let (status, message) = printing_to(writer, arguments);
        assert!(status.success(), "{arguments:?}: {message}");
        assert!(message.is_empty(), "{arguments:?}: {message}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_a_failure() {
    for argument in ["lqr", "--help", "--version"] {
        let full = std::fs::OpenOptions::new()
            .write(true)
            .open("/dev/full")
            .unwrap();
        let (status, message) = printing_to(full, &[argument]);
        assert_eq!(status.code(), Some(1), "{argument}: {message}");
        assert_says(&message, &["error: cannot write to standard output"]);
    }
}

/// A device that never ends filled the memory.
#[cfg(target_os = "linux")]
#[test]
fn a_file_without_end_is_refused() {
    for command in [
        vec!["simulate", "/dev/zero"],
        vec!["lqr", "--parameters", "/dev/zero"],
        vec!["campaign", "/dev/zero"],
        vec!["tune", "/dev/zero"],
    ] {
        assert_says(&failure(&command, 1), &["/dev/zero", "64 MiB"]);
    }
}
