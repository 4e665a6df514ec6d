//! Sensors, actuators, delay and pushes, on a plant whose motion can be written down.

use lpvmpc_sim::{
    Actuator, Disturbance, Plant, Sensor, Tolerances, World, WorldError, WorldSettings,
};
use nalgebra::{Vector1, Vector2};

/// A mass of 2 kg on a rail: x = (position m, speed m/s), u and load are forces in N.
struct Sledge;

const MASS: f64 = 2.0;

impl Plant<2, 1, 1> for Sledge {
    fn derivative(&self, x: &Vector2<f64>, u: &Vector1<f64>, load: &Vector1<f64>) -> Vector2<f64> {
        Vector2::new(x[1], (u[0] + load[0]) / MASS)
    }
}

type SledgeWorld = World<Sledge, 2, 1, 2, 1>;
type Settings = WorldSettings<2, 1, 2, 1>;

const PERIOD: f64 = 0.01;

fn ideal() -> Settings {
    let tolerances = Tolerances {
        relative: 1e-12,
        absolute: 1e-12,
    };
    WorldSettings::ideal(PERIOD, tolerances)
}

fn at_rest(settings: Settings) -> SledgeWorld {
    World::new(Sledge, Vector2::zeros(), settings).unwrap()
}

fn forward(world: &mut SledgeWorld, samples: usize) {
    for _ in 0..samples {
        world.advance().unwrap();
    }
}

fn assert_near(found: f64, expected: f64) {
    assert!((found - expected).abs() < 1e-9, "{found} for {expected}");
}

#[test]
fn an_ideal_world_measures_the_state_and_obeys_at_once() {
    let mut world = at_rest(ideal());
    world.command(Vector1::new(4.0));
    forward(&mut world, 50);
    // a = 2 m/s^2 for 0.5 s.
    assert_near(world.state()[0], 0.25);
    assert_near(world.state()[1], 1.0);
    assert_near(world.applied()[0], 4.0);
    let measurement = world.measurement();
    assert_eq!(measurement.t, world.time());
    assert_eq!(
        measurement.readings.map(|reading| Some(reading?.value)),
        [world.state()[0], world.state()[1]].map(Some)
    );
}

#[test]
fn a_command_arrives_after_the_delay_even_between_samples() {
    for delay in [0.0, 0.004, 0.02, 0.0237] {
        let mut world = at_rest(Settings { delay, ..ideal() });
        let mut impulse = 0.0;
        // Two commands, the second while the first may still be on its way.
        world.command(Vector1::new(4.0));
        for k in 0..50 {
            if k == 1 {
                world.command(Vector1::new(-2.0));
            }
            forward(&mut world, 1);
            impulse += world.applied()[0] * PERIOD;
        }
        let expected = 4.0 * PERIOD - 2.0 * (0.5 - PERIOD - delay);
        assert_near(world.state()[1] * MASS, expected);
        // What the log says was applied is what has moved the mass.
        assert_near(impulse, expected);
    }
}

#[test]
fn a_lag_costs_its_time_constant() {
    let lag = 0.03;
    let mut settings = ideal();
    settings.actuators[0].lag = lag;
    let mut world = at_rest(settings);
    world.command(Vector1::new(1.0));
    let mut impulse = 0.0;
    for _ in 0..60 {
        forward(&mut world, 1);
        impulse += world.applied()[0] * PERIOD;
    }
    let t = 0.6_f64;
    let expected = t - lag * (1.0 - (-t / lag).exp());
    assert_near(world.state()[1] * MASS, expected);
    assert_near(impulse, expected);
}

#[test]
fn actuators_saturate_and_have_a_dead_zone() {
    let mut settings = ideal();
    settings.actuators[0] = Actuator {
        limit: 3.0,
        dead_zone: 0.5,
        ..Actuator::default()
    };
    for (command, force) in [
        (0.0, 0.0),
        (0.5, 0.0),
        (-0.4, 0.0),
        (2.0, 1.5),
        (-2.0, -1.5),
        (10.0, 2.5),
        (-10.0, -2.5),
    ] {
        let mut world = at_rest(settings.clone());
        world.command(Vector1::new(command));
        forward(&mut world, 10);
        assert_near(world.state()[1] * MASS, force * 0.1);
        assert_eq!(world.commanded()[0], command);
    }
}

