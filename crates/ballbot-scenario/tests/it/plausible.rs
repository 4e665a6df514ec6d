//! Values in other units, and values that no work could follow: asked about or refused, with place,
//! value and what would be right, before anything runs.

use ballbot_scenario::{Scenario, builtin, read_robot};
use std::path::Path;

/// The scenario `two-setpoints` with lines replaced and others added at the end.
fn scenario(changes: &[(&str, &str)], lines: &str) -> Scenario {
    let mut text = builtin::find("two-setpoints")
        .expect("built-in")
        .text
        .to_owned();
    for (from, to) in changes {
        assert!(text.contains(from), "the file has no `{from}`");
        text = text.replacen(from, to, 1);
    }
    Scenario::parse(&format!("{text}\n{lines}\n"), "my.toml").expect("valid TOML")
}

fn refused(scenario: &Scenario) -> String {
    match scenario.prepare(Path::new(".")) {
        Ok(_) => panic!("accepted"),
        Err(error) => error.to_string(),
    }
}

/// The scenario with the change is refused, in these words, unless it says that it means it.
fn asked_about(change: (&str, &str), words: [&str; 2]) {
    let mut changed = scenario(&[change], "");
    let said = refused(&changed);
    for word in words {
        assert!(said.contains(word), "no `{word}` in: {said}");
    }
    assert!(said.contains("accept_unusual_values = true"), "{said}");
    // Said to be meant, they are not asked about again; work without end stays refused.
    changed.accept_unusual_values = true;
    if let Err(error) = changed.prepare(Path::new(".")) {
        assert!(!error.to_string().contains("unusual"), "{error}");
    }
}

#[test]
fn other_units_are_asked_about() {
    let theta = "theta_rad = [-1.0471975511965976, 1.0471975511965976]";
    for (from, to, words) in [
        (
            theta,
            "theta_rad = [-60.0, 60.0]",
            [
                "bounds.theta_rad[0] = -60",
                "degrees meant? -60 degrees are -1.047 rad",
            ],
        ),
        (
            "theta_rad = 0.0",
            "theta_rad = 10.0",
            ["initial_state.theta_rad = 10", "10 degrees are 0.1745 rad"],
        ),
        (
            "ball_radius_m = 0.12",
            "ball_radius_m = 120.0",
            ["parameters.ball_radius_m = 120", "120 mm are 0.12 m"],
        ),
        (
            "zenith_angle_deg = 45.0",
            "zenith_angle_deg = 0.785",
            [
                "parameters.zenith_angle_deg = 0.785",
                "0.785 rad are 44.98 degrees",
            ],
        ),
        (
            "b3_m2 = 0.143093",
            "b3_m2 = 143093.0",
            ["parameters.b3_m2 = 143093", "143093 mm^2 are 0.1431 m^2"],
        ),
        (
            "torque_nm = [-1.5, 1.5]",
            "torque_nm = [-1.5, 1500.0]",
            ["bounds.torque_nm[1] = 1500", "1500 mN m are 1.5 N m"],
        ),
        (
            "t_s = 0.05",
            "t_s = 50.0",
            ["controller.t_s = 50", "50 ms are 0.05 s"],
        ),
        (
            "r = 1000.0",
            "r = 1000.0\ndelay_s = 1e6",
            ["controller.delay_s = 1000000", "more than 1 s"],
        ),
    ] {
        asked_about((from, to), words);
    }
}

/// The limits of b1, b2 and b4 grow with the robot: b1 of a thousand times an ordinary one was taken.
#[test]
fn inertias_and_frictions_that_no_ball_of_this_size_has_are_asked_about() {
    for (from, to, words) in [
        (
            "b1_m2 = 0.002483",
            "b1_m2 = 29.4",
            ["parameters.b1_m2 = 29.4", "more than 1.44 m^2"],
        ),
        (
            "b2_m2 = 0.059325",
            "b2_m2 = 59325.0",
            ["parameters.b2_m2 = 59325", "59325 mm^2 are 0.05932 m^2"],
        ),
        (
            "b4_m2_s = -0.07436",
            "b4_m2_s = -10.0",
            ["parameters.b4_m2_s = -10", "more than 1.177 m^2/s"],
        ),
    ] {
        asked_about((from, to), words);
    }
}

