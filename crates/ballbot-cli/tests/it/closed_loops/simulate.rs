//! `ballbot simulate`: what it writes.

use super::recorded::{self, assert_figure};
use super::{edited, files, with_section};
use crate::{assert_says, ballbot_in, fail, succeed};
use ballbot_scenario::{Scenario, builtin};
use serde_json::Value;
use std::path::Path;

/// The text of a built-in scenario, from the program.
fn shown(name: &str) -> String {
    succeed(Path::new("."), &["scenario", "show", name])
}

/// Runs the scenario in a folder of its own; the results are in `out/my`.
fn simulate(text: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("my.toml"), text).unwrap();
    succeed(folder.path(), &["simulate", "my.toml"]);
    folder
}

#[test]
fn every_built_in_scenario_runs_and_is_recorded() {
    let folder = tempfile::tempdir().unwrap();
    for builtin in builtin::ALL {
        let name = builtin.name;
        let scenario = Scenario::load(name).unwrap();
        let summary = succeed(folder.path(), &["simulate", name]);
        let out = format!("out/{name}");
        assert_says(&summary, &[&scenario.title, "largest tilt [rad]", &out]);

        let results = folder.path().join(&out);
        let samples = (scenario.duration_s / scenario.controller.t_s).round() as usize;
        let trajectories: &[&str] = if name == "lissajous" {
            &["trajectory_x.csv", "trajectory_y.csv"]
        } else {
            &["trajectory.csv"]
        };
        for trajectory in trajectories {
            let (rows, _) =
                recorded::complete(&results.join(trajectory), samples, scenario.controller.t_s);
            let [lower, upper] = scenario.bounds.torque_nm;
            for row in rows {
                assert!((lower..=upper).contains(&row.torque), "{name}: {row:?}");
            }
        }
        let figures: &[&str] = match name {
            "lissajous" => &["figure", "motors", "path", "plans_x", "plans_y"],
            // The plans of a descent are rollouts: there is no gap to show.
            "one-metre" => &["figure"],
            _ => &["figure", "plans"],
        };
        for figure in figures {
            assert_figure(&results, figure);
        }
        let motors = if name == "lissajous" { 1 } else { 0 };
        let expected = trajectories.len() + 2 * figures.len() + motors;
        assert_eq!(files(&results).len(), expected, "{:?}", files(&results));
    }
}

#[test]
fn the_motors_follow_from_both_planes() {
    let folder = tempfile::tempdir().unwrap();
    succeed(folder.path(), &["simulate", "lissajous", "--out", "a/b"]);
    let results = folder.path().join("a/b");
    let samples = 1400;
    let plane = |name: &str| recorded::complete(&results.join(name), samples, 0.05).0;
    let (x, y) = (plane("trajectory_x.csv"), plane("trajectory_y.csv"));
    let motors = recorded::motors(&results.join("motors.csv"));
    assert_eq!(motors.len(), samples);
    // Eq. (6) at 45 degrees without yaw: 1/cos(alpha) = sqrt(2).
    let (third, side) = (2_f64.sqrt() / 3.0, 6_f64.sqrt() / 3.0);
    for ((x, y), (t, motors)) in x.iter().zip(&y).zip(motors) {
        assert_eq!([x.t, y.t], [t, t]);
        let expected = [
            2.0 * third * x.torque,
            -third * x.torque + side * y.torque,
            -third * x.torque - side * y.torque,
        ];
        for (found, expected) in motors.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-14, "{found} for {expected}");
        }
    }
    // The planes follow the curve X = 0.12 * 2 pi sin(0.3 t), Y = 0.12 * 2 pi sin(0.4 t).
    for (plane, omega) in [(&x, 0.3), (&y, 0.4)] {
        for row in plane {
            let expected = std::f64::consts::TAU * (omega * row.t).sin();
            assert!((row.reference - expected).abs() < 1e-9, "{row:?}");
        }
        assert!(
            plane[100..]
                .iter()
                .all(|row| (row.state[0] - row.reference).abs() < 0.1)
        );
    }
}

