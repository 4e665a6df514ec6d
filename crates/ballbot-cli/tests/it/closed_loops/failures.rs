//! Runs that end early, results that cannot be written, scenarios that cannot be run.

use super::recorded::{self, assert_figure};
use super::{edited, files, with_section};
use crate::{assert_says, ballbot_in, fail, succeed};
use std::path::Path;

/// Scenario 1 with the terminal equality, which a set point too far away contradicts.
fn unreachable(reference: &str) -> String {
    let text = succeed(Path::new("."), &["scenario", "show", "two-setpoints"]);
    let text = with_section(
        &text,
        "[controller.terminal.continuous_riccati.linear_model]",
        "# [lower, upper]",
        "",
    );
    let text = edited(
        &text,
        "horizon = 20",
        "terminal = \"equality\"\nhorizon = 20",
    );
    let text = with_section(
        &text,
        "[reference.set_points]",
        "# The simulated",
        reference,
    );
    // Set points that jump within the horizon contradict it, too.
    edited(&text, "duration_s = 4.0", "duration_s = 6.0")
}

/// Runs the scenario, which ends early; the message, and the folder with `out/my`.
fn ended_early(text: &str) -> (String, tempfile::TempDir) {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("my.toml"), text).unwrap();
    let message = fail(folder.path(), &["simulate", "my.toml"], 1);
    (message, folder)
}

#[test]
fn an_infeasible_problem_keeps_what_was_recorded() {
    let (message, folder) = ended_early(&unreachable(
        "[reference.set_points]\n\
         points = [{ time_s = 0.0, phi_rad = 0.5 }, { time_s = 4.0, phi_rad = 400.0 }]",
    ));
    let results = folder.path().join("out/my");
    let (rows, end) = recorded::trajectory(&results.join("trajectory.csv"));
    // The jump at 4 s comes into sight one horizon, 1 s, before.
    assert_eq!(rows.len(), 60);
    assert!((end.t - 3.0).abs() < 1e-9);
    assert!((end.state[0] - 0.5).abs() < 1e-2, "{end:?}");
    assert_says(&end.status, &["no plan at t = 3.000 s", "infeasible"]);
    // Time, bound, state, and where the record is; in words, not in indices.
    assert_says(
        &message,
        &[
            "the run ended early",
            "t = 3.000 s",
            "terminal equality of phi at stage 20 cannot be met",
            "at stage ",
        ],
    );
    let state = format!("phi = {:.4} rad", end.state[0]);
    assert_says(
        &message,
        &[&state, "theta = ", "phi_dot = ", "theta_dot = "],
    );
    assert_says(
        &message,
        &[&Path::new("out").join("my").display().to_string()],
    );
    assert!(!message.contains("state 0"), "{message}");
    assert!(!message.contains("input 0"), "{message}");
    assert_figure(&results, "figure");
}

#[test]
fn an_infeasible_start_is_said_so() {
    // It was once the figure without a sample that was complained about, and nothing was kept.
    let (message, folder) = ended_early(&unreachable(
        "[reference.set_points]\npoints = [{ time_s = 0.0, phi_rad = 400.0 }]",
    ));
    assert_says(
        &message,
        &[
            "no plan at t = 0.000 s",
            "infeasible",
            "terminal equality of phi at stage 20 cannot be met",
        ],
    );
    let results = folder.path().join("out/my");
    let (rows, end) = recorded::trajectory(&results.join("trajectory.csv"));
    assert!(rows.is_empty());
    assert_eq!(end.state, [0.0; 4]);
    assert_eq!(
        files(&results),
        ["trajectory.csv"],
        "there is nothing to draw"
    );
}

/// From too far over it turns over, of whatever the controller is satisfied with.
#[test]
fn a_robot_that_falls_ends_its_run_without_a_world_too() {
    let folder = tempfile::tempdir().unwrap();
    for world in [&[][..], &["--set", "world.seed=1"]] {
        let start = [
            "simulate",
            "one-metre",
            "--set",
            "initial_state.theta_rad=0.6",
        ];
        let arguments = [&start[..], world, &["--out", "run"]].concat();
        let message = fail(folder.path(), &arguments, 1);
        assert_says(&message, &["the robot has fallen: theta left its range"]);
    }
}

#[test]
fn a_plane_that_ends_early_is_named_and_both_are_kept() {
    // The path on the floor once needed both planes to be of one length.
    for (x, y, early) in [("0.5", "400.0", "y"), ("400.0", "0.5", "x")] {
        let (message, folder) = ended_early(&unreachable(&format!(
            "[reference.planes.x.set_points]\n\
             points = [{{ time_s = 0.0, phi_rad = 0.5 }}, {{ time_s = 4.0, phi_rad = {x} }}]\n\
             [reference.planes.y.set_points]\n\
             points = [{{ time_s = 0.0, phi_rad = 0.5 }}, {{ time_s = 4.0, phi_rad = {y} }}]",
        )));
        assert_says(
            &message,
            &[&format!("the run of the {early} plane ended early")],
        );
        let results = folder.path().join("out/my");
        for plane in ["x", "y"] {
            let path = results.join(format!("trajectory_{plane}.csv"));
            if plane == early {
                assert_eq!(recorded::trajectory(&path).0.len(), 60);
            } else {
                recorded::complete(&path, 120, 0.05);
            }
        }
        assert_eq!(recorded::motors(&results.join("motors.csv")).len(), 60);
        for figure in ["figure", "motors", "path"] {
            assert_figure(&results, figure);
        }
    }
}

