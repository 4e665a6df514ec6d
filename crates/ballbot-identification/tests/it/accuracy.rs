//! Parameters found from logs of a known robot.

use crate::laboratory::{Laboratory, healthy};
use ballbot_identification::log::BallAngle;
use ballbot_identification::{Choice, Estimate, Parameter, Split, Tables, Task, Values, noise};
use lpvmpc_design::ShootingTermination;
use rayon::prelude::*;

/// What the robot of a laboratory is.
pub fn truth(laboratory: &Laboratory) -> Values {
    let mut truth = Values([0.0; Parameter::ALL.len()]);
    for (parameter, value) in [
        (Parameter::B1, laboratory.plant.b1),
        (Parameter::B2, laboratory.plant.b2),
        (Parameter::B3, laboratory.plant.b3),
        (Parameter::RollingFriction, laboratory.plant.b4),
        (Parameter::DriveFriction, laboratory.drive_friction),
        (Parameter::DriveCoulomb, laboratory.coulomb),
        (Parameter::TorqueGain, laboratory.torque_gain),
        (Parameter::Delay, laboratory.delay),
        (Parameter::TiltOffset, laboratory.tilt_offset),
        (Parameter::GyroBias, laboratory.gyro_bias),
    ] {
        truth[parameter] = value;
    }
    truth
}

fn estimate_with(laboratory: &Laboratory, seed: u64, choices: Values<Choice>) -> Estimate {
    let runs = [laboratory.record(seed).run];
    let task = Task {
        runs: &runs,
        ball_angle: laboratory.ball_angle,
        geometry: laboratory.plant.geometry,
        choices,
        physical: true,
        segment: 1.0,
        torque_known: true,
        noise: [None; 3],
        tables: Tables::default(),
    };
    let split = Split::new(&runs, 0.0);
    let floor = noise::floor(&runs);
    task.estimate(&split.fitted, floor, &|_| {}).unwrap()
}

fn estimate(laboratory: &Laboratory, seed: u64) -> Estimate {
    estimate_with(laboratory, seed, Values::usual())
}

/// Relative error of b1, b2 and b3, the largest.
fn inertia_error(laboratory: &Laboratory, estimate: &Estimate) -> f64 {
    let truth = truth(laboratory);
    [Parameter::B1, Parameter::B2, Parameter::B3]
        .into_iter()
        .map(|parameter| (estimate.values[parameter] / truth[parameter] - 1.0).abs())
        .fold(0.0, f64::max)
}

/// A robot whose log has everything at once.
fn real() -> Laboratory {
    Laboratory {
        delay: 0.01,
        tilt_offset: 0.01,
        gyro_bias: 0.02,
        ..healthy()
    }
}

#[test]
fn inertias_delay_and_offset_are_found_at_one_and_two_newton_metres() {
    for (amplitude, percent) in [(1.0, 5.0), (2.0, 3.0)] {
        let laboratory = Laboratory {
            amplitude,
            ..real()
        };
        for seed in 1..=3 {
            let estimate = estimate(&laboratory, seed);
            let error = 100.0 * inertia_error(&laboratory, &estimate);
            assert!(error < percent, "{amplitude} N m, seed {seed}: {error} %");
            let delay = estimate.values[Parameter::Delay];
            assert!((delay - 0.01).abs() < 1e-3, "delay {delay} s");
            let offset = estimate.values[Parameter::TiltOffset];
            assert!((offset - 0.01).abs() < 1e-3, "offset {offset} rad");
        }
    }
}

#[test]
fn delays_are_found_to_a_millisecond() {
    for delay in [0.0, 0.003, 0.02, 0.04] {
        let laboratory = Laboratory { delay, ..real() };
        let found = estimate(&laboratory, 2).values[Parameter::Delay];
        assert!((found - delay).abs() < 1e-3, "{found} s for {delay} s");
    }
}