#[test]
fn a_scenario_that_was_shown_runs_as_the_built_in_one() {
    let folder = simulate(&shown("tight-bounds"));
    succeed(folder.path(), &["simulate", "tight-bounds"]);
    let read = |name: &str| {
        let path = folder.path().join("out").join(name).join("trajectory.csv");
        recorded::trajectory(&path)
    };
    assert_eq!(read("my"), read("tight-bounds"));
}

#[test]
fn an_edited_scenario_runs_as_edited() {
    let text = shown("two-setpoints");
    let text = edited(&text, "horizon = 20", "horizon = 30");
    let text = edited(&text, "q = [200.0, 1.0", "q = [1000.0, 10.0");
    let text = edited(&text, "t_s = 0.05", "t_s = 0.04");
    let text = edited(&text, "duration_s = 4.0", "duration_s = 6.0");
    // Without a predictor the sub-steps are chosen.
    let text = with_section(&text, "[controller.predictor.rk4]", "# The end", "");
    let folder = simulate(&text);
    let results = folder.path().join("out/my");
    let (rows, end) = recorded::complete(&results.join("trajectory.csv"), 150, 0.04);
    assert!(end.iter().all(|entry| entry.abs() < 1e-2), "{end:?}");
    let farthest = rows.iter().map(|row| row.state[0]).fold(0.0, f64::max);
    assert!((6.0..7.0).contains(&farthest), "{farthest}");
    assert_figure(&results, "figure");
}

#[test]
fn a_reference_from_a_file_is_followed() {
    let folder = tempfile::tempdir().unwrap();
    let inner = folder.path().join("inner");
    std::fs::create_dir(&inner).unwrap();
    let path = |t: f64| 3.0 * (1.0 - (0.8 * t).cos());
    let lines = (0..=200).map(|k| f64::from(k) * 0.05);
    let lines: String = lines.map(|t| format!("{t},{}\n", path(t))).collect();
    std::fs::write(inner.join("path.csv"), format!("t_s,phi_ref_rad\n{lines}")).unwrap();
    let text = with_section(
        &edited(
            &shown("two-setpoints"),
            "duration_s = 4.0",
            "duration_s = 10.0",
        ),
        "[reference.set_points]",
        "# The simulated plant",
        "[reference.csv]\npath = \"path.csv\"",
    );
    std::fs::write(inner.join("my.toml"), text).unwrap();
    // The file is found beside the scenario, wherever the program is called from.
    succeed(folder.path(), &["simulate", "inner/my.toml"]);
    let results = folder.path().join("out/my");
    let (rows, _) = recorded::complete(&results.join("trajectory.csv"), 200, 0.05);
    for row in &rows {
        assert!((row.reference - path(row.t)).abs() < 1e-9, "{row:?}");
    }
    for row in &rows[40..] {
        assert!((row.state[0] - row.reference).abs() < 0.3, "{row:?}");
    }
}

#[test]
fn two_planes_with_references_of_their_own() {
    let text = with_section(
        &shown("two-setpoints"),
        "[reference.set_points]",
        "# The simulated plant",
        "[reference.planes.x.minimum_jerk]\n\
         points = [{ time_s = 0.5, phi_rad = 0.0 }, { time_s = 2.5, phi_rad = 4.0 }]\n\
         [reference.planes.y.minimum_jerk]\n\
         points = [{ time_s = 0.0, phi_rad = 1.0 }, { time_s = 3.0, phi_rad = -2.0 }]\n\
         [initial_state_y]\nphi_rad = 1.0",
    );
    let folder = simulate(&text);
    let results = folder.path().join("out/my");
    for (name, (start, from), (stop, to)) in [
        ("trajectory_x.csv", (0.5, 0.0), (2.5, 4.0)),
        ("trajectory_y.csv", (0.0, 1.0), (3.0, -2.0)),
    ] {
        let (rows, end) = recorded::complete(&results.join(name), 80, 0.05);
        assert_eq!(rows[0].state, [from, 0.0, 0.0, 0.0]);
        assert!((end[0] - to).abs() < 0.05, "{name}: {end:?}");
        for row in &rows {
            // The quintic with neither speed nor acceleration at its ends.
            let s = ((row.t - start) / (stop - start)).clamp(0.0, 1.0);
            let share = s.powi(3) * (10.0 - 15.0 * s + 6.0 * s * s);
            let expected = from + (to - from) * share;
            assert!((row.reference - expected).abs() < 1e-12, "{name}: {row:?}");
        }
    }
    assert_eq!(recorded::motors(&results.join("motors.csv")).len(), 80);
    for figure in ["figure", "motors", "path"] {
        assert_figure(&results, figure);
    }
}

