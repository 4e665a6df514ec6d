//! The examples of docs/robust-control.md: what has to hold in a world as it is.
//!
//! Run with `--nocapture` for the figures.

use ballbot_scenario::{
    DeviationsTable, DisturbancesTable, Prepared, RunHooks, Scenario, SensorsTable,
    TorqueRateTable, WorldTable,
};
use lpvmpc::Status;
use lpvmpc_sim::{Recording, Termination};
use std::path::Path;

fn example(name: &str) -> Scenario {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/examples");
    let path = folder.join(name).with_extension("toml");
    Scenario::load(path.to_str().expect("text")).expect("valid")
}

fn run(scenario: &Scenario) -> (Prepared, Vec<Recording<4, 1, 4>>) {
    let prepared = scenario.prepare(Path::new(".")).expect("valid");
    let record = prepared.record(&RunHooks::NONE).expect("runs");
    (prepared, record.planes)
}

/// Runs a scenario that must come to its end.
fn stands(scenario: &Scenario) -> (Prepared, Vec<Recording<4, 1, 4>>) {
    let (prepared, recordings) = run(scenario);
    for recording in &recordings {
        assert_eq!(recording.trajectory.termination, Termination::Complete);
    }
    (prepared, recordings)
}

/// Root mean square of the way's error in mm, from one time to another (s).
fn rms_mm(prepared: &Prepared, recording: &Recording<4, 1, 4>, from: f64, until: f64) -> f64 {
    let samples = recording.trajectory.samples.iter();
    let errors: Vec<f64> = samples
        .filter(|sample| (from..=until).contains(&sample.t))
        .map(|sample| sample.x[0] - sample.x_ref[0])
        .collect();
    let mean = errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64;
    1000.0 * prepared.ballbot.geometry.position(mean.sqrt())
}

fn world(scenario: &mut Scenario) -> &mut WorldTable {
    scenario.world.as_mut().expect("the examples have a world")
}

#[test]
fn it_stands_a_push_and_follows_a_metre_within_20_mm() {
    for seed in 0..10 {
        let mut scenario = example("push-and-move");
        world(&mut scenario).seed = seed;
        let (prepared, recordings) = stands(&scenario);
        let error = rms_mm(&prepared, &recordings[0], 6.0, 10.0);
        println!("seed {seed}: {error:.1} mm");
        assert!(error < 20.0, "seed {seed}: {error} mm");
    }
}

#[test]
fn it_follows_a_lissajous_curve_through_a_push_within_25_mm() {
    for seed in 0..3 {
        let mut scenario = example("pushed-lissajous");
        world(&mut scenario).seed = seed;
        let (prepared, recordings) = stands(&scenario);
        // On the floor, both planes together, the push included.
        let [x, y] = [0, 1].map(|i| rms_mm(&prepared, &recordings[i], 0.0, 70.0));
        println!("curve, seed {seed}: {:.1} mm", x.hypot(y));
        assert!(x.hypot(y) < 25.0, "seed {seed}: {x} mm and {y} mm");
    }
}

#[test]
fn it_stands_with_every_parameter_wrong_by_20_percent() {
    for corner in 0..16 {
        let factor = |bit: u32| if corner & (1 << bit) == 0 { 0.8 } else { 1.2 };
        let mut scenario = example("push-and-move");
        world(&mut scenario).robot = DeviationsTable {
            b1_factor: factor(0),
            b2_factor: factor(1),
            b3_factor: factor(2),
            b4_factor: factor(3),
            ..DeviationsTable::default()
        };
        let (prepared, recordings) = stands(&scenario);
        let error = rms_mm(&prepared, &recordings[0], 6.0, 12.0);
        let tilt = recordings[0].trajectory.states().map(|x| x[1].abs());
        let tilt = tilt.fold(0.0, f64::max);
        println!("corner {corner:04b}: {error:.1} mm, {tilt:.2} rad");
        assert!(tilt < 0.7, "corner {corner:04b}: {tilt} rad");
        // It does not only keep from falling: it moves, and comes to rest at the set point.
        assert!(error < 25.0, "corner {corner:04b}: {error} mm");
    }
}

#[test]
fn it_falls_when_the_delay_is_not_compensated_and_no_state_is_estimated() {
    // The checks above can fail.
    let mut scenario = example("push-and-move");
    scenario.controller.delay_s = 0.0;
    scenario.controller.estimator = None;
    let delay = &mut world(&mut scenario).delay;
    delay.transport_s = 0.06;
    let (_, recordings) = run(&scenario);
    let termination = &recordings[0].trajectory.termination;
    assert!(
        matches!(termination, Termination::OutOfRange { component: 1, .. }),
        "{termination:?}"
    );
}

#[test]
fn constant_disturbances_leave_no_error() {
    let mut scenario = example("offset-free");
    scenario.duration_s = 40.0;
    world(&mut scenario).sensors = SensorsTable::default();
    let (prepared, recordings) = stands(&scenario);
    let error = rms_mm(&prepared, &recordings[0], 38.0, 40.0);
    assert!(error < 0.1, "{error} mm");

    // Without the disturbances in the filter they do.
    let estimator = scenario.controller.estimator.as_mut().expect("it has one");
    estimator.disturbances = DisturbancesTable::None;
    let (prepared, recordings) = run(&scenario);
    let error = rms_mm(&prepared, &recordings[0], 38.0, 40.0);
    assert!(error > 10.0, "{error} mm");
}