#[test]
fn a_delay_of_whole_rows_is_a_minimum_though_chi_square_has_a_kink_there() {
    let laboratory = Laboratory {
        rate: 100.0,
        duration: 8.0,
        delay: 0.02,
        ..real()
    };
    let truth = truth(&laboratory);
    // Logs on whose kinks a search for a gradient that vanishes stagnates.
    let seeds = [13_u64, 23, 38, 56];
    let estimates: Vec<Estimate> = seeds
        .par_iter()
        .map(|seed| estimate(&laboratory, *seed))
        .collect();
    for (seed, estimate) in seeds.iter().zip(estimates) {
        let termination = estimate.fit.termination;
        assert_eq!(termination, ShootingTermination::Converged, "seed {seed}");
        let deviation = |parameter: Parameter| {
            let index = parameter.index();
            estimate.covariance[(index, index)].sqrt()
        };
        // The minimum is the kink itself.
        let error = (estimate.values[Parameter::Delay] - 0.02).abs();
        assert!(error < 0.01 * deviation(Parameter::Delay), "seed {seed}");
        for parameter in [Parameter::B1, Parameter::B2, Parameter::B3] {
            let error = (estimate.values[parameter] - truth[parameter]).abs();
            assert!(error < 3.5 * deviation(parameter), "{parameter}: {error}");
        }
    }
}

#[test]
fn coulomb_friction_is_found() {
    let laboratory = Laboratory {
        coulomb: 0.02,
        amplitude: 2.0,
        ..real()
    };
    let mut choices = Values::usual();
    choices[Parameter::DriveCoulomb] = Choice::FREE;
    let estimate = estimate_with(&laboratory, 5, choices);
    let index = Parameter::DriveCoulomb.index();
    let error = (estimate.values[Parameter::DriveCoulomb] - 0.02).abs();
    let deviation = estimate.covariance[(index, index)].sqrt();
    assert!(error < 3.5 * deviation, "{error} at {deviation}");
    assert!(deviation < 0.1 * 0.02, "{deviation}");
}

#[test]
fn an_encoder_on_the_body_is_understood() {
    let laboratory = Laboratory {
        ball_angle: BallAngle::RelativeToBody,
        ..real()
    };
    let estimate = estimate(&laboratory, 4);
    let error = inertia_error(&laboratory, &estimate);
    assert!(error < 0.05, "{error}");
    // Taken for the angle against the floor, the same log is no robot's.
    let mistaken = Laboratory {
        ball_angle: BallAngle::Inertial,
        ..laboratory.clone()
    };
    let runs = [laboratory.record(4).run];
    let task = Task {
        runs: &runs,
        ball_angle: mistaken.ball_angle,
        geometry: mistaken.plant.geometry,
        choices: Values::usual(),
        physical: true,
        segment: 1.0,
        torque_known: true,
        noise: [None; 3],
        tables: Tables::default(),
    };
    let floor = noise::floor(&runs);
    let split = Split::new(&runs, 0.0);
    if let Ok(wrong) = task.estimate(&split.fitted, floor, &|_| {}) {
        let error = inertia_error(&laboratory, &wrong);
        assert!(error > 0.05, "{error}");
    }
}

#[test]
fn intervals_cover_the_truth_in_ninety_to_ninety_nine_percent_of_two_hundred_trials() {
    const TRIALS: u64 = 200;
    let laboratory = Laboratory {
        rate: 100.0,
        duration: 10.0,
        ..real()
    };
    let truth = truth(&laboratory);
    let estimates: Vec<Estimate> = (0..TRIALS)
        .into_par_iter()
        .map(|seed| estimate(&laboratory, 1000 + seed))
        .collect();
    for parameter in Parameter::ALL {
        let index = parameter.index();
        if !Values::usual()[parameter].is_free() {
            continue;
        }
        let covered = estimates.iter().filter(|estimate| {
            let deviation = estimate.covariance[(index, index)].sqrt();
            let error = (estimate.values[parameter] - truth[parameter]).abs();
            error <= lpvmpc_design::NORMAL_95 * deviation
        });
        let part = covered.count() as f64 / TRIALS as f64;
        assert!((0.90..=0.99).contains(&part), "{parameter}: {part}");
    }
}