#[test]
fn the_shortest_and_the_stillest_run_have_figures() {
    let one_sample = edited(
        &shown("single-setpoint"),
        "duration_s = 4.0",
        "duration_s = 0.01",
    );
    let folder = simulate(&one_sample);
    recorded::complete(&folder.path().join("out/my/trajectory.csv"), 1, 0.05);
    assert_figure(&folder.path().join("out/my"), "figure");

    // All costs are zero, on a logarithmic axis.
    let at_rest = with_section(
        &shown("two-setpoints"),
        "[reference.set_points]",
        "# The simulated plant",
        "[reference.set_points]\npoints = [{ time_s = 0.0, phi_rad = 0.0 }]",
    );
    let folder = simulate(&at_rest);
    let (rows, _) = recorded::complete(&folder.path().join("out/my/trajectory.csv"), 80, 0.05);
    assert!(rows.iter().all(|row| row.torque == 0.0 && row.cost == 0.0));
    assert_figure(&folder.path().join("out/my"), "figure");
}

#[test]
fn a_second_run_replaces_the_first() {
    let folder = simulate(&shown("single-setpoint"));
    let before = files(folder.path());
    succeed(folder.path(), &["simulate", "my.toml"]);
    assert_eq!(files(folder.path()), before);
}

#[test]
fn the_log_has_what_the_sensors_delivered_one_file_per_plane() {
    let folder = tempfile::tempdir().unwrap();
    let world = "\n[world]\nsensor_period_s = 0.01\n[world.sensors.theta]\ndropout = 0.5\n";
    let short = |name: &str| {
        let text = shown(name);
        let duration = text.lines().find(|line| line.starts_with("duration_s"));
        text.replace(duration.unwrap(), "duration_s = 1.0") + world
    };
    std::fs::write(folder.path().join("one.toml"), short("single-setpoint")).unwrap();
    std::fs::write(folder.path().join("two.toml"), short("lissajous")).unwrap();
    succeed(folder.path(), &["simulate", "one.toml", "--log", "one.csv"]);
    succeed(
        folder.path(),
        &["simulate", "two.toml", "--log", "logs/two.csv"],
    );
    for log in ["one.csv", "logs/two-x.csv", "logs/two-y.csv"] {
        let text = std::fs::read_to_string(folder.path().join(log)).unwrap();
        let mut lines = text.lines();
        assert_eq!(
            lines.next().unwrap(),
            "t_s,phi_rad,theta_rad,theta_dot_rad_s,torque_commanded_nm,torque_applied_nm"
        );
        let rows: Vec<Vec<&str>> = lines.map(|line| line.split(',').collect()).collect();
        assert_eq!(rows.len(), 100, "{log}: 1 s at 100 Hz");
        let missing = rows.iter().filter(|row| row[2].is_empty()).count();
        assert!(
            (20..80).contains(&missing),
            "{log}: {missing} of 100 tilts are missing"
        );
        for (k, row) in rows.iter().enumerate() {
            let t: f64 = row[0].parse().unwrap();
            assert!((t - 0.01 * k as f64).abs() < 1e-9, "{log}: {row:?}");
            assert!(row[1].parse::<f64>().unwrap().is_finite(), "{log}: {row:?}");
            // Without delay and lag the drive delivers what it is told, but for the rounding of
            // a mean.
            let [told, applied] = [4, 5].map(|i| row[i].parse::<f64>().unwrap());
            assert!(
                (told - applied).abs() <= 1e-15 * told.abs().max(1.0),
                "{log}: {row:?}"
            );
        }
    }
    assert!(!folder.path().join("logs/two.csv").exists());
}

