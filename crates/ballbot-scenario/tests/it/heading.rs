//! Both planes and yaw as one robot with three motors, each with its limit.

use ballbot::{AnyPlanner, HEADING, PlanePlanner, RobotRegulator, RobotState, plane_feedback};
use ballbot_scenario::{
    EstimatorTable, MotorsTable, ParameterTable, Parameters, Prepared, Problem, Record, RunHooks,
    Scenario, StateTable, TorqueRateTable, WorldTable,
};
use lpvmpc::{Measurement, Reading, Regulator, Status, Verdict};
use lpvmpc_sim::Termination;
use std::path::Path;

fn example() -> Scenario {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/examples/turning-robot.toml");
    Scenario::load(file.to_str().expect("text")).expect("valid")
}

fn motors(scenario: &mut Scenario) -> &mut MotorsTable {
    scenario
        .controller
        .motors
        .as_mut()
        .expect("the example has them")
}

fn run(scenario: &Scenario) -> (Prepared, Record) {
    let prepared = scenario.prepare(Path::new(".")).expect("valid");
    let record = prepared.record(&RunHooks::NONE).expect("runs");
    (prepared, record)
}

fn stands(record: &Record) -> bool {
    let mut runs = record.planes.iter();
    runs.all(|plane| plane.trajectory.termination == Termination::Complete)
}

fn largest_motor(record: &Record) -> f64 {
    let samples = record.motors.as_ref().expect("they are shared");
    let torques = samples.iter().map(|sample| sample.torques.amax());
    torques.fold(0.0, f64::max)
}

fn regulator(prepared: &Prepared) -> RobotRegulator<f64, AnyPlanner<f64>> {
    let motors = prepared.motors.expect("given");
    let plane = || {
        let planner = PlanePlanner::Held(prepared.settings);
        let (u, t_s) = (prepared.settings.u, prepared.settings.t_s);
        plane_feedback(&prepared.ballbot, &planner, &prepared.feedback, &u, t_s).expect("valid")
    };
    let (law, heading) = (motors.turning.law, motors.turning.initial);
    let planes = [plane(), plane()];
    RobotRegulator::new(planes, (), prepared.wheels, motors.limits, law, heading)
}

/// Without a heading to turn to there is no yaw torque, and the status says so; it was all that is kept for yaw.
#[test]
fn a_wanted_heading_that_is_no_number_turns_nothing() {
    let prepared = example().prepare(Path::new(".")).expect("valid");
    let mut regulator = regulator(&prepared);
    let readings = [Some(Reading::fresh(0.0)); 10];
    regulator.observe(&Measurement { t: 0.0, readings });
    let upright = regulator.decide(&|_| RobotState::zeros());
    assert!(upright.status.is_solved() && upright.u.amax() < 1e-9);
    let command = regulator.decide(&|_| {
        let mut state = RobotState::zeros();
        state[HEADING] = f64::NAN;
        state
    });
    assert_eq!(command.status, Status::NotFinite);
    assert!(command.u.amax() < 1e-9, "{}", command.u);
}

/// A robot's regulator says what it decided for, and one that takes its place in mid-run goes on to
/// the last bit.
#[test]
fn a_robot_s_regulator_tells_its_state_and_takes_over() {
    let prepared = example().prepare(Path::new(".")).expect("valid");
    let motors = prepared.motors.expect("given");
    let new = || regulator(&prepared);
    let state =
        |k: usize| RobotState::from_fn(|i, _| 0.02 * ((1 + i) as f64 * 0.3 * k as f64).sin());
    let reference = |t: f64| {
        let mut state = RobotState::zeros();
        (state[0], state[4], state[HEADING]) = (1.0 + 0.1 * t, -0.5, 0.3 * t);
        state
    };
    let decide = |regulator: &mut RobotRegulator<f64, AnyPlanner<f64>>, k: usize| {
        let x = state(k);
        let observation = regulator.observe(&Measurement {
            t: k as f64 * prepared.settings.t_s,
            readings: std::array::from_fn(|i| Some(Reading::fresh(x[i]))),
        });
        assert!(observation.verdicts.iter().all(|verdict| verdict.is_used()));
        let command = regulator.decide(&reference);
        assert_eq!(command.estimate, x, "{k}");
        assert!(
            command.u.amax() <= motors.limits.motor,
            "{k}: {}",
            command.u
        );
        command
    };
    let mut alone = new();
    let mut handed = new();
    for k in 0..12 {
        let expected = decide(&mut alone, k);
        assert_eq!(decide(&mut handed, k), expected, "{k}");
        let mut next = new();
        next.take_over(&handed);
        handed = next;
    }
}