#[test]
fn the_torque_moves_in_ramps_no_steeper_than_allowed() {
    let mut scenario = example("push-and-move");
    let limit = 15.0;
    scenario.controller.torque_rate = Some(TorqueRateTable {
        limit_nm_s: limit,
        weight: 0.02,
    });
    // What the estimator corrects is not the plan's.
    scenario.controller.estimator = None;
    let world = world(&mut scenario);
    world.sensors = SensorsTable::default();
    world.robot = DeviationsTable::default();
    let period = 0.005;
    let (prepared, recordings) = stands(&scenario);
    let log = &recordings[0].log;
    let steepest = log
        .windows(2)
        .map(|pair| (pair[1].commanded[0] - pair[0].commanded[0]).abs() / period)
        .fold(0.0, f64::max);
    assert!(steepest <= limit * (1.0 + 1e-6), "{steepest} N m/s");
    assert!(
        steepest > 0.9 * limit,
        "the bound was needed: {steepest} N m/s"
    );
    let error = rms_mm(&prepared, &recordings[0], 6.0, 10.0);
    assert!(error < 20.0, "{error} mm");
}

/// What is commanded is at a bound only where the plan is: the estimated torque is taken off the
/// bound, not cut off the answer.
#[test]
fn the_plan_knows_what_a_disturbance_leaves_of_the_torque() {
    let mut scenario = example("push-and-move");
    world(&mut scenario).actuator.bias_nm = 0.3;
    scenario.bounds.torque_nm = [-0.6, 0.6];
    let (prepared, recordings) = stands(&scenario);
    let bounds = prepared.settings.u;
    let mut at_bound = 0;
    for sample in &recordings[0].trajectory.samples {
        assert!(
            bounds.contains(&sample.u, 0.0),
            "{} at {} s",
            sample.u,
            sample.t
        );
        if sample.u == bounds.lower || sample.u == bounds.upper {
            assert!(sample.active_bounds > 0, "cut off at {} s", sample.t);
            at_bound += 1;
        }
    }
    assert!(
        at_bound > 2,
        "the bound mattered in {at_bound} samples only"
    );
}

/// Encoders at 1 kHz, an inertial unit at 200 Hz whose readings are 10 ms late and now and then
/// come again.
#[test]
fn it_follows_a_metre_with_sensors_of_different_rates_late_and_stale() {
    let mut scenario = example("push-and-move");
    let world = world(&mut scenario);
    world.sensor_period_s = Some(0.001);
    let sensors = &mut world.sensors;
    sensors.theta.period_s = Some(0.005);
    sensors.theta_dot.period_s = Some(0.005);
    (sensors.theta.delay_s, sensors.theta_dot.delay_s) = (0.01, 0.01);
    (sensors.theta.stale, sensors.theta_dot.stale) = (0.05, 0.05);
    // Older than the delay: seen before.
    let estimator = scenario.controller.estimator.as_mut().expect("it has one");
    estimator.oldest_s = 0.0105;
    let (prepared, recordings) = stands(&scenario);
    let error = rms_mm(&prepared, &recordings[0], 6.0, 10.0);
    assert!(error < 20.0, "{error} mm");
    let log = &recordings[0].log;
    let delivered = |sensor: usize| {
        let rows = log.iter().filter(|row| row.readings[sensor].is_some());
        rows.count() as f64 / log.len() as f64
    };
    // 1 % of the samples are missing; stale readings come at any time.
    assert!((delivered(0) - 0.99).abs() < 0.01, "{}", delivered(0));
    assert!((delivered(1) - 0.25).abs() < 0.03, "{}", delivered(1));
}

/// Without readings there is no plan, and the torque is zero until there are; the run ended there.
#[test]
fn a_world_goes_on_until_there_are_readings() {
    let mut scenario = example("push-and-move");
    let sensors = &mut world(&mut scenario).sensors;
    (sensors.phi.delay_s, sensors.theta.delay_s) = (0.005, 0.005);
    sensors.theta_dot.delay_s = 0.005;
    let (prepared, recordings) = stands(&scenario);
    let first = &recordings[0].trajectory.samples[0];
    assert_eq!((first.status, first.u[0]), (Status::NotFinite, 0.0));
    let error = rms_mm(&prepared, &recordings[0], 6.0, 10.0);
    assert!(error < 20.0, "{error} mm");

    // Without a torque the robot stands for so long, where it begins upright.
    scenario.duration_s = 1.0;
    let sensors = &mut world(&mut scenario).sensors;
    for dropout in [
        &mut sensors.phi.dropout,
        &mut sensors.theta.dropout,
        &mut sensors.theta_dot.dropout,
    ] {
        *dropout = 1.0;
    }
    let (_, recordings) = stands(&scenario);
    let samples = &recordings[0].trajectory.samples;
    assert!(samples.iter().all(|sample| sample.u[0] == 0.0));
}

#[test]
fn set_points_become_moves_within_tilt_and_speed() {
    let (prepared, recordings) = stands(&example("offset-free"));
    let reference = &prepared.planes[0].reference;
    let table = example("offset-free")
        .controller
        .shaping
        .expect("it has one");
    let h = 1e-3;
    let (mut fastest, mut hardest) = (0.0_f64, 0.0_f64);
    for i in 1..20_000 {
        let t = f64::from(i) * h;
        let [before, now, after] = [t - h, t, t + h].map(|t| reference.at(t));
        fastest = fastest.max((after - before).abs() / (2.0 * h));
        hardest = hardest.max((after - 2.0 * now + before).abs() / (h * h));
    }
    let allowed = prepared.ballbot.acceleration_at_tilt(table.tilt_rad).abs();
    assert!(fastest <= table.phi_dot_rad_s * 1.001 && hardest <= allowed * 1.01);
    assert!(fastest > 0.99 * table.phi_dot_rad_s || hardest > 0.99 * allowed);
    assert!((reference.at(20.0) - 4.0).abs() < 1e-12);
    drop(recordings);
}