#[test]
fn nothing_of_an_earlier_run_stays_in_the_folder() {
    // A run of one plane after one of two once left the curve and the motors of the first.
    let folder = tempfile::tempdir().unwrap();
    succeed(folder.path(), &["simulate", "lissajous", "--out", "same"]);
    let same = folder.path().join("same");
    std::fs::write(same.join("notes.txt"), "mine").unwrap();
    succeed(
        folder.path(),
        &["simulate", "single-setpoint", "--out", "same"],
    );
    // What it leaves is what a folder of its own has, and what is not a run's.
    succeed(folder.path(), &["simulate", "single-setpoint"]);
    let mut expected = files(&folder.path().join("out").join("single-setpoint"));
    expected.push("notes.txt".to_owned());
    expected.sort();
    assert_eq!(files(&same), expected);
}

#[test]
fn keys_are_set_on_the_command_line() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    let set = ["duration_s=1.0", "controller.horizon = 10", "title=Mine"];
    let points = "reference.set_points.points=[{time_s=0.0,phi_rad=1.0}]";
    let set = set
        .into_iter()
        .chain([points])
        .flat_map(|set| ["--set", set]);
    let command = ["simulate", "two-setpoints"].into_iter().chain(set);
    let said = succeed(here, &command.collect::<Vec<_>>());
    assert_says(
        &said,
        &["Mine: 20 samples", "from 0 s to 1 s", "closed-loop cost"],
    );
    recorded::complete(&here.join("out/two-setpoints/trajectory.csv"), 20, 0.05);
    for (set, code, parts) in [
        ("controller.horizn=3", 1, ["horizn", "horizon"]),
        (
            "controller.horizon=0",
            1,
            ["controller.horizon = 0", "from 1"],
        ),
        ("horizon", 2, ["horizon", "KEY=VALUE"]),
    ] {
        let message = fail(here, &["simulate", "two-setpoints", "--set", set], code);
        assert_says(&message, &parts);
    }
    let twice = [
        "--set",
        "controller.horizon=5",
        "--set",
        "controller.horizon=6",
    ];
    let command = [&["simulate", "two-setpoints"], &twice[..]].concat();
    assert_says(
        &fail(here, &command, 2),
        &["controller.horizon", "twice", "5", "6"],
    );
}

#[test]
fn other_programs_get_json_and_scripts_silence() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    let short = ["simulate", "lissajous", "--set", "duration_s=1.0"];
    let said = succeed(here, &[&short[..], &["--json"]].concat());
    let document: Value = serde_json::from_str(&said).unwrap();
    assert_eq!(document["samples"], 20);
    assert_eq!(document["window_s"], 1.0);
    let planes = document["planes"].as_array().unwrap();
    assert_eq!(planes.len(), 2);
    for plane in planes {
        assert_eq!(plane["samples"], 20);
        assert!(plane["closed_loop_cost"].as_f64().unwrap() > 0.0);
    }
    assert_eq!(succeed(here, &[&short[..], &["--quiet"]].concat()), "");
    assert_eq!(succeed(here, &[&["-q"], &short[..]].concat()), "");
    // What it prints is the result, and not a report of it.
    assert!(!succeed(here, &["--quiet", "scenario", "show", "lissajous"]).is_empty());
}

#[test]
fn a_line_about_readings_ends_as_every_line_does() {
    let folder = tempfile::tempdir().unwrap();
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/examples");
    let file = examples.join("push-and-move.toml");
    let short = ["--set", "duration_s=2.5"];
    let said = succeed(
        folder.path(),
        &[&["simulate", file.to_str().unwrap()], &short[..]].concat(),
    );
    let last = said.lines().last().unwrap();
    assert!(last.starts_with("readings: "), "{said}");
    assert!(said.ends_with(&format!("{last}\n")), "{said}");
}

