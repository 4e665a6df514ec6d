//! `ballbot identify` and `ballbot excite`.

use crate::{assert_says, failure, json, numbers, text};
use ballbot_identification::log::BallAngle;
use ballbot_identification::{ExcitationTask, Parameter, Robot, Values};
use nalgebra::{Vector3, Vector4};
use std::fmt::Write as _;
use std::path::Path;

/// A robot with a delay of two rows and a tilt offset.
fn robot() -> ExcitationTask {
    let mut robot = Values([0.0; Parameter::ALL.len()]);
    for (parameter, value) in [
        (Parameter::B1, 0.0387),
        (Parameter::B2, 0.02),
        (Parameter::B3, 0.1487),
        (Parameter::RollingFriction, 0.01),
        (Parameter::DriveFriction, 0.03),
        (Parameter::TorqueGain, 0.1),
        (Parameter::Delay, 0.01),
        (Parameter::TiltOffset, 0.01),
    ] {
        robot[parameter] = value;
    }
    ExcitationTask {
        robot,
        geometry: ballbot::Geometry::paper(),
        choices: Values::usual(),
        band: (0.2, 6.0),
        harmonics: 15,
        amplitude: 2.0,
        duration: 12.0,
        tilt_limit: 0.3,
        rate: 200.0,
        noise: Vector3::new(1e-3, 1e-3, 5e-3),
        gain: None,
        segment: 1.0,
        gyroscope: true,
    }
}

/// A log of that robot, its noise even and of the same variance as a normal one.
fn log() -> String {
    let task = robot();
    let excitation = task.design().unwrap();
    let robot = Robot::new(task.robot, task.geometry);
    let mut rng = fastrand::Rng::with_seed(7);
    let mut even = || 12.0_f64.sqrt() * (rng.f64() - 0.5);
    let mut text = "t_s,phi_rad,theta_rad,theta_dot_rad_s,torque_commanded_nm\n".to_owned();
    let (mut x, mut torques) = (Vector4::zeros(), vec![0.0; 2]);
    for (time, added) in excitation.time.iter().zip(&excitation.torque) {
        let noise = task.noise.map(|deviation| deviation * even());
        let outputs = robot.outputs(&x, BallAngle::Inertial) + noise;
        let torque = added - excitation.gain.dot(&x);
        let [phi, theta, rate] = outputs.into();
        writeln!(text, "{time},{phi},{theta},{rate},{torque}").unwrap();
        torques.push(torque);
        for _ in 0..5 {
            x = robot.step(&x, torques[torques.len() - 3], 1e-3);
        }
    }
    text
}

fn name(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// Its standard deviations were smaller by 1 / sqrt(2).
#[test]
fn a_log_that_is_named_twice_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let [first, second] = ["a.csv", "b.csv"].map(|file| folder.path().join(file));
    std::fs::write(&first, log()).unwrap();
    std::fs::copy(&first, &second).unwrap();
    for again in [&first, &second] {
        let message = failure(&["identify", name(&first), name(again)], 1);
        let expected = format!(
            "{}: it has the same content as {}",
            name(again),
            name(&first)
        );
        assert_says(&message, &[&expected, "name it once"]);
    }
}