#[test]
fn a_turning_robot_follows_the_curve_and_no_motor_is_asked_for_more_than_it_has() {
    let scenario = example();
    let (prepared, record) = run(&scenario);
    assert!(stands(&record));
    let [x, y] = record.planes.as_slice() else {
        unreachable!("two planes")
    };
    let samples = x.trajectory.samples.iter().zip(&y.trajectory.samples);
    for (x, y) in samples.filter(|(x, _)| x.t > 10.0) {
        let (along_x, along_y) = (x.x[0] - x.x_ref[0], y.x[0] - y.x_ref[0]);
        let way = prepared.ballbot.geometry.position(along_x.hypot(along_y));
        assert!(way < 0.02, "{way} m beside the curve at {} s", x.t);
    }
    let turned = record.motors.as_ref().expect("they are shared");
    for sample in turned.iter().filter(|sample| sample.t > 10.0) {
        let off = sample.heading - sample.target;
        assert!(off.abs() < 0.2, "heading off by {off} at {} s", sample.t);
    }
    let limit = prepared.motors.expect("given").limits.motor;
    let most = largest_motor(&record);
    assert!(most <= limit * (1.0 + 1e-9), "{most} N m");
    assert!(most > 0.9 * limit, "the limit was needed: {most} N m");
}

/// The motors' torques are turned by the measured heading: one that is wrong by more than a
/// right angle pushes the robot the other way.
#[test]
fn with_a_wrong_heading_it_falls() {
    let mut scenario = example();
    scenario.heading.as_mut().expect("given").bias_rad = 2.0;
    // A world, in which the robot falls to the floor instead of being without a plan.
    scenario.world = Some(WorldTable::default());
    let (_, record) = run(&scenario);
    let termination = &record.planes[0].trajectory.termination;
    assert!(
        matches!(termination, Termination::OutOfRange { .. }),
        "{termination:?}"
    );
    // A run that ends with that sample ends with the fall; it was complete.
    scenario.duration_s = record.planes[0].trajectory.final_time;
    let (prepared, ended) = run(&scenario);
    assert_eq!(prepared.samples, record.planes[0].trajectory.samples.len());
    assert_eq!(ended.planes[0].trajectory.termination, *termination);
}

/// The simulated robot had the wheels of the model, whatever its own parameters said.
#[test]
fn on_other_wheels_than_the_model_s_it_falls() {
    let mut scenario = example();
    let Parameters::Table(mut real) = scenario.parameters.clone() else {
        unreachable!("a table")
    };
    let mut with = |real: &ParameterTable| {
        scenario.world = Some(WorldTable {
            parameters: Some(Parameters::Table(*real)),
            ..WorldTable::default()
        });
        run(&scenario).1
    };
    assert!(stands(&with(&real)));
    real.wheels_reversed = [true; 3];
    let record = with(&real);
    assert!(!stands(&record));
    // What a plane feels is the opposite of what was decided for it.
    let (sample, row) = (
        &record.planes[0].trajectory.samples[0],
        &record.planes[0].log[0],
    );
    assert!(sample.u[0].abs() > 0.01);
    assert!((row.commanded[0] + sample.u[0]).abs() < 1e-9);
}

/// A plane's log told of the other one's beginning.
#[test]
fn each_plane_s_log_tells_of_its_own_beginning() {
    let mut scenario = example();
    scenario.duration_s = 1.0;
    scenario.controller.estimator = Some(EstimatorTable::default());
    let mut world = WorldTable::default();
    for dropout in [
        &mut world.sensors.phi.dropout,
        &mut world.sensors.theta.dropout,
        &mut world.sensors.theta_dot.dropout,
    ] {
        *dropout = 0.9;
    }
    let mut apart = 0;
    for seed in 0..8 {
        world.seed = seed;
        scenario.world = Some(world.clone());
        let (_, record) = run(&scenario);
        let begins = [0, 1].map(|index: usize| {
            let log = &record.planes[index].log;
            let first = log.iter().position(|row| {
                let mut verdicts = row.observation.verdicts.iter();
                verdicts.any(|verdict| verdict.is_used())
            });
            let told = log.iter().position(|row| row.observation.restart.is_some());
            assert_eq!(told, first, "seed {seed}, plane {index}");
            told
        });
        apart += usize::from(begins[0] != begins[1]);
    }
    assert!(apart > 2, "{apart}");
}

