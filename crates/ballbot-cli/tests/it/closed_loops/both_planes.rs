//! `ballbot identify` of both planes of the simulated whole robot, on three motors, from one file.

use super::{edited, files};
use crate::succeed;
use ballbot::Wheels;
use nalgebra::Vector3;
use serde_json::Value;
use std::fmt::Write as _;
use std::path::Path;

const RECORD: &str = include_str!("../../../../../docs/examples/chain/record.toml");
const ROBOT: &str = include_str!("../../../../../docs/examples/chain/true-robot.toml");
const MOVE: &str = include_str!("../../../../../docs/examples/chain/lissajous.toml");

const CONFIG: &str = r#"
[log.theta]
column = "theta_x"
unit = "rad"
[log.theta_dot]
column = "rate_x"
unit = "rad/s"
[log.y]
theta = { column = "theta_y", unit = "rad" }
theta_dot = { column = "rate_y", unit = "rad/s" }
[log.wheels]
plane = "both"
zenith_angle_deg = 45.0
encoders = [
    { column = "w1", unit = "deg", factor = 0.4166666666666667 },
    { column = "w2", unit = "deg", factor = 0.4166666666666667 },
    { column = "w3", unit = "deg", factor = 0.4166666666666667 },
]
torques = [
    { column = "m1", unit = "mNm" },
    { column = "m2", unit = "mNm" },
    { column = "m3", unit = "mNm" },
]
[body]
body_mass_kg = 10.0
[parameters]
drive_coulomb_m2_s2 = "free"
"#;

/// What the sensors of a plane delivered: time, ball angle, tilt, rate, commanded torque.
fn rows(path: &Path) -> Vec<[f64; 5]> {
    let text = std::fs::read_to_string(path).unwrap();
    let rows = text.lines().skip(1).map(|line| {
        let values: Vec<f64> = line
            .split(',')
            .map(|field| field.parse().unwrap())
            .collect();
        [values[0], values[1], values[2], values[3], values[4]]
    });
    rows.collect()
}

/// The one log of that robot: three wheels that slowly turn the ball, too, and three motors.
fn one_file([x, y]: [Vec<[f64; 5]>; 2]) -> String {
    let (wheels, gear) = (Wheels::<f64>::paper(), 0.12 / 0.05);
    let angles = wheels.matrix().transpose().try_inverse().unwrap();
    let mut text = "t_s,w1,w2,w3,m1,m2,m3,theta_x,theta_y,rate_x,rate_y\n".to_owned();
    for (x, y) in x.iter().zip(&y) {
        let psi = Vector3::new(x[1] - x[2], y[1] - y[2], 0.05 * x[0]) * gear;
        let angles = (angles * psi).map(f64::to_degrees);
        let motors = wheels.motors(&Vector3::new(x[4], y[4], 0.0)) * 1e3;
        let wheels = angles.iter().chain(motors.iter());
        let wheels: Vec<String> = wheels.map(f64::to_string).collect();
        writeln!(
            text,
            "{},{},{},{},{},{}",
            x[0],
            wheels.join(","),
            x[2],
            y[2],
            x[3],
            y[3]
        )
        .unwrap();
    }
    text
}

fn assert_near(told: &Value, truth: f64) {
    let (value, deviation) = (
        told["value"].as_f64().unwrap(),
        told["standard_deviation"].as_f64().unwrap(),
    );
    assert!(
        (value - truth).abs() <= 4.0 * deviation,
        "{told} for {truth}"
    );
    assert!((value - truth).abs() <= 0.05 * truth, "{told} for {truth}");
}

#[test]
fn both_planes_of_the_whole_robot_are_identified_from_one_file_and_driven_with_the_result() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let write = |name: &str, text: &str| std::fs::write(at(name), text).unwrap();
    // Both planes move, each along its own curve, and share the motors' limits.
    let record = edited(
        RECORD,
        "[reference.set_points]\npoints = [{ time_s = 0.0, phi_rad = 0.0 }]",
        "[reference.lissajous]\namplitude_x_m = 0.2\namplitude_y_m = 0.2\n\
         angular_frequency_x_rad_s = 0.5\nangular_frequency_y_rad_s = 0.8\n\n\
         [controller.motors]\nlimit_nm = 6.0\nyaw_reserve_nm = 0.1",
    );
    write("record.toml", &record);
    write("true-robot.toml", ROBOT);
    write("both.toml", CONFIG);
    succeed(
        folder.path(),
        &[
            "-q",
            "excite",
            "--amplitude",
            "2",
            "--out",
            "excitation.csv",
        ],
    );
    let log = ["-q", "simulate", "record.toml", "--log", "log.csv"];
    succeed(folder.path(), &log);
    let planes = ["log-x.csv", "log-y.csv"].map(|name| rows(&at(name)));
    write("both.csv", &one_file(planes));

    let identify = [
        "-q",
        "identify",
        "both.csv",
        "--config",
        "both.toml",
        "--out",
        "identification",
        "--json",
    ];
    let said = succeed(folder.path(), &identify);
    let found: Value = serde_json::from_str(&said).unwrap();
    let shared = &found["parameters"];
    for (key, truth) in [
        ("b1_m2", 0.03),
        ("b2_m2", 0.0107),
        ("b3_m2", 0.1428),
        ("b4_m2_s", 0.0101),
        ("drive_friction_m2_s", 0.03),
        ("drive_coulomb_m2_s2", 0.02),
        ("delay_s", 0.02),
    ] {
        assert_near(&shared[key], truth);
    }
    assert!(shared.get("tilt_offset_rad").is_none());
    for plane in ["x", "y"] {
        let own = &found["planes"][plane];
        assert_near(&own["parameters"]["tilt_offset_rad"], 0.01);
        assert_eq!(own["residuals"].as_array().unwrap().len(), 3);
        assert!(own["held_back_chi_square"].as_f64().unwrap() < 1.3);
    }
    let verdicts = found["verdicts"].as_array().unwrap();
    assert!(
        verdicts.iter().all(|one| one["weight"] != "no result"),
        "{verdicts:?}"
    );

    let written = files(&at("identification"));
    for name in [
        "parameters.toml",
        "report.html",
        "figures/fit_x.png",
        "figures/predictions_y.svg",
    ] {
        assert!(
            written.contains(&name.to_owned()),
            "{name} is not in {written:?}"
        );
    }
    assert!(!written.contains(&"figures/fit.png".to_owned()));
    let report = std::fs::read_to_string(at("identification/report.html")).unwrap();
    for part in [
        "tilt_offset_rad, plane y",
        "<figure id=\"residuals_x\">",
        "Plane y",
    ] {
        assert!(report.contains(part), "{part}");
    }

    // The scenarios of two planes take it, also with a robot drawn from its covariance.
    let driven = edited(MOVE, "parameters = \"true-robot.toml\"", "draw = 3");
    let driven = edited(&driven, "duration_s = 70.0", "duration_s = 25.0");
    write("lissajous.toml", &driven);
    succeed(
        folder.path(),
        &["-q", "simulate", "lissajous.toml", "--out", "lissajous"],
    );
}
