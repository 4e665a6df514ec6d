//! Robots from files, drawn robots, their friction, and an excitation on top of the loop.

use ballbot::{Ballbot, DriveFriction};
use ballbot_scenario::{Parameters, Prepared, RunHooks, Scenario, WorldTable};
use lpvmpc_sim::Recording;
use std::path::{Path, PathBuf};

/// Of each test, since tests run beside each other: their threads have their names.
fn folder() -> PathBuf {
    let test = std::thread::current();
    let name = test.name().expect("a test").replace("::", "-");
    Path::new(env!("CARGO_TARGET_TMPDIR")).join(name)
}

fn file(name: &str, content: &str) -> PathBuf {
    std::fs::create_dir_all(folder()).expect("writable");
    let path = folder().join(name);
    std::fs::write(&path, content).expect("writable");
    path
}

/// A rigid robot whose torque is in N m: 10 kg on a wheel of 0.05 m.
const ROBOT: &str = "[parameters]
b1_m2 = 0.03
b2_m2 = 0.0107
b3_m2 = 0.1428
b4_m2_s = 0.01
drive_friction_m2_s = 0.03
centre_of_mass_m = 0.2978
ball_radius_m = 0.12
wheel_radius_m = 0.5
gravity_m_s2 = 9.81
";

/// b1 and the gain hang together, b4 is known badly, b3 not at all less than exactly.
const COVARIANCE: &str = "
[identification.torque_gain_1_kg]
value = 0.1
standard_deviation = 0.004
[identification.covariance]
parameters = [\"b1_m2\", \"b4_m2_s\", \"delay_s\", \"torque_gain_1_kg\"]
matrix = [
    [1e-6, 0.0, 0.0, 2e-6],
    [0.0, 1e-4, 0.0, 0.0],
    [0.0, 0.0, 1e-8, 0.0],
    [2e-6, 0.0, 0.0, 1.6e-5],
]
";

fn scenario(name: &str) -> Scenario {
    let mut scenario = Scenario::load("single-setpoint").expect("built-in");
    scenario.parameters = Parameters::File(name.into());
    scenario.controller.terminal = Default::default();
    scenario.controller.predictor = None;
    scenario.bounds.torque_nm = [-15.0, 15.0];
    scenario
}

fn prepare(scenario: &Scenario) -> Prepared {
    scenario.prepare(folder().as_path()).expect("valid")
}

fn refusal(scenario: &Scenario) -> String {
    match scenario.prepare(folder().as_path()) {
        Ok(_) => panic!("accepted"),
        Err(error) => error.to_string(),
    }
}

fn run(prepared: &Prepared) -> Recording<4, 1, 4> {
    let mut recordings = prepared.record(&RunHooks::NONE).expect("runs");
    recordings.planes.remove(0)
}

#[track_caller]
fn assert_says(message: &str, words: &[&str]) {
    for word in words {
        assert!(message.contains(word), "no `{word}` in: {message}");
    }
}

#[test]
fn a_file_is_the_table_in_it() {
    file("robot.toml", ROBOT);
    let from_file = prepare(&scenario("robot.toml"));
    let text = format!("x = 1\n{ROBOT}");
    file("with-more.toml", &text);
    assert_eq!(
        from_file.ballbot,
        prepare(&scenario("with-more.toml")).ballbot
    );
    assert_eq!(from_file.ballbot.b2, 0.0107);
    assert_eq!(
        from_file.ballbot.drive,
        DriveFriction {
            viscous: 0.03,
            coulomb: 0.0
        }
    );
    // In a scenario file it is a string where the table would be.
    let builtin = ballbot_scenario::builtin::find("single-setpoint").expect("built-in");
    let start = builtin.text.find("[parameters]").expect("a table");
    let end = builtin.text.find("[controller]").expect("a table");
    let text = |value: &str| {
        let (head, rest) = (&builtin.text[..start], &builtin.text[end..]);
        format!("{head}\nparameters = {value}\n{rest}")
    };
    let parsed = Scenario::parse(&text("\"robot.toml\""), "my.toml").expect("valid");
    assert_eq!(parsed.parameters, Parameters::File("robot.toml".into()));
    let wrong = Scenario::parse(&text("3"), "my.toml").expect_err("a number");
    assert_says(
        &wrong.to_string(),
        &["my.toml", "table of parameters, or the path"],
    );
}

#[test]
fn what_is_wrong_with_a_file_is_said_with_its_name() {
    assert_says(
        &refusal(&scenario("none.toml")),
        &["cannot read", "none.toml"],
    );
    file("empty.toml", "");
    assert_says(
        &refusal(&scenario("empty.toml")),
        &["empty.toml", "[parameters]"],
    );
    file("wrong.toml", &ROBOT.replace("b1_m2 = 0.03", "b1_m2 = nan"));
    let said = refusal(&scenario("wrong.toml"));
    assert_says(&said, &["wrong.toml", "parameters.b1_m2 = NaN", "finite"]);
    file("key.toml", &ROBOT.replace("b1_m2", "b1"));
    assert_says(
        &refusal(&scenario("key.toml")),
        &["key.toml", "unknown field `b1`"],
    );
}

#[test]
fn drawn_robots_have_the_covariance_and_repeat() {
    file("known.toml", &format!("{ROBOT}{COVARIANCE}"));
    let mut scenario = scenario("known.toml");
    let mut drawn = |seed: u64| -> Ballbot<f64> {
        scenario.world = Some(WorldTable {
            draw: Some(seed),
            ..WorldTable::default()
        });
        let prepared = prepare(&scenario);
        assert_eq!(prepared.ballbot.b1, 0.03, "the controller's model stays");
        prepared.planes[0].world.robot.mechanics.ballbot
    };
    assert_eq!(drawn(7), drawn(7));
    let count = 2000;
    let robots: Vec<Ballbot<f64>> = (0..count).map(&mut drawn).collect();
    let gain = |robot: &Ballbot<f64>| 0.05 / robot.geometry.wheel_radius;
    let mean =
        |of: &dyn Fn(&Ballbot<f64>) -> f64| robots.iter().map(of).sum::<f64>() / count as f64;
    let b1 = mean(&|robot| robot.b1 - 0.03);
    let covariance = mean(&|robot| (robot.b1 - 0.03) * (gain(robot) - 0.1));
    let variance = mean(&|robot| (robot.b1 - 0.03).powi(2));
    let of_gain = mean(&|robot| (gain(robot) - 0.1).powi(2));
    // Four standard deviations of each mean of 2000.
    assert!(b1.abs() < 4.0 * 1e-3 / 2000_f64.sqrt(), "{b1}");
    for (found, expected) in [(variance, 1e-6), (of_gain, 1.6e-5), (covariance, 2e-6)] {
        assert!(
            (found / expected - 1.0).abs() < 0.25,
            "{found} for {expected}"
        );
    }
    // What was held stays, and no robot gains energy by rolling, though b4 is as large as its error.
    assert!(
        robots
            .iter()
            .all(|robot| robot.b3 == 0.1428 && robot.b4 >= 0.0)
    );
    assert!(robots.iter().any(|robot| robot.b4 > 0.02));
}

#[test]
fn there_must_be_a_covariance_to_draw_from() {
    file("robot.toml", ROBOT);
    let draw = |name: &str| {
        let mut scenario = scenario(name);
        scenario.world = Some(WorldTable {
            draw: Some(1),
            ..WorldTable::default()
        });
        refusal(&scenario)
    };
    assert_says(
        &draw("robot.toml"),
        &["world.draw", "no covariance", "identify", "as parameters"],
    );
    let mut of_world = scenario("robot.toml");
    of_world.world = Some(WorldTable {
        draw: Some(1),
        parameters: Some(of_world.parameters.clone()),
        ..WorldTable::default()
    });
    assert_says(
        &refusal(&of_world),
        &["world.draw", "of world.parameters", "leave that out"],
    );
    for (name, from, to, words) in [
        ("negative.toml", "[1e-6,", "[-1e-6,", "negative variances"),
        ("lopsided.toml", "2e-6]", "1e-6]", "symmetric"),
        ("indefinite.toml", "2e-6", "9e-6", "semidefinite"),
        ("infinite.toml", "1e-4", "inf", "did not tell"),
        (
            "short.toml",
            "[0.0, 1e-4, 0.0, 0.0],",
            "",
            "a row and a column",
        ),
    ] {
        let text = format!("{ROBOT}{COVARIANCE}");
        assert!(text.contains(from));
        file(name, &text.replace(from, to));
        assert_says(&draw(name), &["identification.covariance.matrix", words]);
        // It can be controlled all the same.
        prepare(&scenario(name));
    }
}

#[test]
fn dry_friction_of_the_drive_and_of_the_robot_are_the_same() {
    file("robot.toml", ROBOT);
    file("dry.toml", &format!("{ROBOT}drive_coulomb_m2_s2 = 0.048\n"));
    let mut scenario = scenario("robot.toml");
    let of_the_robot = WorldTable {
        parameters: Some(Parameters::File("dry.toml".into())),
        ..WorldTable::default()
    };
    let mut of_the_drive = WorldTable::default();
    // r_b / r_w = 0.24.
    of_the_drive.actuator.coulomb_friction_nm = 0.2;
    let mut with = |world| {
        scenario.world = Some(world);
        run(&prepare(&scenario)).trajectory
    };
    let (robot, drive) = (with(of_the_robot), with(of_the_drive));
    let without = with(WorldTable::default());
    let far = |a: &lpvmpc_sim::Trajectory<4, 1>| {
        let pairs = a.states().zip(robot.states());
        pairs.map(|(a, b)| (a - b).amax()).fold(0.0, f64::max)
    };
    assert!(far(&drive) < 1e-6, "{}", far(&drive));
    assert!(far(&without) > 1e-2, "{}", far(&without));
}

#[test]
fn a_controller_that_knows_the_friction_follows_better() {
    file("robot.toml", ROBOT);
    file("dry.toml", &format!("{ROBOT}drive_coulomb_m2_s2 = 0.048\n"));
    let error = |model: &str| {
        let mut scenario = scenario(model);
        scenario.duration_s = 8.0;
        scenario.reference = ballbot_scenario::ReferenceTable::Sine(ballbot_scenario::SineTable {
            amplitude_rad: 2.0,
            angular_frequency_rad_s: 1.5,
            phase_rad: 0.0,
            offset_rad: 0.0,
        });
        scenario.controller.r = Some(1.0);
        scenario.world = Some(WorldTable {
            parameters: Some(Parameters::File("dry.toml".into())),
            ..WorldTable::default()
        });
        let run = run(&prepare(&scenario)).trajectory;
        let errors = run.samples.iter().filter(|sample| sample.t > 4.0);
        errors
            .map(|sample| (sample.x[0] - sample.x_ref[0]).powi(2))
            .sum::<f64>()
    };
    let (knowing, ignorant) = (error("dry.toml"), error("robot.toml"));
    assert!(knowing < 0.5 * ignorant, "{knowing} and {ignorant}");
}

/// Its torque acted to the end of the run.
#[test]
fn an_excitation_of_one_row_is_refused() {
    file("robot.toml", ROBOT);
    file("excitation.csv", "t_s,torque_excitation_nm\n0.0,0.3\n");
    let mut scenario = scenario("robot.toml");
    scenario.world = Some(WorldTable {
        excitation: Some("excitation.csv".into()),
        ..WorldTable::default()
    });
    let error = scenario.prepare(folder().as_path()).expect_err("refused");
    assert!(error.to_string().contains("one row only"), "{error}");
}

#[test]
fn an_excitation_comes_on_top_and_ends() {
    file("robot.toml", ROBOT);
    let torques = [0.3, -0.2, 0.1, 0.4];
    let rows: String = (0..4)
        .map(|i| format!("{},{}\n", f64::from(i) * 0.05, torques[i as usize]))
        .collect();
    file(
        "excitation.csv",
        &format!("t_s,torque_excitation_nm\n{rows}"),
    );
    let mut scenario = scenario("robot.toml");
    scenario.initial_state = Default::default();
    scenario.reference = ballbot_scenario::ReferenceTable::SetPoints {
        points: vec![ballbot_scenario::PointTable {
            time_s: 0.0,
            phi_rad: 0.0,
        }],
    };
    let world = WorldTable {
        sensor_period_s: Some(0.025),
        ..WorldTable::default()
    };
    let mut with = |excitation: Option<&str>| {
        scenario.world = Some(WorldTable {
            excitation: excitation.map(PathBuf::from),
            ..world.clone()
        });
        run(&prepare(&scenario))
    };
    let excited = with(Some("excitation.csv"));
    let at = |row: usize| excited.log[row].commanded[0];
    // At rest at zero the controller itself commands nothing.
    assert!((at(0) - 0.3).abs() < 1e-9 && (at(1) - 0.3).abs() < 1e-9);
    // Then it answers, and holds its answer over the two samples of the sensors.
    assert!((at(2) - at(3)).abs() < 1e-12);
    assert!((excited.trajectory.samples[1].u[0] - at(2)).abs() < 1e-12);
    let after = &excited.log[8];
    assert!(after.commanded[0].abs() < 15.0);
    let last = excited.log.last().expect("a row");
    assert!(last.commanded[0].abs() < 1e-2, "it has ended: {last:?}");
    assert!(with(None).log.iter().all(|row| row.commanded[0] == 0.0));

    file(
        "gap.csv",
        "t_s,torque_excitation_nm\n0,1\n0.1,1\n0.2,1\n0.9,1\n",
    );
    scenario.world = Some(WorldTable {
        excitation: Some("gap.csv".into()),
        ..world
    });
    assert_says(&refusal(&scenario), &["gap.csv", "line 5", "gap"]);
}