#[test]
fn pushes_act_at_their_times() {
    let push = Vector1::new(6.0);
    let mut settings = ideal();
    settings.disturbances = vec![
        Disturbance::Load {
            from: 0.1034,
            until: 0.2041,
            load: push,
        },
        Disturbance::Impulse {
            time: 0.305,
            impulse: Vector1::new(-0.2),
        },
        Disturbance::Jump {
            time: 0.4,
            change: Vector2::new(1.0, 0.5),
        },
    ];
    let mut world = at_rest(settings);
    let speed_at = [(10, 0.0), (30, 3.0 * 0.1007), (40, 3.0 * 0.1007 - 0.1)];
    let mut done = 0;
    for (sample, speed) in speed_at {
        forward(&mut world, sample - done);
        done = sample;
        assert_near(world.state()[1], speed);
    }
    let before = *world.state();
    forward(&mut world, 1);
    let after = before[1] + 0.5;
    assert_near(world.state()[1], after);
    assert_near(world.state()[0], before[0] + 1.0 + after * PERIOD);
    // One that is given while the world moves on, for a time that has passed: at once.
    let late = Disturbance::Impulse {
        time: 0.0,
        impulse: Vector1::new(2.0),
    };
    world.disturb(late).unwrap();
    forward(&mut world, 1);
    assert_near(world.state()[1], after + 1.0);
}

fn readings(settings: &Settings, samples: usize) -> Vec<[Option<f64>; 2]> {
    let mut world = World::new(Sledge, Vector2::new(0.3, 0.0), settings.clone()).unwrap();
    (0..samples)
        .map(|_| {
            forward(&mut world, 1);
            world
                .measurement()
                .readings
                .map(|reading| Some(reading?.value))
        })
        .collect()
}

#[test]
fn noise_has_the_mean_and_the_deviation_that_were_asked_for() {
    let mut settings = ideal();
    settings.sensors[0].noise = 0.02;
    settings.sensors[0].bias = -0.1;
    let count = 20_000;
    let values = readings(&settings, count);
    let errors: Vec<f64> = values.iter().map(|v| v[0].unwrap() - 0.3).collect();
    let mean = errors.iter().sum::<f64>() / count as f64;
    let variance = errors.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / count as f64;
    let autocovariance = errors.windows(2).map(|w| (w[0] - mean) * (w[1] - mean));
    let correlation = autocovariance.sum::<f64>() / count as f64 / variance;
    // Five standard errors of each estimate.
    let n = (count as f64).sqrt();
    assert!((mean + 0.1).abs() < 5.0 * 0.02 / n, "mean {mean}");
    assert!(
        (variance.sqrt() - 0.02).abs() < 5.0 * 0.02 / n,
        "deviation {}",
        variance.sqrt()
    );
    assert!(correlation.abs() < 5.0 / n, "correlation {correlation}");
}

#[test]
fn the_same_seed_gives_the_same_noise_and_sensors_do_not_disturb_each_other() {
    let mut settings = ideal();
    settings.sensors[0].noise = 0.02;
    settings.sensors[1].noise = 0.05;
    let first = readings(&settings, 100);
    assert_eq!(first, readings(&settings, 100));
    let other_seed = Settings {
        seed: 1,
        ..settings.clone()
    };
    assert_ne!(first, readings(&other_seed, 100));

    settings.sensors[1].noise = 0.0;
    settings.sensors[0].dropout = 0.3;
    let second = readings(&settings, 100);
    for (with, without) in second.iter().zip(&first) {
        assert!(with[0].is_none() || with[0] == without[0]);
    }
}

#[test]
fn readings_are_missing_rounded_and_rare_as_asked_for() {
    let mut settings = ideal();
    settings.sensors[0].dropout = 0.25;
    settings.sensors[0].noise = 0.1;
    settings.sensors[0].resolution = 0.025;
    settings.sensors[1].every = 4;
    let count = 10_000;
    let values = readings(&settings, count);
    let missing = values.iter().filter(|v| v[0].is_none()).count() as f64 / count as f64;
    // Five standard errors of a fraction of 1/4.
    assert!(
        (missing - 0.25).abs() < 5.0 * (0.1875 / count as f64).sqrt(),
        "{missing}"
    );
    for value in values.iter().filter_map(|v| v[0]) {
        let steps = value / 0.025;
        assert!((steps - steps.round()).abs() < 1e-9, "{value}");
    }
    for (i, value) in values.iter().enumerate() {
        assert_eq!(value[1].is_some(), (i + 1) % 4 == 0, "sample {}", i + 1);
    }
}

#[test]
fn a_late_sensor_delivers_what_it_measured_before() {
    let mut settings = ideal();
    settings.sensors[0].noise = 0.1;
    settings.sensors[0].every = 2;
    let in_time = readings(&settings, 100);
    settings.sensors[0].late = 3;
    let mut world = World::new(Sledge, Vector2::new(0.3, 0.0), settings.clone()).unwrap();
    for (k, _) in in_time.iter().enumerate() {
        forward(&mut world, 1);
        // readings() begins with sample 1, after one step.
        let before = k.checked_sub(3).and_then(|k| in_time[k][0]);
        if k > 2 {
            assert_eq!(
                world.measurement().readings[0].map(|reading| reading.value),
                before,
                "sample {}",
                k + 1
            );
        }
        if before.is_some() {
            assert_near(
                world.measurement().readings[0].unwrap().age,
                3.0 * settings.period,
            );
        }
        assert_eq!(world.measurement().readings[1].unwrap().age, 0.0);
    }
}

