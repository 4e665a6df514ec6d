//! Mistakes in `[world]` and in the feedback pipeline: each gets its message.

use ballbot_scenario::{Scenario, builtin};
use std::path::Path;

/// The message for a built-in scenario with `lines` added at the end.
fn message(lines: &str) -> String {
    let name = "single-setpoint";
    let text = builtin::find(name).expect("built-in").text;
    let text = text.replace(
        "[controller.terminal.continuous_riccati.linear_model]",
        "[unused]",
    );
    let text = text
        .split("[unused]")
        .next()
        .map_or(String::new(), str::to_owned);
    let bounds = "[bounds]\ntorque_nm = [-1.5, 1.5]\n[reference.set_points]\npoints = [{ time_s = 0.0, phi_rad = 1.0 }]\n";
    let text = format!("{text}\n{bounds}\n{lines}\n");
    let prepared = Scenario::parse(&text, "my.toml").and_then(|s| s.prepare(Path::new(".")));
    match prepared {
        Ok(_) => panic!("`{lines}` was accepted"),
        Err(error) => error.to_string(),
    }
}

#[test]
fn each_mistake_is_named_with_key_value_and_what_is_right() {
    for (lines, words) in [
        ("[world]\nsed = 1", ["sed", "unknown field"]),
        (
            "[world]\nsensor_period_s = 0.03",
            ["world.sensor_period_s = 0.03", "whole number"],
        ),
        (
            "[world]\nsensor_period_s = 0.0",
            ["world.sensor_period_s = 0", "positive"],
        ),
        (
            "[world.sensors.theta]\nnoise_rad = -0.1",
            ["world.sensors.theta.noise_rad = -0.1", "not negative"],
        ),
        (
            "[world.sensors.theta_dot]\nbias_rad_s = nan",
            ["world.sensors.theta_dot.bias_rad_s = NaN", "finite"],
        ),
        (
            "[world.sensors.phi]\nnoise_rad_s = 0.1",
            ["noise_rad_s", "unknown field"],
        ),
        (
            "[world.sensors.phi]\ndropout = 2.0",
            ["world.sensors.phi.dropout = 2", "0 to 1"],
        ),
        (
            "[world.sensors.phi]\ndropout = 0.6\nstale = 0.5",
            ["world.sensors.phi.stale = 0.5", "0 to 0.4"],
        ),
        (
            "[world]\nsensor_period_s = 0.005\n[world.sensors.theta]\ndelay_s = 0.012",
            [
                "world.sensors.theta.delay_s = 0.012",
                "periods of the sensors (0.005 s)",
            ],
        ),
        (
            "[world.sensors.theta_dot]\nperiod_s = 0.0",
            ["world.sensors.theta_dot.period_s = 0", "positive"],
        ),
        (
            "[controller.estimator]\noldest_s = -1.0",
            ["controller.estimator.oldest_s = -1", "not be negative"],
        ),
        (
            "[world.actuator]\nlimit_nm = 0.0",
            ["world.actuator.limit_nm = 0", "inf for no"],
        ),
        (
            "[world.actuator]\nlag_s = inf",
            ["world.actuator.lag_s = inf", "finite"],
        ),
        (
            "[world.delay]\ntransport_s = -1.0",
            ["world.delay.transport_s = -1", "not negative"],
        ),
        (
            "[world.robot]\nb1_factor = 0.0",
            ["world.robot.b1_factor = 0", "positive"],
        ),
        (
            "[world.robot]\ntilt_offset_x_rad = 2.0",
            ["tilt_offset_x_rad = 2", "-0.5 to 0.5"],
        ),
        // det M has a zero between upright and 60 degrees.
        (
            "[world.robot]\nb1_factor = 3.0",
            ["parameters", "crosses zero"],
        ),
        (
            "[world.floor]\nslope_x_deg = 60.0",
            ["world.floor.slope_x_deg = 60", "45"],
        ),
        (
            "[world.floor]\ntotal_mass_ratio = 0.5",
            ["total_mass_ratio = 0.5", "1 or more"],
        ),
        (
            "[[world.pushes]]\nforce = { from_s = 2.0, until_s = 1.0, force_m_s2 = 1.0, height_m = 0.0 }",
            ["world.pushes[0].force.until_s = 1", "2 s"],
        ),
        (
            "[[world.pushes]]\nrates = { time_s = -1.0 }",
            ["world.pushes[0].rates.time_s = -1", "not negative"],
        ),
        (
            "[controller.estimator]\nphi_noise_rad = 0.0",
            ["controller.estimator.phi_noise_rad = 0", "positive"],
        ),
        (
            "[controller.estimator]\noutlier_deviations = nan",
            ["controller.estimator.outlier_deviations = NaN", "positive"],
        ),
        (
            "[controller.torque_rate]\nlimit_nm_s = -1.0\nweight = 1.0",
            ["controller.torque_rate.limit_nm_s = -1", "inf for no"],
        ),
        (
            "[controller.torque_rate]\nlimit_nm_s = 1.0\nweight = 0.0",
            ["controller.torque_rate.weight = 0", "positive"],
        ),
        (
            "[controller.shaping]\ntilt_rad = 2.0\nphi_dot_rad_s = 1.0",
            ["controller.shaping.tilt_rad = 2", "pi/2"],
        ),
        (
            "[controller.motors]\nlimit_nm = 0.1\nyaw_reserve_nm = 1.0",
            ["controller.motors", "no torque for the planes"],
        ),
        (
            "[world.floor]\nslope_y_deg = 40.0",
            ["world.floor.slope_y_deg = 40", "has one plane only"],
        ),
        (
            "[world.robot]\ntilt_offset_y_rad = nan",
            ["world.robot.tilt_offset_y_rad = NaN", "leave it out"],
        ),
        (
            "[[world.pushes]]\nrates = { time_s = 4.0, theta_dot_rad_s = 1.0 }\n[[world.pushes]]\n\
             impulse = { time_s = 4.0, momentum_m_s = 0.1, height_m = 0.2, plane = \"y\" }",
            ["world.pushes[1].impulse.plane = y", "has one plane only"],
        ),
        (
            "[heading]\ninertia_m2 = 0.02\nstiffness_nm_rad = 0.1\ndamping_nm_s_rad = 0.03",
            ["heading", "two planes and [controller.motors]"],
        ),
    ] {
        let said = message(lines);
        for word in words {
            assert!(said.contains(word), "no `{word}` for `{lines}` in: {said}");
        }
    }
}

/// With a speed of 8 rad/s within 4 the robot swung about its set point for ever.
#[test]
fn a_move_beyond_the_bounds_of_the_states_is_refused() {
    let text = builtin::find("one-metre").expect("built-in").text;
    let refusal = |bounds: &str| {
        let text = text.replace("theta_rad = [-0.7, 0.7]", bounds);
        let prepared = Scenario::parse(&text, "my.toml").unwrap();
        let prepared = prepared.prepare(Path::new("."));
        prepared.err().map(|error| error.to_string())
    };
    let speed = refusal("phi_dot_rad_s = [-9.0, 4.0]").unwrap();
    for words in [
        "controller.shaping.phi_dot_rad_s = 8",
        "bounds.phi_dot_rad_s",
        "at most 4",
    ] {
        assert!(speed.contains(words), "{speed}");
    }
    assert_eq!(refusal("phi_dot_rad_s = [-8.0, 8.0]"), None);
    let tilt = refusal("theta_rad = [-0.04, 0.7]").unwrap();
    assert!(tilt.contains("controller.shaping.tilt_rad = 0.05") && tilt.contains("at most 0.04"));
}
