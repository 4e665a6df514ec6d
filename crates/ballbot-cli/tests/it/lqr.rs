//! `ballbot lqr`, against the independently computed gains.

use crate::{assert_close, assert_says, ballbot, fail, failure, json, numbers, succeed, text};
use serde_json::Value;

fn diagonal(p: &Value) -> Vec<f64> {
    (0..4).map(|i| p[i][i].as_f64().unwrap()).collect()
}

fn largest_real_part(result: &Value) -> f64 {
    let pole = &result["frozen_stability"]["slowest_pole_1_s"];
    pole["re"].as_f64().unwrap()
}

/// The weights of the paper's first scenario.
const PAPER: [&str; 4] = ["--q", "200,1,0.1,0.1", "--r", "1000"];

/// The regulator of the least-squares b rather than the printed one, with the paper's weights.
fn of_refined(arguments: &[&str]) -> Value {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("refined.toml");
    let path = path.to_str().unwrap();
    text(&["refine", "-o", path]);
    let all = ["lqr", "--json", "--parameters", path].into_iter();
    let all = all.chain(PAPER).chain(arguments.iter().copied());
    json(&all.collect::<Vec<_>>())
}

#[test]
fn the_papers_regulator() {
    let result = json(&["lqr", "--model", "p", "--continuous", "--json"]);
    let k = [0.447_213_6, -6.195_773_12, 0.214_707_38, -1.301_027_18];
    assert_close(&numbers(&result["k"]), &k, 1e-7);
    let p = [101.04413437, 4138.85753321, 5.09377211, 173.2761357];
    assert_close(&diagonal(&result["p"]), &p, 1e-9);
    assert_eq!(result["frozen_stability"]["hurwitz"], true);
    assert!((largest_real_part(&result) + 1.920).abs() < 5e-4);
}

#[test]
fn the_other_weights_of_the_paper() {
    let q = "1000,1,0.1,0.1";
    let result = json(&["lqr", "--model", "p", "--continuous", "--q", q, "--json"]);
    assert!((largest_real_part(&result) + 2.224).abs() < 5e-4);
}

#[test]
fn the_continuous_regulator_of_b() {
    let result = of_refined(&["--continuous"]);
    assert_close(
        &numbers(&result["k"]),
        &[0.447_213_6, -4.2895, 0.146_60, -0.914_89],
        5e-5,
    );
    assert_close(
        &diagonal(&result["p"]),
        &[100.532, 2038.975, 2.4703, 86.120],
        2e-5,
    );
    assert!((largest_real_part(&result) + 1.475).abs() < 5e-4);
}

#[test]
fn the_sampled_regulators_of_b() {
    let one = of_refined(&["--substeps", "1"]);
    assert_eq!(one["time"]["t_s"], 0.05);
    assert_eq!(one["time"]["substeps"], 1);
    assert_close(
        &numbers(&one["k"]),
        &[0.270_93, -2.866_49, 0.099_47, -0.621_05],
        5e-5,
    );
    let p = [2088.308, 40_698.665, 46.097, 1701.123];
    assert_close(&diagonal(&one["p"]), &p, 2e-5);
    for pole in one["poles"].as_array().unwrap() {
        let (re, im) = (pole["re"].as_f64().unwrap(), pole["im"].as_f64().unwrap());
        assert!(re.hypot(im) < 1.0, "{pole}");
    }
    // Four is what a scenario takes for this robot; it was once one here and four there.
    for arguments in [["--substeps", "4"].as_slice(), &[]] {
        let four = of_refined(arguments);
        assert_eq!(four["time"]["substeps"], 4);
        let p = [2124.665, 41_717.763, 50.481, 1762.569];
        assert_close(&diagonal(&four["p"]), &p, 2e-5);
    }
}

#[test]
fn the_report_for_the_screen() {
    assert_says(
        &text(&["lqr", "--substeps", "1"]),
        &[
            "u = -K x",
            "sampled every 0.05 s",
            "stable up to 0.0537",
            "0.2709",
            "phi [rad]",
            "Frozen loops",
            "60 deg",
            "360 deg/s",
            "no proof",
        ],
    );
    assert_says(
        &text(&["lqr", "--continuous", "--model", "p"]),
        &["continuous time", "-6.195773", "4138.858", "1/s"],
    );
}