/// No setting makes a negative deviation or time right, however large it is.
#[test]
fn a_size_below_zero_is_not_called_unusual() {
    for (lines, key) in [
        (
            "[world.sensors.phi]\nnoise_rad = -1.0",
            "world.sensors.phi.noise_rad = -1",
        ),
        (
            "[world.sensors.theta_dot]\nresolution_rad_s = -1e3",
            "world.sensors.theta_dot.resolution_rad_s = -1000",
        ),
        (
            "[world.sensors.phi]\ndelay_s = -10.0",
            "world.sensors.phi.delay_s = -10",
        ),
        (
            "[world]\nsensor_period_s = -10.0",
            "world.sensor_period_s = -10",
        ),
        (
            "[world.actuator]\nlimit_nm = -1e3",
            "world.actuator.limit_nm = -1000",
        ),
        (
            "[world.actuator]\ndead_zone_nm = -1e3",
            "world.actuator.dead_zone_nm = -1000",
        ),
        (
            "[world.actuator]\ncoulomb_friction_nm = -1e3",
            "world.actuator.coulomb_friction_nm = -1000",
        ),
        (
            "[world.actuator]\nlag_s = -10.0",
            "world.actuator.lag_s = -10",
        ),
        (
            "[world.delay]\ntransport_s = -10.0",
            "world.delay.transport_s = -10",
        ),
        (
            "[world.delay]\ncomputation_s = -10.0",
            "world.delay.computation_s = -10",
        ),
        (
            "[controller.estimator]\nphi_noise_rad = -1.0",
            "controller.estimator.phi_noise_rad = -1",
        ),
        (
            "[controller.estimator]\ntheta_dot_noise_rad_s = -1e3",
            "controller.estimator.theta_dot_noise_rad_s = -1000",
        ),
        (
            "[controller.shaping]\ntilt_rad = 0.1\nphi_dot_rad_s = -1e3",
            "controller.shaping.phi_dot_rad_s = -1000",
        ),
    ] {
        let said = refused(&scenario(&[], lines));
        assert!(said.contains(key) && !said.contains("unusual"), "{said}");
    }
    for (from, to) in [
        ("t_s = 0.05", "t_s = -50.0"),
        ("r = 1000.0", "r = 1000.0\ndelay_s = -10.0"),
    ] {
        let said = refused(&scenario(&[(from, to)], ""));
        assert!(!said.contains("unusual"), "{said}");
    }
}

#[test]
fn places_in_other_units_are_asked_about() {
    let jump = "{ time_s = 1.0, phi_rad = 6.283185307179586 }";
    let to_500 = "{ time_s = 1.0, phi_rad = 500.0 }";
    let points = "points = [\n    { time_s = 0.0, phi_rad = 0.0 },";
    for (from, to, words) in [
        (
            jump,
            to_500,
            [
                "reference.set_points.points[1].phi_rad = 500",
                "500 degrees are 8.727 rad",
            ],
        ),
        (
            "phi_rad = 0.0\ntheta_rad = 0.0",
            "phi_rad = 1000.0\ntheta_rad = 0.0",
            ["initial_state.phi_rad = 1000", "1000 degrees are 17.45 rad"],
        ),
        (
            points,
            "points = [\n    { time_s = 0.0, phi_rad = 1e200 },",
            ["points[0].phi_rad = 1e200", "more than 450 rad"],
        ),
    ] {
        let mut changed = scenario(&[(from, to)], "");
        let said = refused(&changed);
        for word in words {
            assert!(said.contains(word), "no `{word}` in: {said}");
        }
        assert!(said.contains("accept_unusual_values = true"), "{said}");
        assert!(said.len() < 400, "{said}");
        changed.accept_unusual_values = true;
        changed.prepare(Path::new(".")).expect("it is meant");
    }
    let lissajous = builtin::find("lissajous").expect("built-in").text;
    let start = lissajous.find("amplitude_x_m = ").expect("a curve");
    let line = lissajous[start..].lines().next().expect("a line");
    let text = lissajous.replace(line, "amplitude_x_m = 800.0");
    let said = refused(&Scenario::parse(&text, "my.toml").expect("valid TOML"));
    assert!(said.contains("800 mm are 0.8 m"), "{said}");
}