#[test]
fn a_log_becomes_parameters_a_report_and_words() {
    let folder = tempfile::tempdir().unwrap();
    let (log_file, out) = (folder.path().join("log.csv"), folder.path().join("out"));
    std::fs::write(&log_file, log()).unwrap();
    let summary = text(&[
        "identify",
        name(&log_file),
        "--out",
        name(&out),
        "--published",
    ]);
    assert_says(
        &summary,
        &[
            "the lengths are those of the paper's robot",
            "b1_m2",
            "95 % interval",
            "good: a rigid ballbot can have these parameters",
            "The published chain",
        ],
    );
    assert!(!summary.contains("WARNING"), "{summary}");

    let parameters = out.join("parameters.toml");
    let table: toml::Table = std::fs::read_to_string(&parameters)
        .unwrap()
        .parse()
        .unwrap();
    let b1 = table["parameters"]["b1_m2"].as_float().unwrap();
    assert!((b1 / 0.0387 - 1.0).abs() < 0.03, "{b1}");
    let delay = table["identification"]["delay_s"]["value"]
        .as_float()
        .unwrap();
    assert!((delay - 0.01).abs() < 1e-3, "{delay}");
    let covariance = table["identification"]["covariance"]["matrix"]
        .as_array()
        .unwrap();
    let deviation = table["identification"]["b1_m2"]["standard_deviation"]
        .as_float()
        .unwrap();
    let variance = covariance[0][0].as_float().unwrap();
    assert!((variance.sqrt() / deviation - 1.0).abs() < 1e-9);

    // Other commands take it. Its torque is in N m: p4 = b1 l g / d, p6 = (k - b1) r_b / (r_w d) / m.
    let model = json(&["linearize", "--json", "--parameters", name(&parameters)]);
    let b = model["b"].as_array().unwrap();
    let p6 = numbers(&b[3])[0];
    let k: f64 = 0.02 - 0.2978 * 0.12;
    let d = 0.0387 * 0.1487 - k * k;
    let expected = (k - 0.0387) * 0.12 / (0.05 * d) * 0.1;
    assert!((p6 / expected - 1.0).abs() < 0.05, "{p6} for {expected}");

    let report = std::fs::read_to_string(out.join("report.html")).unwrap();
    for part in [
        "Verdict",
        "<svg",
        "Poles",
        "published chain",
        "Correlations",
    ] {
        assert!(report.contains(part), "{part}");
    }
    for figure in ["fit", "residuals", "correlations", "predictions"] {
        assert!(
            out.join("figures")
                .join(figure)
                .with_extension("png")
                .exists()
        );
    }

    // And an excitation is designed for what was found.
    let torque = folder.path().join("torque.csv");
    let words = text(&[
        "excite",
        "--parameters",
        name(&parameters),
        "--amplitude",
        "50",
        "--tilt-limit",
        "5",
        "-o",
        name(&torque),
    ]);
    assert_says(&words, &["the tilt limits it", "delay_s", "Cramer-Rao"]);
    let csv = std::fs::read_to_string(&torque).unwrap();
    assert!(csv.starts_with("t_s,torque_excitation_nm\n0,0\n"));
    assert_eq!(csv.lines().count(), 4001);
}

#[test]
fn the_example_is_a_configuration() {
    let folder = tempfile::tempdir().unwrap();
    let config = folder.path().join("robot.toml");
    std::fs::write(&config, text(&["identify", "--example"])).unwrap();
    let out = folder.path().join("torque.csv");
    text(&["excite", "--config", name(&config), "--out", name(&out)]);
}

#[test]
fn what_cannot_be_used_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str, content: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, content).unwrap();
        path
    };
    failure(&["identify"], 2);
    let message = failure(&["identify", "none.csv"], 1);
    assert_says(&message, &["none.csv", "cannot be read"]);
    let empty = file("empty.csv", "");
    assert_says(
        &failure(&["identify", name(&empty)], 1),
        &["empty.csv: is empty"],
    );
    let config = file("robot.toml", "[parameters]\nmass = \"free\"\n");
    let good = file("log.csv", &log());
    let message = failure(&["identify", name(&good), "--config", name(&config)], 1);
    assert_says(&message, &["robot.toml", "parameters.mass", "b1_m2"]);
    let short = file(
        "short.csv",
        &log().lines().take(121).collect::<Vec<_>>().join("\n"),
    );
    let message = failure(&["identify", name(&short)], 1);
    assert_says(&message, &["no stretch of 1 s"]);
    let message = failure(&["excite", "--length", "3", "-o", name(&empty)], 1);
    assert_says(&message, &["the length is 3", "10.0 s"]);
}

/// The log with a column of it multiplied.
fn scaled(column: usize, factor: f64) -> String {
    let text = log();
    let (header, rows) = text.split_once('\n').unwrap();
    let rows = rows.lines().map(|row| {
        let fields = row.split(',').enumerate().map(|(place, field)| {
            let value: f64 = field.parse().unwrap();
            (if place == column {
                factor * value
            } else {
                value
            })
            .to_string()
        });
        fields.collect::<Vec<_>>().join(",") + "\n"
    });
    format!("{header}\n{}", rows.collect::<String>())
}