/// They were dropped in silence.
#[test]
fn what_comes_after_the_end_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let told = |sets: &[&str]| {
        let sets = sets.iter().flat_map(|set| ["--set", set]);
        let arguments: Vec<&str> = ["simulate", "one-metre"].into_iter().chain(sets).collect();
        let output = ballbot_in(folder.path(), &arguments);
        assert!(output.status.success());
        String::from_utf8(output.stderr).unwrap()
    };
    let points = |time: &str| {
        format!(
            "reference.set_points.points=[{{time_s=0.0,phi_rad=0.0}},{{time_s={time},phi_rad=1.0}}]"
        )
    };
    let push = "world.pushes=[{rates={time_s=0.5}}, {impulse={time_s=1.5,momentum_m_s=0.1,height_m=0.3}}, \
                {force={from_s=9.0,until_s=inf,force_m_s2=0.1,height_m=0.3}}]";
    assert_eq!(
        told(&["duration_s=1.5", &points("1.6"), push]),
        "note: world.pushes[1].impulse.time_s = 1.5: the run ends at 1.5 s and does not come to it\n\
         note: world.pushes[2].force.from_s = 9: the run ends at 1.5 s and does not come to it\n"
    );
    // A set point that a plan looks at is not in vain.
    assert_eq!(told(&["duration_s=1.5", &points("1.6")]), "");
    assert_eq!(
        told(&["duration_s=1.5", &points("30.0")]),
        "note: reference.set_points.points[1].time_s = 30: the run ends at 1.5 s and does not come to it\n"
    );
}

/// It looked like a set point that was followed well.
#[test]
fn a_shaped_move_that_does_not_arrive_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let slow = [
        "simulate",
        "one-metre",
        "--set",
        "controller.shaping.tilt_rad=0.001",
    ];
    let said = succeed(folder.path(), &slow);
    assert_says(
        &said,
        &[
            "the set point of 8.3333 rad is not reached by the end of the run",
            "[controller.shaping]",
        ],
    );
    let document: Value =
        serde_json::from_str(&succeed(folder.path(), &[&slow[..], &["--json"]].concat())).unwrap();
    let plane = &document["planes"][0];
    let (goal, end) = (
        &plane["unreached_set_point_rad"],
        &plane["final_reference_rad"],
    );
    assert!((goal.as_f64().unwrap() - 25.0 / 3.0).abs() < 1e-9, "{goal}");
    let file = folder.path().join("out/one-metre/trajectory.csv");
    let (_, last) = recorded::trajectory(&file);
    assert!((end.as_f64().unwrap() - last.reference).abs() < 1e-9 && last.reference < 8.0);
    assert!(
        said.contains(&format!("ends at {:.4} rad", end.as_f64().unwrap())),
        "{said}"
    );
    let said = succeed(folder.path(), &["simulate", "one-metre"]);
    assert!(!said.contains("not reached"), "{said}");
}

#[test]
fn a_log_goes_to_standard_output_alone() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    succeed(here, &["simulate", "two-setpoints", "--log", "log.csv"]);
    let log = std::fs::read_to_string(here.join("log.csv")).unwrap();
    for more in [&[][..], &["--quiet"]] {
        let arguments = [&["simulate", "two-setpoints", "--log", "-"], more].concat();
        assert_eq!(succeed(here, &arguments), log);
    }
    assert!(!here.join("-").exists());
    for (arguments, words) in [
        (
            &["simulate", "two-setpoints", "--log", "-", "--json"][..],
            "--json",
        ),
        (&["simulate", "lissajous", "--log", "-"], "one per plane"),
    ] {
        assert_says(&fail(here, arguments, 2), &["--log -", words]);
    }
    assert!(!here.join("out/lissajous").exists());
}

#[test]
fn times_are_written_without_the_rounding_of_a_sum() {
    let folder = tempfile::tempdir().unwrap();
    succeed(
        folder.path(),
        &["simulate", "two-setpoints", "--log", "log.csv"],
    );
    for name in ["out/two-setpoints/trajectory.csv", "log.csv"] {
        let text = std::fs::read_to_string(folder.path().join(name)).unwrap();
        for line in text.lines().skip(1) {
            let time = line.split(',').next().unwrap();
            // It was once 0.15000000000000002.
            assert!(time.len() <= 4, "{name}: {time}");
        }
    }
}

