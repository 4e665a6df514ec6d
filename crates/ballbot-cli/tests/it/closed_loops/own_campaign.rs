//! Campaigns of one's own: `ballbot campaign FILE`.

use crate::closed_loops::files;
use crate::{assert_says, fail, succeed};
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::Command;

const CAMPAIGN: &str = r#"
title = "Let go"
scenario = "single-setpoint"
runs = 30
seed = 2

[set]
duration_s = 0.6

[[vary]]
key = "initial_state.theta_rad"
uniform = [-0.4, 0.4]

[[vary]]
key = "world.delay.transport_s"
uniform = [0.0, 0.1]

[success]
largest_tilt_rad.at_most = 0.3
"#;

/// A folder with a campaign.
fn folder_with(text: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("mine.toml"), text).unwrap();
    folder
}

const ALL: [&str; 11] = [
    "bands.png",
    "bands.svg",
    "inputs.png",
    "inputs.svg",
    "map.png",
    "map.svg",
    "parallel.png",
    "parallel.svg",
    "runs.csv",
    "runs.parquet",
    "summary.json",
];

/// Rows, summary and figures; a run of it repeated alone, with its trajectory.
#[test]
fn a_campaign_writes_rows_that_can_be_repeated() {
    let folder = folder_with(CAMPAIGN);
    let here = folder.path();
    let text = succeed(here, &["campaign", "mine.toml"]);
    assert_says(
        &text,
        &[
            "Let go: 30 runs",
            "Wilson, 95 %",
            "initial_state.theta_rad",
            "out/mine",
        ],
    );
    let out = here.join("out/mine");
    assert_eq!(files(&out), ALL);
    let rows = fs::read_to_string(out.join("runs.csv")).unwrap();
    let rows: Vec<Vec<&str>> = rows.lines().map(|row| row.split(',').collect()).collect();
    assert_eq!(rows.len(), 31);
    let index = |name: &str| rows[0].iter().position(|column| *column == name).unwrap();

    let summary: Value =
        serde_json::from_slice(&fs::read(out.join("summary.json")).unwrap()).unwrap();
    let failures = rows[1..]
        .iter()
        .filter(|row| row[index("success")] == "false")
        .count();
    assert_eq!(summary["failures"].as_u64(), Some(failures as u64));
    assert!((1..30).contains(&failures), "{failures}");
    assert_eq!(summary["sensitivities"].as_array().unwrap().len(), 2);

    let replayed = succeed(
        here,
        &["campaign", "replay", "mine.toml", "--run", "17", "--json"],
    );
    let replayed: Value = serde_json::from_str(&replayed).unwrap();
    for (name, cell) in rows[0].iter().zip(&rows[18]) {
        let again = match &replayed[*name] {
            Value::Null => String::new(),
            Value::String(text) => text.clone(),
            Value::Number(number) if number.is_f64() => format!("{:?}", number.as_f64().unwrap()),
            other => other.to_string(),
        };
        assert_eq!(again, *cell, "{name}");
    }
    let run = files(&out.join("run-17"));
    assert_eq!(run[..2], ["figure.png", "figure.svg"]);
    assert!(run.contains(&"trajectory.csv".to_owned()));
    let message = fail(here, &["campaign", "replay", "mine.toml", "--run", "30"], 1);
    assert_says(&message, &["run = 30", "0 to 29"]);
}

