//! Tunings, from their file to what is found.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test that cannot go on must fail, in its support functions too"
)]

mod messages;
mod parts;
mod searches;
mod tunings;

use ballbot_tuning::{Found, Hooks, Journal, Run, Tuning, TuningError, TuningSource};
use std::fs;
use std::path::Path;
use tempfile::TempDir;

/// What names the program in these tests.
const PROGRAM: &str = "ballbot test";

/// A short closed loop in four worlds, with two goals and a limit.
const TWO_GOALS: &str = r#"
title = "Let go"
scenario = "single-setpoint-terminal"
seed = 5

[parameters]
"controller.q.0" = { log_uniform = [20.0, 2000.0] }
"controller.r" = { log_uniform = [100.0, 10000.0] }
"controller.horizon" = { integers = [8, 24] }

[[goal]]
measure = "rms_error_rad"
statistic = "mean"

[[goal]]
measure = "rms_torque_nm"
statistic = "worst"

[[limit]]
statistic = "failure_share"
at_most = 0.0

[worlds]
runs = 4
seed = 1

[worlds.set]
duration_s = 1.0

[[worlds.vary]]
key = "initial_state.theta_rad"
uniform = [-0.1, 0.1]

[worlds.success]
largest_tilt_rad.at_most = 0.6

[held_out]
runs = 6

[search]
evaluations = 60
patience = 3
"#;

/// A tuning's file in a folder of its own.
fn written(text: &str) -> (TempDir, TuningSource) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tuning.toml");
    fs::write(&path, text).unwrap();
    let source = TuningSource::load(&path).unwrap();
    (folder, source)
}

/// Does something with the tuning of this text.
fn with<T>(text: &str, does: impl FnOnce(&Tuning<'_, &Path>) -> T) -> T {
    let (_folder, source) = written(text);
    does(&Tuning::new(&source, source.folder(), PROGRAM).unwrap())
}

/// Goes on from a journal's text, with closed loops run here; what is found, and what was added to the
/// journal.
fn search(tuning: &Tuning<'_, &Path>, text: &str) -> Result<(Found, String), TuningError> {
    search_by(tuning, text, &mut |batch| tuning.run(batch))
}

/// Goes on from a journal's text, with closed loops run by `run`.
fn search_by(
    tuning: &Tuning<'_, &Path>,
    text: &str,
    run: Run<'_, TuningError>,
) -> Result<(Found, String), TuningError> {
    let mut journal = Journal::read(text, tuning.fingerprint())?;
    let mut added = String::new();
    if journal.length == 0 {
        let (empty, first) = Journal::new(tuning.fingerprint());
        journal = empty;
        added += &first;
    }
    let hooks = Hooks {
        run,
        append: &mut |text| -> Result<(), TuningError> {
            added += text;
            Ok(())
        },
        progress: &|_| (),
    };
    let found = tuning.search(journal, hooks)?;
    Ok((found, added))
}