/// A log that would take the place of what the run reads or writes is refused, and nothing has changed.
#[test]
fn a_log_takes_the_place_of_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    succeed(
        folder.path(),
        &["excite", "--length", "12", "--out", "torque.csv"],
    );
    let shown = shown("single-setpoint");
    let start = shown.find("[parameters]").unwrap();
    let end = start + shown[start..].find("\n\n").unwrap();
    std::fs::write(at("robot.toml"), &shown[start..end]).unwrap();
    let named = format!(
        "parameters = \"robot.toml\"\n{}{}",
        &shown[..start],
        &shown[end..]
    );
    let scenario = named + "\n[world]\nexcitation = \"torque.csv\"\n";
    std::fs::write(at("my.toml"), scenario).unwrap();
    let before = files(folder.path());
    for log in [
        "my.toml",
        "robot.toml",
        "torque.csv",
        "./torque.csv",
        "out/my/trajectory.csv",
    ] {
        let message = fail(folder.path(), &["simulate", "my.toml", "--log", log], 1);
        assert_says(&message, &[log, "would be lost"]);
    }
    for times in ["my.toml", "robot.toml", "torque.csv"] {
        let bench = ["bench", "my.toml", "--passes", "1", "--json", times];
        assert_says(&fail(folder.path(), &bench, 1), &[times, "would be lost"]);
    }
    assert_eq!(files(folder.path()), before);
    succeed(folder.path(), &["simulate", "my.toml", "--log", "log.csv"]);
}

/// A result of an earlier run that this one follows.
#[test]
fn results_take_the_place_of_nothing_that_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    succeed(here, &["simulate", "two-setpoints", "--out", "out/x"]);
    let trajectory = here.join("out/x/trajectory.csv");
    let before = std::fs::read(&trajectory).unwrap();
    let shown = shown("two-setpoints");
    let follow = with_section(
        &shown,
        "[reference.set_points]",
        "# The simulated",
        "[reference.csv]\npath = \"out/x/trajectory.csv\"",
    );
    std::fs::write(here.join("follow.toml"), follow).unwrap();
    let message = fail(here, &["simulate", "follow.toml", "--out", "out/x"], 1);
    assert_says(&message, &["trajectory.csv", "would be lost"]);
    assert_eq!(std::fs::read(&trajectory).unwrap(), before);
}

#[test]
fn a_log_on_standard_output_is_kept_when_the_run_ends_early() {
    let folder = tempfile::tempdir().unwrap();
    let run = [
        "simulate",
        "one-metre",
        "--set",
        "initial_state.theta_rad=0.6",
    ];
    let to_file = [&run[..], &["--log", "log.csv"]].concat();
    fail(folder.path(), &to_file, 1);
    let ended = ballbot_in(folder.path(), &[&run[..], &["--log", "-"]].concat());
    assert_eq!(ended.status.code(), Some(1));
    assert_eq!(
        ended.stdout,
        std::fs::read(folder.path().join("log.csv")).unwrap()
    );
}

/// A folder whose name JSON cannot have.
#[cfg(target_os = "linux")]
#[test]
fn a_path_that_is_no_text_is_shown_as_far_as_it_is() {
    use std::os::unix::ffi::OsStrExt;
    let folder = tempfile::tempdir().unwrap();
    let out = std::ffi::OsStr::from_bytes(b"caf\xe9");
    let ended = std::process::Command::new(env!("CARGO_BIN_EXE_ballbot"))
        .current_dir(folder.path())
        .args(["simulate", "two-setpoints", "--json", "--out"])
        .arg(out)
        .output()
        .unwrap();
    let document: Value = serde_json::from_slice(&ended.stdout).unwrap();
    assert_eq!(document["folder"], "caf\u{fffd}");
}

#[test]
fn a_run_without_a_sample_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let run = ["simulate", "two-setpoints", "--set", "duration_s=1e-12"];
    assert_says(
        &fail(folder.path(), &run, 1),
        &["duration_s", "at least one sample"],
    );
}