#[test]
fn a_step_that_is_too_long_names_pole_and_step() {
    let message = failure(&["lqr", "--ts", "0.06", "--substeps", "1"], 1);
    assert_says(&message, &["0.06 s", "-51.80", "at least 2 substeps"]);
    text(&["lqr", "--ts", "0.06", "--substeps", "2"]);
}

#[test]
fn a_gain_that_does_not_hold_the_robot_is_said_so() {
    // The paper's gain on a rigid robot, which its model is not.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("robot.toml");
    let path = path.to_str().unwrap();
    let content = "[parameters]\nb1_m2 = 0.1\nb2_m2 = 0.03\nb3_m2 = 0.3\nb4_m2_s = 0.4\n\
                   centre_of_mass_m = 0.4\nball_radius_m = 0.1\nwheel_radius_m = 0.05\n\
                   gravity_m_s2 = 9.81\n";
    std::fs::write(path, content).unwrap();
    let arguments = ["lqr", "--model", "p", "--continuous", "--parameters", path];
    assert_says(&text(&arguments), &["NOT stable"]);
    let result = json(&[&arguments[..], &["--json"]].concat());
    assert_eq!(result["frozen_stability"]["hurwitz"], false);
    assert!(largest_real_part(&result) > 0.0);
    // Its own gain holds it.
    let own = text(&["lqr", "--continuous", "--parameters", path]);
    assert!(!own.contains("NOT stable"), "{own}");
}

#[test]
fn bad_arguments_are_refused() {
    for (arguments, parts) in [
        (
            &["--q", "1,2,3"][..],
            &["--q", "1,2,3", "3 weights", "4 states"][..],
        ),
        (&["--q", "1,2,3,x"], &["`x` is not a number"]),
        (&["--q", "1,2,3,-4"], &["-4", "negative"]),
        (&["--r", "0"], &["--r", "0 is not positive"]),
        (&["--r=-1"], &["--r", "-1 is not positive"]),
        (&["--ts", "nan"], &["--ts", "NaN", "finite"]),
        (&["--substeps", "0"], &["--substeps", "0"]),
        (&["--continuous", "--ts", "0.05"], &["--continuous", "--ts"]),
    ] {
        let arguments: Vec<&str> = ["lqr"]
            .into_iter()
            .chain(arguments.iter().copied())
            .collect();
        assert_says(&failure(&arguments, 2), parts);
    }
}

#[test]
fn costs_without_a_regulator_are_refused() {
    // Nothing holds phi: its integrator is not seen by the cost.
    let message = failure(&["lqr", "--q", "0,1,1,1"], 1);
    assert_says(&message, &["no gain", "detectable"]);
}

#[test]
fn parameters_without_motion_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("robot.toml");
    let path = path.to_str().unwrap();
    // b1 b3 = 9e-4: k = b2 - l r_b cos(theta) goes from 0.02 to 0.04 within 60 degrees.
    let content = "[parameters]\nb1_m2 = 0.003\nb2_m2 = 0.06\nb3_m2 = 0.3\nb4_m2_s = 0.4\n\
                   centre_of_mass_m = 0.4\nball_radius_m = 0.1\nwheel_radius_m = 0.05\n\
                   gravity_m_s2 = 9.81\n";
    std::fs::write(path, content).unwrap();
    let message = failure(&["lqr", "--continuous", "--parameters", path], 1);
    assert_says(&message, &["crosses zero", "det M"]);
}

