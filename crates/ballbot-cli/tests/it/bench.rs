//! `ballbot bench`.

use crate::{assert_says, fail, failure, json};

#[test]
fn every_sequence_has_its_times() {
    let result = json(&["bench", "--passes", "1", "--json", "-"]);
    let sequences = result["sequences"].as_array().unwrap();
    let names = [
        "two-setpoints",
        "lissajous",
        "single-setpoint-terminal",
        "tight-bounds",
        "many-bounds-8x2",
        "many-bounds-12x4",
        "long-4x1",
    ];
    assert_eq!(sequences.len(), names.len());
    for (sequence, name) in sequences.iter().zip(names) {
        assert_eq!(sequence["name"], name);
        let time = |of: &str, statistic: &str| sequence[of][statistic].as_f64().unwrap();
        for of in ["qp_us", "qp_cold_us", "step_us", "step_cold_us"] {
            let [median, p99, max] = ["median", "p99", "max"].map(|statistic| time(of, statistic));
            assert!(0.0 < median && median <= p99 && p99 <= max, "{name}: {of}");
        }
        let active = sequence["max_active"].as_u64().unwrap();
        let many = name.starts_with("many") || name.starts_with("long");
        assert_eq!(active > 30, many, "{name}: {active} active");
    }
    for of in [
        "plain_us",
        "descent_us",
        "feedback_us",
        "feedback_cold_us",
        "far_descent_us",
        "guaranteed_us",
    ] {
        let time = |statistic: &str| result["guarded"][of][statistic].as_f64().unwrap();
        let [median, p99, max] = ["median", "p99", "max"].map(time);
        assert!(0.0 < median && median <= p99 && p99 <= max, "{of}");
    }
}

#[test]
fn a_time_needs_a_pass() {
    assert!(failure(&["bench", "--passes", "0"], 2).contains("--passes"));
}

#[test]
fn a_scenario_that_does_not_exist_has_no_times() {
    assert!(failure(&["bench", "no-such-scenario"], 1).contains("no-such-scenario"));
}

/// Times would have taken the place of the robot that they are of.
#[test]
fn times_take_the_place_of_no_robot() {
    let folder = tempfile::tempdir().unwrap();
    let robot = folder.path().join("robot.toml");
    let text = "[parameters]\nb1_m2 = 0.0257\nb2_m2 = 0.0079\nb3_m2 = 0.1284\nb4_m2_s = 0.02\n\
                centre_of_mass_m = 0.2978\nball_radius_m = 0.12\nwheel_radius_m = 0.55\ngravity_m_s2 = 9.81\n";
    std::fs::write(&robot, text).unwrap();
    let named = ["--set", "parameters=\"robot.toml\""];
    for given in [&["--parameters", "robot.toml"][..], &named] {
        let bench = [&["bench", "--passes", "1", "--json", "robot.toml"], given].concat();
        let message = fail(folder.path(), &bench, 1);
        assert_says(&message, &["robot.toml", "would be lost"]);
        assert_eq!(std::fs::read_to_string(&robot).unwrap(), text);
    }
}

/// What would be timed has other settings than these scenarios.
#[test]
fn controllers_of_another_kind_are_not_timed_as_plain_ones() {
    let set = [
        "--passes",
        "1",
        "--set",
        "controller.torque_rate.limit_nm_s=20",
    ];
    let ramped = [&["bench", "two-setpoints"], &set[..]].concat();
    assert_says(&failure(&ramped, 1), &["torque_rate"]);
    assert_says(
        &failure(&["bench", "far-setpoints", "--passes", "1"], 1),
        &["without a guarantee"],
    );
}
