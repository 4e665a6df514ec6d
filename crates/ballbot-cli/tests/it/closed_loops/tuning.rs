//! `ballbot tune`.

use crate::closed_loops::{edited, files};
use crate::{assert_says, fail, succeed};
use serde_json::Value;
use std::fs;

const TUNING: &str = r#"
title = "Let go"
scenario = "mine/scenario.toml"

[parameters]
"controller.q.0" = { log_uniform = [20.0, 2000.0] }
"controller.horizon" = { integers = [8, 24] }

[[goal]]
measure = "rms_error_rad"
statistic = "mean"

[[goal]]
measure = "largest_tilt_rad"
statistic = "worst"

[worlds]
runs = 2

[[worlds.vary]]
key = "initial_state.theta_rad"
uniform = [0.1, 0.2]

[search]
evaluations = 40
"#;

const ALL: [&str; 13] = [
    "before-after.png",
    "before-after.svg",
    "candidates.csv",
    "front.png",
    "front.svg",
    "journal.jsonl",
    "parallel.png",
    "parallel.svg",
    "progress.png",
    "progress.svg",
    "report.html",
    "summary.json",
    "tuned.toml",
];

/// A folder with a tuning, and with a scenario whose robot is in a file beside it.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    fs::create_dir(here.join("mine")).unwrap();
    let text = ballbot_scenario::builtin::find("single-setpoint-terminal")
        .unwrap()
        .text;
    let start = text.find("[parameters]").unwrap();
    let end = start + text[start..].find("\n\n").unwrap();
    fs::write(here.join("mine/robot.toml"), &text[start..end]).unwrap();
    let scenario = text.replace(&text[start..end], "");
    let scenario = edited(
        &scenario,
        "duration_s = 4.0",
        "duration_s = 1.0\nparameters = \"robot.toml\"",
    );
    fs::write(here.join("mine/scenario.toml"), scenario).unwrap();
    fs::write(here.join("tuning.toml"), TUNING).unwrap();
    folder
}

/// A front, its tables, a page, and a scenario that runs where it was written to.
#[test]
fn a_tuning_writes_a_scenario_that_runs() {
    let folder = folder();
    let here = folder.path();
    let text = succeed(here, &["tune", "tuning.toml"]);
    assert_says(
        &text,
        &[
            "Let go: 36 candidates",
            "in 2 worlds each",
            "controller.horizon",
            "out/tuning",
        ],
    );
    let out = here.join("out/tuning");
    assert_eq!(files(&out), ALL);
    let summary: Value =
        serde_json::from_slice(&fs::read(out.join("summary.json")).unwrap()).unwrap();
    let front = summary["front"].as_array().unwrap();
    let (chosen, count) = (&summary["chosen"], front.len());
    assert_says(
        &text,
        &[&format!("\ncandidate {chosen}; {count} are in front: ")],
    );
    let rows = fs::read_to_string(out.join("candidates.csv")).unwrap();
    assert_eq!(
        rows.lines().count() as u64,
        1 + summary["candidates"].as_u64().unwrap()
    );
    assert_eq!(rows.matches(",true,true,").count(), front.len());
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    assert_says(
        &page,
        &[
            "Pareto front",
            "worlds that the search has not seen",
            "<svg",
        ],
    );

    let tuned = fs::read_to_string(out.join("tuned.toml")).unwrap();
    let horizon = format!("horizon = {} ", summary["parameters"][0]["found"]);
    assert_says(
        &tuned,
        &["# Tuned by `ballbot tune tuning.toml`", "-> ", &horizon],
    );
    assert_says(&tuned, &["parameters = \"../../mine/robot.toml\""]);
    succeed(here, &["simulate", "out/tuning/tuned.toml", "--out", "run"]);

    // Again: nothing is run, and the result is the same.
    let journal = fs::read(out.join("journal.jsonl")).unwrap();
    let last = front.last().unwrap().to_string();
    let json = succeed(
        here,
        &["tune", "tuning.toml", "--candidate", &last, "--json"],
    );
    let json: Value = serde_json::from_str(&json).unwrap();
    assert_eq!(
        (&json["front"], json["chosen"].to_string()),
        (&summary["front"], last)
    );
    assert_eq!(fs::read(out.join("journal.jsonl")).unwrap(), journal);
    let message = fail(here, &["tune", "tuning.toml", "--candidate", "999"], 2);
    assert_says(
        &message,
        &["there are the candidates 0 to", "Pareto front are"],
    );

    // Another tuning into the same folder, and a file that is not the program's.
    fs::write(
        here.join("tuning.toml"),
        edited(TUNING, "runs = 2", "runs = 3"),
    )
    .unwrap();
    let message = fail(here, &["tune", "tuning.toml"], 1);
    assert_says(&message, &["it is of another tuning", "--out"]);
    fs::create_dir(here.join("mine/out")).unwrap();
    fs::write(here.join("mine/out/report.html"), "mine").unwrap();
    let message = fail(here, &["tune", "tuning.toml", "--out", "mine/out"], 1);
    assert_says(&message, &["report.html", "--out"]);
    assert_eq!(files(&here.join("mine/out")), ["report.html"]);
}

#[test]
fn the_example_is_a_tuning() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    let text = succeed(here, &["tune", "example"]);
    let text = edited(&text, "evaluations = 600", "evaluations = 46");
    let text = edited(&text, "at_most = 0.2618", "at_most = 0.0001");
    fs::write(here.join("mine.toml"), text).unwrap();
    let message = fail(here, &["tune", "mine.toml"], 1);
    assert_says(
        &message,
        &["no candidate keeps all limits", "largest_tilt_rad"],
    );
}

/// A goal that is zero for all candidates leaves the figure's axis no extent; then there was no result at all.
#[test]
fn a_goal_that_is_zero_everywhere_has_a_result() {
    let folder = folder();
    let here = folder.path();
    let tuning = edited(
        TUNING,
        "measure = \"largest_tilt_rad\"\nstatistic = \"worst\"",
        "statistic = \"failure_share\"",
    );
    fs::write(here.join("tuning.toml"), tuning).unwrap();
    succeed(here, &["tune", "tuning.toml", "--out", "out"]);
    assert_eq!(files(&here.join("out")), ALL);
}