#[test]
fn a_stale_reading_is_the_last_one_with_its_own_time() {
    let mut settings = ideal();
    settings.sensors[0].noise = 0.1;
    let fresh = readings(&settings, 10_000);
    settings.sensors[0].stale = 0.2;
    let mut world = World::new(Sledge, Vector2::new(0.3, 0.0), settings.clone()).unwrap();
    let (mut again, mut oldest) = (0, 0.0_f64);
    for k in 0..fresh.len() {
        forward(&mut world, 1);
        let age = world.measurement().readings[0].unwrap().age;
        let samples = (age / settings.period).round() as usize;
        assert_near(age, samples as f64 * settings.period);
        again += usize::from(samples > 0);
        oldest = oldest.max(age);
        if samples <= k {
            assert_eq!(
                world.measurement().readings[0].map(|reading| reading.value),
                fresh[k - samples][0]
            );
        }
    }
    let part = again as f64 / fresh.len() as f64;
    // Five standard errors of a fraction of 1/5.
    assert!((part - 0.2).abs() < 5.0 * (0.16_f64 / 1e4).sqrt(), "{part}");
    assert!(oldest > 3.0 * settings.period, "they can follow each other");
}

#[test]
fn settings_that_make_no_sense_are_named() {
    let refused = |change: &dyn Fn(&mut Settings)| {
        let mut settings = ideal();
        change(&mut settings);
        let world = World::new(Sledge, Vector2::zeros(), settings);
        world.err().map(|error| error.to_string()).unwrap()
    };
    for (message, change) in [
        (
            "period is 0",
            &(|s: &mut Settings| s.period = 0.0) as &dyn Fn(&mut Settings),
        ),
        ("delay is -0.1", &|s| s.delay = -0.1),
        ("sensor 1: the noise is NaN", &|s| {
            s.sensors[1].noise = f64::NAN
        }),
        ("sensor 0: the dropout is 1.5", &|s| {
            s.sensors[0].dropout = 1.5
        }),
        ("sensor 0: the every is 0", &|s| s.sensors[0].every = 0),
        ("actuator 0: the limit is -1", &|s| {
            s.actuators[0].limit = -1.0
        }),
        ("actuator 0: the lag is inf", &|s| {
            s.actuators[0].lag = f64::INFINITY
        }),
        ("tolerances are relative 0", &|s| {
            s.tolerances.relative = 0.0
        }),
        ("disturbance 0", &|s| {
            s.disturbances = vec![Disturbance::Load {
                from: 2.0,
                until: 1.0,
                load: Vector1::zeros(),
            }];
        }),
    ] {
        let found = refused(change);
        assert!(
            found.contains(message),
            "`{found}` does not say `{message}`"
        );
    }
    let not_a_number = Disturbance::Impulse {
        time: 0.0,
        impulse: Vector1::new(f64::NAN),
    };
    let error = at_rest(ideal()).disturb(not_a_number).unwrap_err();
    assert_eq!(error, WorldError::Disturbance(0));
}

#[test]
fn a_world_that_cannot_move_on_stays_where_it_is() {
    let mut world = at_rest(ideal());
    world.command(Vector1::new(1.0));
    forward(&mut world, 3);
    let (time, state) = (world.time(), *world.state());
    world.command(Vector1::new(f64::NAN));
    assert!(world.advance().is_err());
    assert_eq!((world.time(), *world.state()), (time, state));
}

#[test]
fn what_a_failed_advance_met_is_still_to_come() {
    let mut world = at_rest(ideal());
    for push in [
        Disturbance::Jump {
            time: 0.0,
            change: Vector2::new(0.0, 1.0),
        },
        Disturbance::Impulse {
            time: 0.25 * PERIOD,
            impulse: Vector1::new(4.0),
        },
    ] {
        world.disturb(push).unwrap();
    }
    world.command(Vector1::new(f64::NAN));
    world.advance().unwrap_err();
    world.command(Vector1::zeros());
    world.advance().unwrap();
    // 1 m/s at once, and 4 N s / 2 kg after a quarter of the period.
    assert_near(world.state()[1], 3.0);
    assert_near(world.state()[0], PERIOD * (1.0 + 0.75 * 2.0));
}

#[test]
fn a_sensor_can_measure_a_combination() {
    let mut settings = ideal();
    settings.sensors[0] = Sensor::ideal(Vector2::new(1.0, -0.5));
    let mut world = World::new(Sledge, Vector2::new(0.3, 0.4), settings).unwrap();
    assert_near(world.measurement().readings[0].unwrap().value, 0.1);
    forward(&mut world, 1);
}
