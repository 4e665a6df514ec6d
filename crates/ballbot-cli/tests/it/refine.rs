//! `ballbot refine`.

use crate::{assert_close, assert_says, failure, json, numbers, text};
use serde_json::Value;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// The least-squares optimum.
const B: [f64; 4] = [0.002_483_22, 0.059_325_7, 0.143_093_25, -0.074_360_78];

fn file(folder: &TempDir, content: &str) -> PathBuf {
    let path = folder.path().join("robot.toml");
    std::fs::write(&path, content).unwrap();
    path
}

fn name(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// The example with one text replaced.
fn example_with(from: &str, to: &str) -> String {
    let example = text(&["refine", "--example"]);
    assert_eq!(example.matches(from).count(), 1, "{from}");
    example.replace(from, to)
}

/// The message for the example with one text replaced.
fn refusal(from: &str, to: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let path = file(&folder, &example_with(from, to));
    let message = failure(&["refine", name(&path)], 1);
    assert_says(&message, &["robot.toml"]);
    message
}

fn parameters(result: &Value) -> Vec<f64> {
    ["b1_m2", "b2_m2", "b3_m2", "b4_m2_s"]
        .map(|key| result["parameters"][key].as_f64().unwrap())
        .to_vec()
}

fn poles(value: &Value) -> Vec<f64> {
    let poles = value.as_array().unwrap().iter();
    poles.map(|pole| pole["re"].as_f64().unwrap()).collect()
}

fn last_norm(fit: &Value) -> f64 {
    let iterations = fit["iterations"].as_array().unwrap();
    iterations.last().unwrap()["residual_norm"]
        .as_f64()
        .unwrap()
}

#[test]
fn the_papers_robot() {
    let result = json(&["refine", "--json"]);
    assert_close(&parameters(&result), &B, 1e-5);
    for method in ["gauss_newton", "levenberg_marquardt"] {
        assert_eq!(result[method]["converged"], true);
        assert!((last_norm(&result[method]) - 0.432_969).abs() < 1e-6);
    }
    let steps = result["gauss_newton"]["iterations"].as_array().unwrap();
    // The start is the first entry.
    assert!((5..=6).contains(&steps.len()), "{} entries", steps.len());
    assert_eq!(numbers(&steps[0]["b"]), [0.0025, 0.06, 0.14, -0.07]);
    for (pole, expected) in poles(&result["poles_of_h_1_s"])
        .iter()
        .zip([-51.8017, -5.1484, 0.0, 4.0497])
    {
        assert!((pole - expected).abs() < 5e-5, "{pole} for {expected}");
    }
    for (pole, expected) in poles(&result["poles_of_p_1_s"])
        .iter()
        .zip([-51.7, -5.49, 0.0, 4.33])
    {
        assert!((pole - expected).abs() < 5e-2, "{pole} for {expected}");
    }
    let squares = result["equations"].as_array().unwrap().iter();
    let squares = squares.map(|equation| equation["difference"].as_f64().unwrap().powi(2));
    assert!((squares.sum::<f64>().sqrt() - 0.432_969).abs() < 1e-6);
    assert_eq!(result["consistency"]["physical"], false);
}

#[test]
fn the_report_for_the_screen() {
    let report = text(&["refine"]);
    assert_says(
        &report,
        &[
            "Gauss-Newton",
            "Levenberg-Marquardt",
            "residual norm",
            "0.4329685",
            "-251.8476",
            "no rigid ballbot has these parameters",
            "1.047 rad",
        ],
    );
}

#[test]
fn the_example_is_the_papers_robot() {
    let folder = tempfile::tempdir().unwrap();
    let path = file(&folder, &text(&["refine", "--example"]));
    assert_eq!(text(&["refine", name(&path)]), text(&["refine"]));
}

#[test]
fn optional_tables_may_be_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let example = text(&["refine", "--example"]);
    let (required, _) = example.split_once("# Optional: where").unwrap();
    let path = file(&folder, required);
    let result = json(&["refine", name(&path), "--json"]);
    // From the start that fulfils four equations: the same minimum.
    assert_close(&parameters(&result), &B, 1e-5);
}

#[test]
fn the_damped_iteration_decides_where_the_undamped_one_diverges() {
    let folder = tempfile::tempdir().unwrap();
    let start = "b1_m2 = 0.0025\nb2_m2 = 0.06\nb3_m2 = 0.14\nb4_m2_s = -0.07";
    let far = "b1_m2 = 0.01\nb2_m2 = 0.05\nb3_m2 = 0.1\nb4_m2_s = -0.05";
    let path = file(&folder, &example_with(start, far));
    let result = json(&["refine", name(&path), "--json"]);
    assert_eq!(result["gauss_newton"]["converged"], false);
    assert_close(&parameters(&result), &B, 1e-5);
    assert_says(&text(&["refine", name(&path)]), &["did not converge in"]);
}

#[test]
fn weights_and_tilt_are_those_of_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = file(&folder, &example_with("p5 = 1.0", "p5 = 100.0"));
    let weighted = json(&["refine", name(&path), "--json"]);
    let difference = |result: &Value| result["equations"][4]["difference"].as_f64().unwrap().abs();
    assert!(difference(&weighted) < 0.1 * difference(&json(&["refine", "--json"])));
    let path = file(&folder, &example_with("tilt_deg = 60.0", "tilt_deg = 30"));
    assert_says(&text(&["refine", name(&path)]), &["|theta| <= 0.524 rad"]);
}