#[test]
fn results_that_cannot_be_written_leave_nothing_behind() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    for command in [&["simulate", "single-setpoint"][..], &["reproduce"]] {
        // A file where the folder should be.
        std::fs::write(here.join("taken"), "mine").unwrap();
        let arguments = [command, &["--out", "taken"]].concat();
        let message = fail(here, &arguments, 1);
        assert_says(&message, &["cannot write", "taken"]);
        assert_eq!(files(here), ["taken"]);
        assert_eq!(std::fs::read_to_string(here.join("taken")).unwrap(), "mine");
    }
    // A folder where the last of the files should be.
    let results = here.join("results");
    std::fs::create_dir_all(results.join("figure.png")).unwrap();
    std::fs::write(results.join("trajectory.csv"), "old").unwrap();
    std::fs::write(results.join(".ballbot-files"), "trajectory.csv\n").unwrap();
    let arguments = ["simulate", "single-setpoint", "--out", "results"];
    assert_says(&fail(here, &arguments, 1), &["cannot write", "figure.png"]);
    assert_eq!(files(&results), ["trajectory.csv"]);
    let old = std::fs::read_to_string(results.join("trajectory.csv")).unwrap();
    assert_eq!(old, "old");
}

#[test]
fn files_of_others_are_refused_before_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    std::fs::create_dir(here.join("keep")).unwrap();
    // Names that a run of two planes would have, and that a run of one plane once removed.
    for (name, command) in [
        ("motors.csv", &["simulate", "single-setpoint"][..]),
        ("report.html", &["reproduce"]),
        ("campaign.csv", &["campaign", "--runs", "1"]),
        ("certificate.json", &["certify"]),
        ("optimality.csv", &["optimality"]),
    ] {
        let path = here.join("keep").join(name);
        std::fs::write(&path, "mine").unwrap();
        let message = fail(here, &[command, &["--out", "keep"]].concat(), 1);
        assert_says(&message, &["cannot write", name, "another folder"]);
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "mine");
        std::fs::remove_file(&path).unwrap();
        assert!(files(here).is_empty());
    }
    // A log in a place that cannot be is found out before, too.
    std::fs::write(here.join("taken"), "mine").unwrap();
    let arguments = ["simulate", "single-setpoint", "--log", "taken/log.csv"];
    assert_says(&fail(here, &arguments, 1), &["cannot write", "log.csv"]);
    assert_eq!(files(here), ["taken"]);
}

#[test]
fn work_of_no_size_is_refused() {
    for arguments in [
        &["campaign", "--threads", "0"][..],
        &["certify", "--boxes", "0"],
        &["excite", "--harmonics", "0"],
    ] {
        assert_says(&fail(Path::new("."), arguments, 2), &[arguments[1], "0"]);
    }
}

#[test]
fn broken_scenarios_leave_no_folder_behind() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    let good = succeed(here, &["scenario", "show", "two-setpoints"]);
    for (from, to, parts) in [
        ("t_s = 0.05", "t_s = ", &["line 22"][..]),
        ("horizon = 20", "horizn = 20", &["horizn", "horizon"]),
        ("horizon = 20", "horizon = 0", &["controller.horizon = 0"]),
        ("r = 1000.0", "r = -1.0", &["controller.r = -1", "positive"]),
        ("t_s = 0.05", "t_s = 0.06", &["t_s", "-51.8"]),
        ("b1_m2 = 0.002483", "b1_m2 = 0.009", &["crosses zero"]),
        (
            "duration_s = 4.0",
            "duration_s = inf",
            &["duration_s = inf"],
        ),
        (
            "relative_tolerance = 1e-10",
            "relative_tolerance = 0.0",
            &["integration", "1e-14"],
        ),
        (
            "[controller.terminal.continuous_riccati.linear_model]",
            "[controller.terminal.cost]\n\
             p = [[1, 9, 0, 0], [9, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]\n[ignored]",
            &["ignored"],
        ),
    ] {
        std::fs::write(here.join("my.toml"), edited(&good, from, to)).unwrap();
        assert_says(&fail(here, &["simulate", "my.toml"], 1), parts);
        assert_eq!(files(here), ["my.toml"], "after {to}");
        assert!(!here.join("out").exists(), "after {to}");
    }
    // A matrix without any single wrong entry: an indefinite P.
    let indefinite = with_section(
        &good,
        "[controller.terminal.continuous_riccati.linear_model]",
        "# [lower, upper]",
        "[controller.terminal.cost]\n\
         p = [[1, 9, 0, 0], [9, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]",
    );
    std::fs::write(here.join("my.toml"), indefinite).unwrap();
    let message = fail(here, &["simulate", "my.toml"], 1);
    assert_says(&message, &["controller.terminal.cost.p", "semidefinite"]);
    for missing in ["nothing.toml", "no/such/file"] {
        assert_says(
            &fail(here, &["simulate", missing], 1),
            &["cannot read", missing],
        );
    }
    assert!(!here.join("out").exists());
}

#[test]
fn what_is_no_command_line_is_refused() {
    let here = Path::new(".");
    for (arguments, parts) in [
        (
            &["simulat", "lissajous"][..],
            &["simulat", "'simulate'"][..],
        ),
        (&["simulate"], &["<SCENARIO>"]),
        (
            &["simulate", "lissajous", "--outs", "x"],
            &["--outs", "--out"],
        ),
        (&["scenario", "lst"], &["lst", "list"]),
        (&["reproduce", "lissajous"], &["lissajous"]),
    ] {
        assert_says(&fail(here, arguments, 2), parts);
    }
    assert_eq!(ballbot_in(here, &["scenario"]).status.code(), Some(2));
}