/// To the bit what one piece has; what is done is not run again; what is missing or broken is said.
#[test]
fn shards_are_merged_and_resumed() {
    let folder = folder_with(CAMPAIGN);
    let here = folder.path();
    succeed(
        here,
        &["campaign", "mine.toml", "--out", "whole", "--threads", "1"],
    );
    let part = ["campaign", "mine.toml", "--out", "parts"];
    let with = |more: &[&'static str]| [&part[..], more].concat();
    assert_says(
        &succeed(here, &with(&["--shard", "2/3"])),
        &["runs 10 to 19"],
    );
    let shard = here.join("parts/shards/shard-00002-of-00003.parquet");
    let written = fs::metadata(&shard).unwrap().modified().unwrap();

    assert_says(
        &succeed(here, &["campaign", "status", "parts"]),
        &["1 of 3", "missing: 1,3"],
    );
    assert_says(
        &fail(here, &["campaign", "merge", "parts"], 1),
        &["0 to 9, 20 to 29"],
    );
    assert_says(
        &fail(here, &with(&["--shard", "1/4"]), 1),
        &["3 in number, not 4", "--out"],
    );
    assert_eq!(
        files(&here.join("parts")),
        ["shards/plan.json", "shards/shard-00002-of-00003.parquet"]
    );

    let half = fs::read(&shard).unwrap();
    fs::write(&shard, &half[..half.len() / 2]).unwrap();
    assert_says(
        &succeed(here, &["campaign", "status", "parts"]),
        &["broken", "cut off"],
    );
    assert_says(
        &fail(here, &with(&["--shards", "3"]), 1),
        &["shard-00002", "cut off"],
    );
    fs::remove_file(&shard).unwrap();
    assert_says(
        &succeed(here, &with(&["--shard", "2/3"])),
        &["runs 10 to 19"],
    );
    assert!(fs::read(&shard).unwrap() == half);
    let written_again = fs::metadata(&shard).unwrap().modified().unwrap();
    assert!(written_again >= written);
    assert_says(&succeed(here, &with(&["--shard", "2/3"])), &["is done"]);

    let killed = here.join("parts/shards/.shard-00001-of-00003.parquet.7.part");
    fs::write(&killed, "half").unwrap();
    succeed(here, &with(&["--shards", "3"]));
    assert!(!killed.exists());
    assert_eq!(
        fs::metadata(&shard).unwrap().modified().unwrap(),
        written_again
    );
    for name in ALL.iter().filter(|name| **name != "summary.json") {
        let [whole, parts] =
            ["whole", "parts"].map(|dir| fs::read(here.join(dir).join(name)).unwrap());
        assert!(whole == parts, "{name}");
    }
    // What the campaign says now is another one.
    fs::write(
        here.join("mine.toml"),
        CAMPAIGN.replace("seed = 2", "seed = 3"),
    )
    .unwrap();
    assert_says(
        &fail(here, &["campaign", "merge", "parts"], 1),
        &["changed since"],
    );
    fs::write(here.join("parts/shards/plan.json"), "{").unwrap();
    assert_says(
        &fail(here, &["campaign", "merge", "parts"], 1),
        &["plan.json is no plan of shards"],
    );
}

/// A client of a cluster that keeps to the form of HyperQueue's answers: `submit` runs all tasks.
const CLIENT: &str = r#"#!/bin/sh
echo "$*" >> calls
case "$*" in
*"server info"*) echo '{"server_uid": "x"}' ;;
*"submit"*)
    array=$(echo "$*" | sed 's/.*--array \([0-9,-]*\) .*/\1/')
    while [ "$1" != -- ]; do shift; done
    shift
    for range in $(echo "$array" | tr , ' '); do
        for id in $(seq "${range%-*}" "${range#*-}"); do
            [ -f failed ] || HQ_TASK_ID=$id "$@" || echo x >> failed
        done
    done
    echo '{"id": 7}' ;;
*"job info"*)
    failed=0; [ -f failed ] && failed=1
    echo "[{\"info\": {\"name\": \"x\", \"task_stats\": {\"running\": 0, \"waiting\": 0, \
        \"failed\": $failed, \"canceled\": 0, \"aborted\": 0}}}]" ;;
esac
"#;

#[cfg(unix)]
#[test]
fn a_cluster_runs_what_is_missing() {
    use std::os::unix::fs::PermissionsExt;
    let folder = folder_with(CAMPAIGN);
    let here = folder.path();
    let client = here.join("client");
    fs::write(&client, CLIENT).unwrap();
    fs::set_permissions(&client, fs::Permissions::from_mode(0o755)).unwrap();
    let run = |client: &Path, more: &[&str]| {
        Command::new(env!("CARGO_BIN_EXE_ballbot"))
            .current_dir(here)
            .env("HQ", client)
            .args([
                "campaign",
                "mine.toml",
                "--out",
                "parts",
                "--shards",
                "3",
                "--cluster",
            ])
            .arg("hyperqueue")
            .args(more)
            .output()
            .unwrap()
    };
    let none = run(
        Path::new("/no/such/program"),
        &["--server-dir", "somewhere"],
    );
    assert_eq!(none.status.code(), Some(1));
    let message = String::from_utf8(none.stderr).unwrap();
    assert_says(
        &message,
        &["no HyperQueue server with somewhere", "hq server start"],
    );

    succeed(
        here,
        &["campaign", "mine.toml", "--out", "parts", "--shard", "2/3"],
    );
    let done = run(&client, &[]);
    assert!(
        done.status.success(),
        "{}",
        String::from_utf8_lossy(&done.stderr)
    );
    assert_says(
        &fs::read_to_string(here.join("calls")).unwrap(),
        &["--array 1,3 "],
    );
    succeed(here, &["campaign", "mine.toml", "--out", "whole"]);
    let [whole, parts] =
        ["whole", "parts"].map(|dir| fs::read(here.join(dir).join("runs.parquet")));
    assert!(whole.unwrap() == parts.unwrap());

    // A task that fails: what the others did is kept.
    fs::remove_file(here.join("parts/shards/shard-00001-of-00003.parquet")).unwrap();
    fs::write(here.join("failed"), "").unwrap();
    let failed = run(&client, &[]);
    assert_eq!(failed.status.code(), Some(1));
    assert_says(
        &String::from_utf8(failed.stderr).unwrap(),
        &["1 tasks of HyperQueue job 7 failed"],
    );
}

