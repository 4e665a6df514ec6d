//! Ctrl-C: a line that says what was stopped and what was written, and nothing half-done.
#![cfg(target_os = "linux")]

use crate::assert_says;
use std::fs::read_dir;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::thread::sleep;
use std::time::Duration;

/// Longer than the program needs to take its arguments, shorter than its work.
const BEGUN: Duration = Duration::from_secs(2);

/// Runs the program in `folder`, interrupted when it is at work.
fn interrupted(folder: &Path, arguments: &[&str]) -> Output {
    // A shell that runs tests in the background has them ignore interrupts, and what they start.
    let child = Command::new("env")
        .args(["--default-signal=INT", env!("CARGO_BIN_EXE_ballbot")])
        .args(arguments)
        .current_dir(folder)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    sleep(BEGUN);
    let child_id = child.id().to_string();
    let sent = Command::new("kill").args(["-INT", &child_id]).status();
    assert!(sent.unwrap().success(), "{arguments:?} ended before");
    child.wait_with_output().unwrap()
}

#[test]
fn long_work_that_is_interrupted_says_so_and_leaves_nothing() {
    let long = "duration_s=4000.0";
    for arguments in [
        &["campaign", "--runs", "200000"][..],
        &["certify", "two-setpoints", "--out", "new/certificate"],
        &["optimality", "--out", "new"],
        &["simulate", "lissajous", "--set", long, "--out", "new"],
    ] {
        let folder = tempfile::tempdir().unwrap();
        let output = interrupted(folder.path(), arguments);
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(130), "{arguments:?}: {message}");
        assert!(output.stdout.is_empty(), "{arguments:?}");
        assert_says(
            &message,
            &[
                "interrupted",
                &format!("`ballbot {}`", arguments[0]),
                "nothing was written",
            ],
        );
        assert_eq!(message.lines().count(), 1, "{message}");
        assert_eq!(read_dir(folder.path()).unwrap().count(), 0, "{arguments:?}");
    }
}