/// A measurement out of order, or without a time, set the heading back.
#[test]
fn a_heading_out_of_order_is_refused() {
    let prepared = example().prepare(Path::new(".")).expect("valid");
    let estimator = EstimatorTable::default();
    let mut scenario = example();
    scenario.controller.estimator = Some(estimator);
    let filtered = scenario.prepare(Path::new(".")).expect("valid");
    let readings = |heading: f64| {
        let mut readings = [Some(Reading::fresh(0.0)); 10];
        readings[HEADING] = Some(Reading::fresh(heading));
        readings
    };
    let mut robot = regulator(&filtered);
    let mut see = |t: f64, heading: f64| {
        let readings = readings(heading);
        let seen = robot.observe(&Measurement { t, readings });
        (seen.verdicts[HEADING], robot.heading())
    };
    assert_eq!(see(1.0, 0.1), (Verdict::Used, 0.1));
    assert_eq!(see(0.9, 0.5), (Verdict::Stale, 0.1));
    assert_eq!(see(f64::NAN, 0.5), (Verdict::NotFinite, 0.1));
    assert_eq!(see(1.1, 0.2), (Verdict::Used, 0.2));
    // Another clock, by which the planes begin anew, too.
    assert_eq!(see(-9.0, 0.3), (Verdict::Used, 0.3));
    assert_eq!(see(-8.9, 0.4), (Verdict::Used, 0.4));
    // Without a filter any time that goes back is another clock's.
    let mut direct = regulator(&prepared);
    for (t, heading) in [(1.0, 0.1), (0.9, 0.5)] {
        let readings = readings(heading);
        direct.observe(&Measurement { t, readings });
        assert_eq!(direct.heading(), heading);
    }
}

/// A plane whose bounds must not change keeps to its own; one that took over from a plane with a share kept that for ever.
#[test]
fn a_share_is_not_handed_to_a_planner_that_has_none() {
    let mut scenario = example();
    let feedback = |scenario: &Scenario| {
        let prepared = scenario.prepare(Path::new(".")).expect("valid");
        let (u, t_s) = (prepared.settings.u, prepared.settings.t_s);
        let planner = match &prepared.problem {
            Problem::Ramped(settings) => PlanePlanner::Ramped(*settings),
            _ => PlanePlanner::Held(prepared.settings),
        };
        plane_feedback(&prepared.ballbot, &planner, &prepared.feedback, &u, t_s).expect("valid")
    };
    let mut held = feedback(&scenario);
    held.set_share(nalgebra::Vector1::new(0.01));
    scenario.controller.torque_rate = Some(TorqueRateTable {
        limit_nm_s: 20.0,
        weight: 0.02,
    });
    let mut ramped = feedback(&scenario);
    ramped.take_over(&held);
    let readings = [0.0, 0.1, 0.0, 0.0].map(|value| Some(Reading::fresh(value)));
    ramped.observe(&Measurement { t: 0.0, readings });
    let command = ramped.decide(&|_| nalgebra::Vector4::zeros(), &mut ());
    assert!(command.u[0].abs() > 0.1, "{}", command.u);
}

/// Where planes share their motors it used to be left out without a word.
#[test]
fn an_excitation_is_added_to_the_torque_of_the_x_plane_however_the_robot_stands() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("excited-whole-robot");
    std::fs::create_dir_all(&folder).expect("writable");
    // Torques that change between two samples of the control; the record said the next one.
    let rows = (0..40).map(|i| {
        let t = 0.0125 + 0.05 * f64::from(i);
        format!("{t},{}\n", 0.3 * f64::from(i).sin())
    });
    let text = format!("t_s,torque_excitation_nm\n{}", rows.collect::<String>());
    std::fs::write(folder.join("torque.csv"), text).expect("writable");
    let mut scenario = example();
    scenario.duration_s = 3.0;
    scenario.initial_state = StateTable::default();
    scenario.initial_state_y = Some(StateTable::default());
    // Enough for both planes, so that each moves as if it were alone.
    motors(&mut scenario).limit_nm = 10.0;
    let heading = scenario.heading.as_mut().expect("given");
    (heading.initial_deg, heading.target_deg) = (40.0, 40.0);
    heading.target_rate_deg_s = 0.0;
    let run = |scenario: &Scenario| {
        let prepared = scenario.prepare(folder.as_path()).expect("valid");
        prepared.record(&RunHooks::NONE).expect("runs").planes
    };
    let mut with = |excitation: Option<&str>| {
        scenario.world = Some(WorldTable {
            excitation: excitation.map(Into::into),
            sensor_period_s: Some(0.0125),
            ..WorldTable::default()
        });
        let mut alone = scenario.clone();
        (alone.controller.motors, alone.heading) = (None, None);
        [run(&scenario), run(&alone)]
    };
    let [still, _] = with(None);
    let [together, alone] = with(Some("torque.csv"));
    let torque = |run: &lpvmpc_sim::Recording<4, 1, 4>, k: usize| run.trajectory.samples[k].u[0];
    assert!((torque(&together[0], 3) - torque(&still[0], 3)).abs() > 0.05);
    for (together, alone) in together.iter().zip(&alone) {
        assert_eq!(together.trajectory.samples.len(), 120);
        for (a, b) in together
            .trajectory
            .samples
            .iter()
            .zip(&alone.trajectory.samples)
        {
            // Both are integrated within tolerances.
            assert!(
                (a.x - b.x).amax() < 1e-6,
                "{} and {} at {} s",
                a.x,
                b.x,
                a.t
            );
            assert!(
                (a.u - b.u).amax() < 1e-4,
                "{} and {} at {} s",
                a.u,
                b.u,
                a.t
            );
        }
        for (a, b) in together.log.iter().zip(&alone.log) {
            let off = (a.commanded - b.commanded).amax();
            assert!(off < 1e-4, "{off} at {} s", a.t);
        }
    }
}