#[test]
fn runs_stop_when_the_share_is_known() {
    let text = CAMPAIGN
        .replace("runs = 30", "runs = 4000")
        .replace("duration_s = 0.6", "duration_s = 0.1")
        + "[stop]\nfailure_share_within = 0.08\n";
    let folder = folder_with(&text);
    let here = folder.path();
    let summary = succeed(here, &["campaign", "mine.toml", "--json"]);
    let summary: Value = serde_json::from_str(&summary).unwrap();
    let (runs, share) = (summary["runs"].as_u64().unwrap(), &summary["failure_share"]);
    assert!((200..500).contains(&runs), "{runs}");
    assert_eq!(summary["known_as_asked"], true);
    // A tilt beyond 0.3 of up to 0.4 rad is a failure at once, and so for the most part.
    assert!(
        share["lower"].as_f64() < Some(0.3) && share["upper"].as_f64() > Some(0.25),
        "{share}"
    );
    assert_says(
        &fail(here, &["campaign", "mine.toml", "--shard", "1/2"], 2),
        &["[stop]", "one piece"],
    );
    // As many as there are may be too few.
    fs::write(
        here.join("mine.toml"),
        text.replace("runs = 4000", "runs = 20"),
    )
    .unwrap();
    let said = succeed(here, &["campaign", "mine.toml"]);
    assert_says(&said, &["not known to ±0.08", "more runs"]);
}

#[test]
fn a_rare_failure_is_estimated() {
    let text = CAMPAIGN
        .replace("runs = 30\n", "")
        .replace("duration_s = 0.6", "duration_s = 0.1");
    let (text, _) = text.split_once("[success]").unwrap();
    let text =
        format!("{text}[rare]\nmeasure = \"largest_tilt_rad\"\nabove = 0.399\nlevel_runs = 200\n");
    let folder = folder_with(&text);
    let here = folder.path();
    assert_says(
        &succeed(here, &["campaign", "mine.toml"]),
        &["largest_tilt_rad above 0.399", "probability"],
    );
    let out = here.join("out/mine");
    assert_eq!(files(&out), ["failures.csv", "levels.csv", "summary.json"]);
    let failures = fs::read_to_string(out.join("failures.csv")).unwrap();
    assert!(failures.starts_with("world.seed,initial_state.theta_rad,world.delay.transport_s\n"));
}

#[test]
fn what_does_not_go_is_refused() {
    let folder = folder_with(CAMPAIGN);
    let here = folder.path();
    for (arguments, part) in [
        (vec!["mine.toml", "--runs", "5"], "--runs"),
        (vec!["mine.toml", "--set", "a=1"], "[set]"),
        (vec!["--shard", "1/2"], "campaign of your own"),
        (vec!["mine.toml", "--shard", "3/2"], "3/2"),
        (vec!["mine.toml", "--cluster", "hyperqueue"], "--shards"),
    ] {
        let arguments = [vec!["campaign"], arguments].concat();
        assert_says(&fail(here, &arguments, 2), &[part]);
    }
    for command in ["status", "merge"] {
        let said = fail(here, &["campaign", command, "nowhere"], 1);
        assert_says(&said, &["nowhere has no shards"]);
    }
    // So many rows that no disk has room for them, and as many as are asked about.
    fs::write(
        here.join("mine.toml"),
        CAMPAIGN.replace("runs = 30", "runs = 1000000000000"),
    )
    .unwrap();
    assert_says(
        &fail(here, &["campaign", "mine.toml", "--yes"], 1),
        &["1000000000000 rows need", "GB"],
    );
    fs::write(
        here.join("mine.toml"),
        CAMPAIGN.replace("runs = 30", "runs = 6000000"),
    )
    .unwrap();
    assert_says(&fail(here, &["campaign", "mine.toml"], 2), &["--yes"]);
    assert_eq!(files(here), ["mine.toml"]);
    // A file of the user's is not overwritten.
    fs::write(here.join("mine.toml"), CAMPAIGN).unwrap();
    fs::create_dir_all(here.join("out/mine")).unwrap();
    fs::write(here.join("out/mine/runs.csv"), "mine").unwrap();
    assert_says(
        &fail(here, &["campaign", "mine.toml"], 1),
        &["runs.csv", "--out"],
    );
    assert_eq!(
        fs::read_to_string(here.join("out/mine/runs.csv")).unwrap(),
        "mine"
    );
}

/// What is printed as an example is a campaign.
#[test]
fn the_example_is_the_one_of_the_documentation() {
    let folder = tempfile::tempdir().unwrap();
    let text = succeed(folder.path(), &["campaign", "example"]);
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/examples/campaigns");
    let file = path.join("delay-and-slope.toml");
    assert_eq!(fs::read_to_string(&file).unwrap(), text);
    let source = ballbot_campaign::Source::load(&file).unwrap();
    let campaign = ballbot_campaign::Campaign::new(&source, source.folder(), "test").unwrap();
    campaign.run(1, &|| std::time::Duration::ZERO).unwrap();
}