#[test]
fn numbers_without_a_regulator_end_with_the_reason() {
    // Each of these once ran without end, or named a mode that the weights do see.
    for (arguments, parts) in [
        (&["--ts", "100"][..], &["100 s", "4.04969", "e^405"][..]),
        (&["--ts", "50"], &["50 s", "e^202", "50 ms are 0.05 s"]),
        (&["--ts", "5"], &["5 s", "e^20", "4.45 s"]),
        (&["--ts", "5", "--substeps", "400"], &["no gain", "of A"]),
        (&["--ts", "1e6"], &["1000000 s", "4.04969"]),
        (
            &["--continuous", "--q", "1e200,1,0.1,0.1"],
            &["no gain", "1e200"],
        ),
        (&["--q", "1e200,1,0.1,0.1"], &["no gain", "1e200"]),
        (&["--continuous", "--r", "1e-300"], &["no gain", "1e-300"]),
    ] {
        let arguments: Vec<&str> = ["lqr"]
            .into_iter()
            .chain(arguments.iter().copied())
            .collect();
        let message = failure(&arguments, 1);
        assert_says(&message, parts);
        for wrong in ["detectable", "stabilisable"] {
            assert!(!message.contains(wrong), "{message}");
        }
    }
}

/// A robot of its own has weights of its own, unless others are given; one alone is refused.
#[test]
fn another_robot_gets_weights_of_its_own() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("robot.toml");
    std::fs::write(&path, text(&["scenario", "show", "one-metre"])).unwrap();
    let path = path.to_str().unwrap();
    let of = |more: &[&'static str]| [&["lqr", "--parameters", path][..], more].concat();
    // By hand: it falls with 4.784 1/s, and at 5 degrees the ball gains 4.629 rad/s^2.
    let own = json(&of(&["--json"]));
    assert_close(
        &numbers(&own["q"]),
        &[97.73, 131.31, 0.118_64, 51.645],
        1e-3,
    );
    assert!((own["r"].as_f64().unwrap() / 311.69 - 1.0).abs() < 1e-3);
    let given = json(&[of(&["--json"]), PAPER.to_vec()].concat());
    assert_eq!(numbers(&given["q"]), [200.0, 1.0, 0.1, 0.1]);
    assert_says(&failure(&of(&["--r", "3"]), 2), &["--q and --r", "both"]);
    // In millimetres it is asked about here as in a scenario.
    let wrong = std::fs::read_to_string(path).unwrap();
    std::fs::write(
        path,
        wrong.replace("ball_radius_m = 0.12", "ball_radius_m = 120"),
    )
    .unwrap();
    let said = failure(&of(&[]), 1);
    assert_says(
        &said,
        &["120 mm are 0.12 m", "accept_unusual_values = true"],
    );
}

/// No number is printed with two hundred digits, or with those of rounding.
#[test]
fn numbers_are_for_people() {
    for arguments in [
        &["linearize", "--theta-dot", "1e200"][..],
        &["lqr", "--q", "200,1,0.30000000000000004,0.1"],
        &["lqr", "--r=-1e200"],
    ] {
        let printed = match ballbot(arguments) {
            output if output.status.success() => String::from_utf8(output.stdout).unwrap(),
            output => String::from_utf8(output.stderr).unwrap(),
        };
        let longest = printed
            .split(|c: char| !(c.is_ascii_digit() || c == '.'))
            .map(str::len)
            .max();
        assert!(longest <= Some(12), "{printed}");
    }
}

/// A robot that falls too fast for the usual sampling time, which is none in continuous time.
#[test]
fn a_continuous_regulator_needs_no_sampling_time() {
    let folder = tempfile::tempdir().unwrap();
    let robot = "accept_unusual_values = true\n[parameters]\nb1_m2 = 0.0257\nb2_m2 = 0.0079\nb3_m2 = 0.1284\n\
                 b4_m2_s = 0.02\ncentre_of_mass_m = 0.2978\nball_radius_m = 0.12\nwheel_radius_m = 0.55\n\
                 gravity_m_s2 = 1e6\n";
    std::fs::write(folder.path().join("fast.toml"), robot).unwrap();
    let sampled = ["lqr", "--parameters", "fast.toml"];
    assert_says(&fail(folder.path(), &sampled, 1), &["too long"]);
    let continuous = [&sampled[..], &["--continuous"]].concat();
    assert_says(&succeed(folder.path(), &continuous), &["continuous time"]);
}