/// The robot of the world, and one of a file without a scenario, have the limits of the model's.
#[test]
fn every_robot_in_other_units_is_asked_about() {
    let robot = "[parameters]\nb1_m2 = 0.03\nb2_m2 = 0.01\nb3_m2 = 0.14\nb4_m2_s = 0.01\n\
                 centre_of_mass_m = 0.3\nball_radius_m = 120.0\nwheel_radius_m = 0.05\n\
                 gravity_m_s2 = 9.81\n";
    let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join("millimetres.toml");
    std::fs::write(&file, robot).expect("writable");
    let lines = format!("[world]\nparameters = {file:?}");
    let mut of_the_world = scenario(&[], &lines);
    let said = refused(&of_the_world);
    for word in ["world.parameters.ball_radius_m = 120", "120 mm are 0.12 m"] {
        assert!(said.contains(word), "no `{word}` in: {said}");
    }
    of_the_world.accept_unusual_values = true;
    if let Err(error) = of_the_world.prepare(Path::new(".")) {
        assert!(!error.to_string().contains("unusual"), "{error}");
    }
    let said = read_robot(&file).expect_err("mm").to_string();
    for word in [
        "millimetres.toml",
        "parameters.ball_radius_m = 120",
        "120 mm are 0.12 m",
    ] {
        assert!(said.contains(word), "no `{word}` in: {said}");
    }
    let meant = file.with_file_name("meant.toml");
    let text = format!("accept_unusual_values = true\n{robot}");
    std::fs::write(&meant, text).expect("writable");
    read_robot(&meant).expect("it is meant");
}

#[test]
fn a_world_in_other_units_is_asked_about() {
    for (lines, words) in [
        ("[world.delay]\ntransport_s = 20.0", "20 ms are 0.02 s"),
        (
            "[world.actuator]\nlimit_nm = 1500.0",
            "1500 mN m are 1.5 N m",
        ),
        (
            "[world.sensors.theta]\nbias_rad = 2.0",
            "2 degrees are 0.03491 rad",
        ),
        (
            "[[world.pushes]]\nimpulse = { time_s = 1.0, momentum_m_s = 0.1, height_m = 300.0 }",
            "300 mm are 0.3 m",
        ),
    ] {
        let said = refused(&scenario(&[], lines));
        assert!(said.contains(words), "no `{words}` in: {said}");
    }
}

#[test]
fn none_is_not_unusual() {
    let scenario = scenario(
        &[("torque_nm = [-1.5, 1.5]", "torque_nm = [-inf, inf]")],
        "[world.actuator]\nlimit_nm = inf",
    );
    scenario.prepare(Path::new(".")).expect("accepted");
}

#[test]
fn work_without_end_is_refused_whoever_means_it() {
    for (changes, lines, words) in [
        (
            &[("t_s = 0.05", "t_s = 100.0")][..],
            "",
            &["t_s", "100 s", "4.04969", "e^405"][..],
        ),
        (&[("t_s = 0.05", "t_s = 1e6")], "", &["t_s", "1000000 s"]),
        (
            &[("r = 1000.0", "r = 1000.0\ndelay_s = 1e6")],
            "",
            &["controller.delay_s = 1000000", "steps"],
        ),
        (
            &[],
            "[world]\nsensor_period_s = 5e-9",
            &["world.sensor_period_s", "10000"],
        ),
    ] {
        let mut scenario = scenario(changes, lines);
        scenario.accept_unusual_values = true;
        scenario.controller.predictor = None;
        let said = refused(&scenario);
        for word in words {
            assert!(said.contains(word), "no `{word}` in: {said}");
        }
    }
}

#[test]
fn weights_that_no_regulator_can_follow_are_named() {
    for (q, r) in [(1e200, 1e3), (1e20, 1e3), (200.0, 1e-300)] {
        let mut scenario = scenario(&[], "");
        scenario.controller.q = Some([q, 1.0, 0.1, 0.1]);
        scenario.controller.r = Some(r);
        scenario.controller.terminal = ballbot_scenario::TerminalTable::DiscreteRiccati;
        let said = match scenario.prepare(Path::new(".")) {
            // A gain that is found has passed its check.
            Ok(_) => continue,
            Err(error) => error.to_string(),
        };
        assert!(said.contains("controller.q"), "{said}");
        assert!(!said.contains("detectable"), "{said}");
    }
}