/// A simulated log without noise is that of its robot, to rounding.
#[test]
fn a_log_without_noise_is_fitted_to_rounding() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let (log_file, run) = (path("log.csv"), path("run"));
    text(&[
        "simulate",
        "one-metre",
        "--log",
        name(&log_file),
        "--out",
        name(&run),
    ]);
    let out = path("out");
    let told = json(&["identify", name(&log_file), "--json", "--out", name(&out)]);
    for (key, truth) in [("b1_m2", 0.0294), ("b2_m2", 0.01), ("b3_m2", 0.1487)] {
        let found = told["parameters"][key]["value"].as_f64().unwrap();
        assert!((found - truth).abs() < 1e-6 * truth, "{key}: {found}");
    }
}

/// What is odd about a log may be why there is no robot in it.
#[test]
fn what_the_log_shows_is_said_with_the_reasons() {
    let folder = tempfile::tempdir().unwrap();
    let (log_file, out) = (folder.path().join("log.csv"), folder.path().join("out"));
    let text = scaled(4, -1.0);
    let lines: Vec<&str> = text.lines().collect();
    std::fs::write(
        &log_file,
        [&lines[..1000], &lines[1100..]].concat().join("\n"),
    )
    .unwrap();
    let arguments = ["identify", name(&log_file), "--out", name(&out)];
    let message = failure(&[&arguments[..], &["--leave-out", "900,910"]].concat(), 1);
    assert_says(
        &message,
        &[
            "no parameters",
            "log.csv: 1 gap",
            "log.csv: nothing of the log is from 900 to 910 s",
        ],
    );
}

#[test]
fn what_is_no_robot_has_a_report_and_no_parameters() {
    let folder = tempfile::tempdir().unwrap();
    let (log_file, out) = (folder.path().join("log.csv"), folder.path().join("out"));
    std::fs::write(&log_file, scaled(4, -1.0)).unwrap();
    let arguments = ["identify", name(&log_file), "--out", name(&out)];
    let message = failure(&arguments, 1);
    assert_says(
        &message,
        &[
            "no parameters",
            "the torque has the other sign: set factor = -1.0 in [log.torque]",
            "report.html",
        ],
    );
    assert!(!message.contains("NaN"), "{message}");
    assert!(!out.join("parameters.toml").exists());
    let report = std::fs::read_to_string(out.join("report.html")).unwrap();
    assert!(report.contains("NO RESULT:") && !report.contains("good:"));
    assert!(!report.contains("NaN"));

    // A file that an earlier run left is not taken for the result of this one.
    let good = folder.path().join("good.csv");
    std::fs::write(&good, log()).unwrap();
    text(&["identify", name(&good), "--out", name(&out)]);
    let earlier = std::fs::read_to_string(out.join("parameters.toml")).unwrap();
    let message = failure(&arguments, 1);
    assert_says(
        &message,
        &["parameters.toml is of an earlier identification"],
    );
    let now = std::fs::read_to_string(out.join("parameters.toml")).unwrap();
    assert_eq!(now, earlier);
}

#[test]
fn results_are_told_to_other_programs_with_the_files_that_were_written() {
    let folder = tempfile::tempdir().unwrap();
    let (log_file, out) = (folder.path().join("log.csv"), folder.path().join("out"));
    std::fs::write(&log_file, log()).unwrap();
    let arguments = ["identify", name(&log_file), "--out", name(&out)];
    let told = json(&[&arguments[..], &["--json"]].concat());
    let b1 = &told["parameters"]["b1_m2"];
    let [least, most] = [0, 1].map(|end| numbers(&b1["interval_95"])[end]);
    let value = b1["value"].as_f64().unwrap();
    assert!(least < value && value < most && b1["status"] == "found");
    assert!((value / 0.0387 - 1.0).abs() < 0.03, "{value}");
    assert_eq!(told["parameters"]["torque_bias_nm"]["status"], "held");
    let verdicts = told["verdicts"].as_array().unwrap();
    assert!(verdicts.iter().any(|verdict| verdict["weight"] == "good"));
    assert_eq!(told["folder"], name(&out));

    // The same files on the screen, and no others in the folder but the list of them.
    let files: Vec<&str> = told["files"]
        .as_array()
        .unwrap()
        .iter()
        .map(|one| one.as_str().unwrap())
        .collect();
    assert_says(&text(&arguments), &[&files.join(", ")]);
    let mut found = Vec::new();
    for (prefix, folder) in [("", out.clone()), ("figures/", out.join("figures"))] {
        for entry in std::fs::read_dir(folder).unwrap() {
            let entry = entry.unwrap();
            let file = entry.file_name().into_string().unwrap();
            if entry.path().is_file() && !file.starts_with('.') {
                found.push(format!("{prefix}{file}"));
            }
        }
    }
    let mut expected = files.clone();
    found.sort();
    expected.sort_unstable();
    assert_eq!(found, expected);

    let torque = folder.path().join("torque.csv");
    let told = json(&["excite", "--json", "--out", name(&torque)]);
    assert_eq!(numbers(&told["gain"]).len(), 4);
    assert_eq!(told["file"], name(&torque));
    let b1 = &told["parameters"]["b1_m2"]["expected_standard_deviation"];
    assert!(b1.as_f64().unwrap() > 0.0);
}

