//! `ballbot linearize`.

use crate::{assert_close, assert_says, failure, json, numbers, text};
use ballbot::Ballbot;
use nalgebra::{Vector1, Vector4};
use serde_json::Value;

fn column(matrix: &Value, column: usize) -> Vec<f64> {
    let rows = matrix.as_array().unwrap().iter();
    rows.map(|row| row[column].as_f64().unwrap()).collect()
}

#[test]
fn upright_is_the_derivative_of_the_nonlinear_model() {
    let result = json(&["linearize", "--json"]);
    let robot = Ballbot::<f64>::paper();
    let numerical = lpvmpc_design::linearize(
        |x: &Vector4<f64>, u: &Vector1<f64>| robot.f(x, u[0]),
        &Vector4::zeros(),
        &Vector1::zeros(),
    )
    .unwrap();
    for i in 0..4 {
        for (found, expected) in column(&result["a"], i).iter().zip(&numerical.a.column(i)) {
            assert!((found - expected).abs() < 1e-8, "{found} for {expected}");
        }
    }
    for (found, expected) in column(&result["b"], 0).iter().zip(&numerical.b) {
        assert!((found - expected).abs() < 1e-8, "{found} for {expected}");
    }
    assert_eq!(result["controllability_rank"], 4);
}

#[test]
fn the_identified_model_is_made_of_p() {
    let result = json(&["linearize", "--model", "p", "--json"]);
    assert_eq!(numbers(&result["a"][2]), [0.0, -342.6038, -52.8301, 0.0]);
    assert_eq!(numbers(&result["a"][3]), [0.0, -36.0734, -9.1477, 0.0]);
    assert_eq!(column(&result["b"], 0), [0.0, 0.0, -1425.9, -251.8476]);
    let poles = result["poles_1_s"].as_array().unwrap();
    for (pole, expected) in poles.iter().zip([-51.7, -5.49, 0.0, 4.33]) {
        let found = pole["re"].as_f64().unwrap();
        assert!((found - expected).abs() < 5e-2, "{found} for {expected}");
    }
}

#[test]
fn at_a_scheduling_the_matrices_are_the_nonlinear_model() {
    let result = json(&["linearize", "--theta", "20", "--theta-dot", "-90", "--json"]);
    let x = Vector4::new(0.3, 20_f64.to_radians(), 2.0, -90_f64.to_radians());
    assert_close(
        &[
            result["theta_rad"].as_f64().unwrap(),
            result["theta_dot_rad_s"].as_f64().unwrap(),
        ],
        &[x[1], x[3]],
        1e-15,
    );
    let derivative = Ballbot::paper().f(&x, 0.7);
    for row in 0..4 {
        let a = numbers(&result["a"][row]);
        let drift: f64 = a.iter().zip(&x).map(|(a, x)| a * x).sum();
        let found = drift + result["b"][row][0].as_f64().unwrap() * 0.7;
        assert_close(&[found], &[derivative[row]], 1e-12);
    }
}

#[test]
fn the_report_for_the_screen() {
    assert_says(
        &text(&["linearize"]),
        &["theta = 0 deg", "-51.80", "Controllability rank 4 of 4"],
    );
    assert_says(
        &text(&["linearize", "--theta", "-5.5"]),
        &["theta = -5.5 deg"],
    );
}

#[test]
fn bad_arguments_are_refused() {
    for (arguments, parts) in [
        (
            &["--theta", "steep"][..],
            &["--theta", "`steep` is not a number"][..],
        ),
        (&["--theta", "181"], &["181", "-180 to 180"]),
        (&["--theta-dot", "inf"], &["--theta-dot", "inf", "finite"]),
        (&["--model", "q"], &["--model", "'q'", "b, p"]),
        (&["--model", "p", "--theta", "3"], &["--theta", "--model p"]),
        (
            &["--model", "p", "--parameters", "x.toml"],
            &["--parameters", "--model p"],
        ),
    ] {
        let arguments: Vec<&str> = ["linearize"]
            .into_iter()
            .chain(arguments.iter().copied())
            .collect();
        assert_says(&failure(&arguments, 2), parts);
    }
}

#[test]
fn bad_parameters_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("robot.toml");
    let path = path.to_str().unwrap();
    let good = "[parameters]\nb1_m2 = 0.1\nb2_m2 = 0.03\nb3_m2 = 0.3\nb4_m2_s = 0.4\n\
                centre_of_mass_m = 0.4\nball_radius_m = 0.1\nwheel_radius_m = 0.05\n\
                gravity_m_s2 = 9.81\n";
    for (from, to, parts) in [
        (
            "b1_m2 = 0.1",
            "b1_m2 = nan",
            &["parameters.b1_m2 = NaN"][..],
        ),
        (
            "ball_radius_m = 0.1",
            "ball_radius_m = 0",
            &["parameters.ball_radius_m = 0", "positive"],
        ),
        ("b1_m2 = 0.1", "b1 = 0.1", &["line 2", "unknown field `b1`"]),
        (
            "[parameters]",
            "[parameter]",
            &["missing field `parameters`"],
        ),
        // det M(0) = b1 b3 - (b2 - l r_b)^2 is exactly zero.
        (
            "b1_m2 = 0.1\nb2_m2 = 0.03",
            "b1_m2 = 0.0\nb2_m2 = 0.04000000000000001",
            &["the linear model", "A"],
        ),
    ] {
        assert!(good.contains(from));
        std::fs::write(path, good.replace(from, to)).unwrap();
        let message = failure(&["linearize", "--parameters", path], 1);
        assert_says(&message, parts);
    }
    std::fs::write(path, good).unwrap();
    text(&["linearize", "--parameters", path]);
}