#[test]
fn the_output_is_a_parameters_table_for_other_commands() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("made").join("refined.toml");
    text(&["refine", "--output", name(&path)]);
    let result = json(&["linearize", "--parameters", name(&path), "--json"]);
    let equations = json(&["refine", "--json"])["equations"].clone();
    assert_eq!(result["a"][2][1], equations[0]["h"]);
    assert_close(
        &[result["b"][3][0].as_f64().unwrap()],
        &[equations[5]["h"].as_f64().unwrap()],
        1e-14,
    );
    let blocked = folder.path().join("made/refined.toml/more.toml");
    let message = failure(&["refine", "-o", name(&blocked)], 1);
    assert_says(&message, &["cannot write", "more.toml"]);
}

#[test]
fn no_convergence_is_an_error_and_no_result() {
    let message = {
        let folder = tempfile::tempdir().unwrap();
        let path = file(
            &folder,
            &example_with("max_iterations = 200", "max_iterations = 1")
                .replace("b1_m2 = 0.0025", "b1_m2 = 0.01"),
        );
        failure(&["refine", name(&path)], 1)
    };
    assert_says(
        &message,
        &[
            "did not converge",
            "cap",
            "residual norm",
            "[start]",
            "max_iterations",
        ],
    );
}

#[test]
fn p_of_no_ballbot_needs_a_start() {
    let folder = tempfile::tempdir().unwrap();
    let content = "[linear_model]\np1 = 0\np2 = 0\np3 = 0\np4 = 0\np5 = 0\np6 = 0\n\
                   [geometry]\ncentre_of_mass_m = 0.3\nball_radius_m = 0.1\n\
                   wheel_radius_m = 0.05\ngravity_m_s2 = 9.81\n";
    let path = file(&folder, content);
    assert_says(
        &failure(&["refine", name(&path)], 1),
        &["not finite", "[start]"],
    );
}

#[test]
fn a_bad_file_is_refused_with_its_place() {
    // The line numbers are those of the example.
    for (from, to, parts) in [
        (
            "p1 = -342",
            "p7 = 1\np1 = -342",
            &["line 8", "p7", "p6"][..],
        ),
        (
            "p1 = -342.6038",
            "p1 = \"fast\"",
            &["line 8", "\"fast\"", "expected a number"],
        ),
        ("p1 = -342.6038", "# p1", &["missing field `p1`", "line 7"]),
        ("p1 = -342.6038", "p1 = ", &["line 8"]),
        (
            "p1 = -342.6038",
            "p1 = nan",
            &["linear_model.p1 = NaN", "finite"],
        ),
        (
            "ball_radius_m = 0.12",
            "ball_radius_m = -0.12",
            &["geometry.ball_radius_m = -0.12", "positive"],
        ),
        (
            "wheel_radius_m = 0.05",
            "wheel_radius_m = 0",
            &["geometry.wheel_radius_m = 0", "positive"],
        ),
        (
            "b1_m2 = 0.0025",
            "b1_m2 = inf",
            &["start.b1_m2 = inf", "finite"],
        ),
        ("p5 = 1.0", "p5 = 0", &["weights.p5 = 0", "positive"]),
        (
            "tilt_deg = 60.0",
            "tilt_deg = 200",
            &["settings.tilt_deg = 200", "180"],
        ),
        (
            "max_iterations = 200",
            "max_iterations = 0",
            &["settings.max_iterations = 0", "1 to"],
        ),
        (
            "max_iterations = 200",
            "max_iterations = -1",
            &["line 43", "-1"],
        ),
        ("[geometry]", "[geometri]", &["geometri", "geometry"]),
        (
            "step_tolerance = 1e-10",
            "step_tolerance = -1",
            &["settings.step_tolerance = -1"],
        ),
    ] {
        assert_says(&refusal(from, to), parts);
    }
    let message = failure(&["refine", "no/such.toml"], 1);
    assert_says(&message, &["cannot read no/such.toml"]);
}

#[test]
fn options_that_exclude_each_other_are_refused() {
    assert_says(
        &failure(&["refine", "--example", "--json"], 2),
        &["--example", "--json"],
    );
}

#[test]
fn a_minus_is_standard_output() {
    let table = text(&["refine", "-o", "-"]);
    assert!(table.starts_with("[parameters]\nb1_m2 = "), "{table}");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("robot.toml");
    text(&["refine", "--out", path.to_str().unwrap()]);
    assert_eq!(std::fs::read_to_string(&path).unwrap(), table);
}

#[cfg(unix)]
#[test]
fn a_device_stays_a_device() {
    // It was once replaced by a file, where the user may do so.
    let folder = tempfile::tempdir().unwrap();
    let link = folder.path().join("full");
    std::os::unix::fs::symlink("/dev/full", &link).unwrap();
    let message = failure(&["refine", "-o", link.to_str().unwrap()], 1);
    assert_says(&message, &["cannot write", "full"]);
    assert!(!std::fs::metadata("/dev/full").unwrap().is_file());
    assert!(link.is_symlink());
}

/// The file that is read was once replaced by what it was read for.
#[test]
fn what_is_read_is_not_written() {
    let folder = tempfile::tempdir().unwrap();
    let example = text(&["refine", "--example"]);
    let path = file(&folder, &example);
    let said = failure(&["refine", name(&path), "-o", name(&path)], 1);
    assert_says(&said, &["robot.toml", "would be lost"]);
    assert_eq!(std::fs::read_to_string(&path).unwrap(), example);
}