#[test]
fn where_nothing_can_be_written_is_found_out_before_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let taken = folder.path().join("file");
    std::fs::write(&taken, "mine").unwrap();
    // The log would be found missing next.
    let message = failure(&["identify", "none.csv", "--out", name(&taken)], 1);
    assert_says(&message, &["cannot write", name(&taken)]);
    let below = taken.join("torque.csv");
    let message = failure(&["excite", "--gain=1,4,1,8", "--out", name(&below)], 1);
    assert_says(&message, &["cannot write", "torque.csv"]);
    // Parameters that were written by hand are not replaced.
    let mine = folder.path().join("parameters.toml");
    std::fs::write(&mine, "[parameters]").unwrap();
    let message = failure(&["identify", "none.csv", "--out", name(folder.path())], 1);
    assert_says(&message, &["parameters.toml", "--out"]);
    assert_eq!(std::fs::read_to_string(&mine).unwrap(), "[parameters]");
}

#[test]
fn mistakes_in_a_configuration_are_told_without_the_words_of_a_programming_language() {
    let folder = tempfile::tempdir().unwrap();
    let config = folder.path().join("robot.toml");
    for (content, parts) in [
        (
            "[geometry]\nball_radius_m = \"12 cm\"",
            &["line 2", "expected a number"][..],
        ),
        ("geometry = 3", &["line 1", "expected a table"]),
        ("[log]\nleave_out = 3", &["line 2", "expected a list"]),
        (
            "[log]\nleave_out = [[1.0]]",
            &["line 2", "expected a list of length 2"],
        ),
        (
            "[log]\nleave_out = [[1.0, 2.0, 3.0]]",
            &["log.leave_out", "invalid length 3", "too many"],
        ),
        (
            "[log]\nball_angle = \"floor\"",
            &["line 2", "`inertial`", "`relative_to_body`"],
        ),
        (
            "[log.theta]\ncolumn = \"t\"\nunit = \"grad\"",
            &["line 3", "`rad`"],
        ),
        ("[log.y.theta]\ncolumn = \"t\"", &["missing", "`unit`"]),
        (
            "[parameters]\nb1_m2 = 0.3",
            &[
                "line 2",
                "expected the name of a kind in quotes, or a table",
            ],
        ),
        (
            "[parameters]\nb1_m2 = \"fixed\"",
            &["line 2", "needs a value or keys of its own"],
        ),
        (
            "[parameters]\nb1_m2 = { fixed = 0.1, start = 0.2 }",
            &["line 2", "only one may stand"],
        ),
        (
            "[parameters]\nb1_m2 = { prior = 0.1 }",
            &["line 2", "expected a table"],
        ),
        (
            "[parameters]\nb1_m2 = { prior = { mean = 0.1 } }",
            &["line 2", "`standard_deviation`"],
        ),
        ("[fit]\nphysical = 1", &["line 2", "expected true or false"]),
        (
            "[body]\nbody_mass_kg = \"10\"",
            &["line 2", "expected a number"],
        ),
        ("[wheels]", &["line 1", "`wheels`", "`geometry`"]),
        ("[log.wheels]\nplane = \"z\"", &["line 2", "`x`", "`y`"]),
        ("[geometry", &["line 1"]),
    ] {
        std::fs::write(&config, content).unwrap();
        let message = failure(&["excite", "--config", name(&config)], 1);
        assert_says(&message, &["robot.toml"]);
        assert_says(&message, parts);
        for word in [
            "struct", "enum", "tuple", "variant", "f64", "usize", "sequence", "boolean", "Table",
            "::",
        ] {
            assert!(!message.contains(word), "`{word}` is in: {message}");
        }
    }
}