/// The bound of a plane alone, in both planes at once.
#[test]
fn without_sharing_a_motor_is_asked_for_more_than_it_has() {
    let mut scenario = example();
    let limit = scenario.prepare(Path::new(".")).expect("valid").motors;
    let limit = limit.expect("given").limits.motor;
    let wheels = ballbot::Wheels::<f64>::paper();
    let alone = wheels.plane_torques(limit, 0.0).alone();
    scenario.bounds.torque_nm = [-alone, alone];
    scenario.controller.motors = None;
    scenario.heading = None;
    scenario.initial_state_y = Some(StateTable {
        phi_rad: 8.0,
        ..StateTable::default()
    });
    let (prepared, record) = run(&scenario);
    let trajectories: Vec<_> = record.planes.into_iter().map(|p| p.trajectory).collect();
    let torques = prepared.motor_torques(&trajectories);
    let most = torques.iter().map(|t| t.amax()).fold(0.0, f64::max);
    assert!(most > 1.2 * limit, "{most} N m of {limit} N m");
}

/// A push in one plane that half of the disc's square would not stand: the other plane is at
/// rest and leaves its part.
#[test]
fn a_plane_that_needs_more_than_an_equal_share_gets_it() {
    let mut scenario = example();
    scenario.world = Some(WorldTable::default());
    scenario.heading = None;
    scenario.duration_s = 5.0;
    scenario.initial_state_y = Some(StateTable::default());
    scenario.initial_state = StateTable {
        theta_dot_rad_s: 2.75,
        ..StateTable::default()
    };
    let (prepared, record) = run(&scenario);
    assert!(stands(&record));
    let motors = prepared.motors.expect("given");
    let left = prepared.wheels.plane_torques(motors.limits.motor, 0.0);
    let samples = record.planes[0].trajectory.samples.iter();
    let most = samples.map(|sample| sample.u[0].abs()).fold(0.0, f64::max);
    assert!(
        most > 1.2 * left.equal() && most <= left.alone() * (1.0 + 1e-9),
        "{most} N m; an equal share is {} N m",
        left.equal()
    );

    // The negative control: an equal share as the plane's own bound.
    scenario.bounds.torque_nm = [-left.equal(), left.equal()];
    let (_, record) = run(&scenario);
    assert!(!stands(&record), "an equal share must not do");
}

/// Random starts, headings, targets and pushes, with yaw at work.
#[test]
fn in_no_run_of_a_campaign_a_motor_gets_more_than_its_limit() {
    let mut random = fastrand::Rng::with_seed(3);
    let mut between = |lower: f64, upper: f64| lower + (upper - lower) * random.f64();
    let mut at_limit = 0;
    for run_number in 0..40 {
        let mut scenario = example();
        scenario.world = Some(WorldTable::default());
        scenario.duration_s = 2.0;
        let mut state = || StateTable {
            phi_rad: between(-5.0, 5.0),
            theta_rad: between(-0.15, 0.15),
            phi_dot_rad_s: between(-3.0, 3.0),
            theta_dot_rad_s: between(-1.0, 1.0),
        };
        scenario.initial_state = state();
        scenario.initial_state_y = Some(state());
        motors(&mut scenario).limit_nm = between(0.3, 1.0);
        motors(&mut scenario).yaw_reserve_nm = between(0.0, 0.1);
        let heading = scenario.heading.as_mut().expect("given");
        heading.initial_deg = between(-180.0, 180.0);
        heading.target_deg = between(-180.0, 180.0);
        heading.target_rate_deg_s = between(-90.0, 90.0);
        // Fallen or not: the torques count.
        let (prepared, record) = run(&scenario);
        let limit = prepared.motors.expect("given").limits.motor;
        let most = largest_motor(&record);
        assert!(
            most <= limit * (1.0 + 1e-9),
            "run {run_number}: {most} N m of {limit} N m"
        );
        at_limit += usize::from(most > 0.95 * limit);
    }
    assert!(at_limit > 10, "the limit mattered in {at_limit} runs only");
}