#[test]
fn parameters_from_a_log_without_gyroscope_are_read_back() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str, content: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, content).unwrap();
        path
    };
    let log_file = file("log.csv", &log().replace("theta_dot_rad_s", "unused"));
    let config = file(
        "robot.toml",
        "[log.theta_dot]\ncolumn = \"\"\nunit = \"rad/s\"\n",
    );
    let out = folder.path().join("out");
    let summary = text(&[
        "identify",
        name(&log_file),
        "--config",
        name(&config),
        "--out",
        name(&out),
    ]);
    assert!(!summary.contains("NaN"), "{summary}");
    let parameters = out.join("parameters.toml");
    let written = std::fs::read_to_string(&parameters).unwrap();
    assert!(
        !written.contains("nan") && !written.contains("inf"),
        "{written}"
    );
    json(&["linearize", "--json", "--parameters", name(&parameters)]);
    let torque = folder.path().join("torque.csv");
    let words = text(&[
        "excite",
        "--config",
        name(&config),
        "--parameters",
        name(&parameters),
        "--out",
        name(&torque),
    ]);
    // What no column tells is not promised either.
    assert!(!words.contains("gyro_bias"), "{words}");
}

#[test]
fn the_examples_of_excite_work_and_useless_torques_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let torque = folder.path().join("torque.csv");
    let excite = |more: &[&'static str]| -> Vec<String> {
        let mut arguments = vec!["excite".to_owned()];
        arguments.extend(more.iter().map(ToString::to_string));
        arguments.extend(["--out".to_owned(), name(&torque).to_owned()]);
        arguments
    };
    let run = |more: &[&'static str]| {
        let arguments = excite(more);
        text(&arguments.iter().map(String::as_str).collect::<Vec<_>>())
    };
    // As `ballbot help excite` shows it.
    let help = text(&["help", "excite"]);
    let gain = "--gain=-1.4,-48,-1.8,-11";
    assert!(help.contains(gain), "{help}");
    run(&["--amplitude", "2", "--tilt-limit", "8", gain]);
    run(&["--gain", "-1.4,-48,-1.8,-11"]);
    assert_says(&run(&["--amplitude", "1000"]), &["the tilt limits it"]);
    assert_says(&run(&["--band", "0.2,5"]), &["0.20 Hz to 5.00 Hz"]);
    assert!(torque.exists());
    std::fs::remove_file(&torque).unwrap();
    let refuse = |more: &[&'static str], code: i32| {
        let arguments = excite(more);
        failure(
            &arguments.iter().map(String::as_str).collect::<Vec<_>>(),
            code,
        )
    };
    let message = refuse(&["--gain=-0.5,-12,-0.6,-2.5"], 1);
    assert_says(
        &message,
        &["does not hold the robot", "pole at +", "other sign"],
    );
    refuse(&["--gain=1.4,48,1.8,11"], 1);
    refuse(&["--gain=1,2,3"], 2);
    refuse(&["--band", "0.2"], 2);
    assert_says(&refuse(&["--amplitude", "1e-4"], 1), &["--amplitude"]);
    assert!(!torque.exists());
}

#[test]
fn a_part_of_a_log_is_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let (log_file, out) = (folder.path().join("log.csv"), folder.path().join("out"));
    std::fs::write(&log_file, log()).unwrap();
    let identify = |part: &'static str| {
        text(&[
            "identify",
            name(&log_file),
            "--out",
            name(&out),
            "--leave-out",
            part,
        ])
    };
    assert_says(&identify("3,4.5"), &["301 rows are left out"]);
    assert_says(&identify("1:3,4.5"), &["301 rows are left out"]);
    failure(&["identify", name(&log_file), "--leave-out", "2:3,4.5"], 2);
    failure(&["identify", name(&log_file), "--leave-out", "4.5,3"], 2);
}
