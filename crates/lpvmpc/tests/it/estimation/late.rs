//! Late readings against the optimum: the state given all readings at once.

use super::estimator::Linear;
use super::pendulum::settings;
use lpvmpc::{Estimator, EstimatorSettings, Gate, LpvModel, Reading, Verdict};
use lpvmpc_testkit::rng::Rng;
use nalgebra::{DMatrix, DVector, Matrix2, Matrix3, SMatrix, Vector1, Vector2, Vector3};

const T_S: f64 = 0.005;
const SAMPLES: usize = 60;

/// Angle and rate are measured, an unknown torque acts, and nothing is an outlier.
fn two_sensors() -> EstimatorSettings<f64, 2, 1, 2, 1> {
    let of_one = settings();
    EstimatorSettings {
        longest_step: of_one.longest_step,
        c: Matrix2::identity(),
        state_offset: SMatrix::zeros(),
        input_offset: Vector1::new(1.0),
        state_noise: Vector2::new(0.0, 0.3),
        disturbance_noise: Vector1::new(0.1),
        measurement_noise: Vector2::new(1e-6, 1e-4),
        initial_state: of_one.initial_state,
        initial_disturbance: of_one.initial_disturbance,
        gate: Gate {
            deviations: f64::INFINITY,
            patience: 0,
            oldest: 0.05,
            longest_gap: f64::INFINITY,
        },
    }
}

/// The pendulum with the torque as a third state, sampled exactly.
fn joint() -> (Matrix3<f64>, Vector3<f64>) {
    let (a, b) = Linear.matrices(&Vector1::new(1.0));
    let mut rates = Matrix3::zeros();
    rates.fixed_view_mut::<2, 2>(0, 0).copy_from(&a);
    rates.fixed_view_mut::<2, 1>(0, 2).copy_from(&b);
    let f = (rates * T_S).exp();
    // The input acts as the torque does.
    let g = f * Vector3::z() - Vector3::z();
    (f, g)
}

/// A reading as it was taken, and when it arrives.
struct Taken {
    sensor: usize,
    at: usize,
    arrives: usize,
    value: f64,
}

/// What is known of the last sample's state from all readings that have arrived: mean and
/// covariance of a Gaussian under linear conditions, without any recursion on the state.
fn optimum(taken: &[Taken], inputs: &[f64], now: usize) -> (Vector3<f64>, Matrix3<f64>) {
    let settings = two_sensors();
    let (f, g) = joint();
    let q = Matrix3::from_diagonal(&settings.state_noise.push(settings.disturbance_noise[0])) * T_S;
    let start = settings.initial_state.push(settings.initial_disturbance[0]);
    let mut mean = vec![Vector3::zeros()];
    let mut covariance = vec![Matrix3::from_diagonal(&start)];
    for k in 0..now {
        mean.push(f * mean[k] + g * inputs[k]);
        covariance.push(f * covariance[k] * f.transpose() + q);
    }
    // Each is needed for thousands of pairs.
    let powers: Vec<_> = (0..=now as u32).map(|steps| f.pow(steps)).collect();
    // Of the states at two samples: F^(i - j) P_j.
    let mixed = |i: usize, j: usize| match i >= j {
        true => powers[i - j] * covariance[j],
        false => (powers[j - i] * covariance[i]).transpose(),
    };
    let arrived: Vec<_> = taken.iter().filter(|taken| taken.arrives <= now).collect();
    let count = arrived.len();
    let of_readings = DMatrix::from_fn(count, count, |i, j| {
        let (a, b) = (arrived[i], arrived[j]);
        let noise = if i == j {
            settings.measurement_noise[a.sensor]
        } else {
            0.0
        };
        mixed(a.at, b.at)[(a.sensor, b.sensor)] + noise
    });
    let errors = DVector::from_fn(count, |i, _| {
        arrived[i].value - mean[arrived[i].at][arrived[i].sensor]
    });
    let with_now = DMatrix::from_fn(3, count, |i, j| {
        mixed(now, arrived[j].at)[(i, arrived[j].sensor)]
    });
    let inverse = of_readings.cholesky().unwrap();
    let moved = &with_now * inverse.solve(&errors);
    let gained = &with_now * inverse.solve(&with_now.transpose());
    (
        mean[now] + Vector3::from_iterator(moved.iter().copied()),
        covariance[now] - Matrix3::from_iterator(gained.iter().copied()),
    )
}

#[test]
fn whatever_the_ages_the_estimate_is_that_from_all_readings_at_once() {
    let (f, g) = joint();
    let settings = two_sensors();
    let mut rng = Rng::new(3);
    for run in 0..20 {
        let mut x = Vector3::new(0.1 * rng.normal(), 0.3 * rng.normal(), 0.5 * rng.normal());
        let mut estimator =
            Estimator::<_, f64, 2, 1, 1, 2, 1>::allocate(Linear, settings, Vector2::zeros(), 16)
                .unwrap();
        let (mut taken, mut inputs) = (Vec::<Taken>::new(), Vec::new());
        for now in 0..SAMPLES {
            for sensor in 0..2 {
                // Every third reading is missing; the others are up to eight samples late.
                let late = match run % 4 {
                    0 => 4,
                    1 => 8 * sensor,
                    _ => rng.index(9),
                };
                let value = x[sensor] + settings.measurement_noise[sensor].sqrt() * rng.normal();
                if rng.index(3) > 0 {
                    let arrives = now + late;
                    taken.push(Taken {
                        sensor,
                        at: now,
                        arrives,
                        value,
                    });
                }
            }
            // One update with a reading of each sensor, and one for each that came with them.
            for reading in taken.iter().filter(|taken| taken.arrives == now) {
                let mut readings = [None; 2];
                let age = (now - reading.at) as f64 * T_S;
                readings[reading.sensor] = Some(Reading {
                    value: reading.value,
                    age,
                });
                let verdict = estimator.update(&readings)[reading.sensor];
                assert_eq!(verdict, Verdict::Used);
            }
            let (mean, covariance) = optimum(&taken, &inputs, now);
            let found = estimator.state().push(estimator.disturbance()[0]);
            // In units of what is not known; RK4 leaves 1e-10 per sample.
            let spread = covariance.diagonal().map(f64::sqrt);
            let off = (found - mean).component_div(&spread).amax();
            assert!(off < 1e-5, "run {run}, sample {now}: {off} deviations");
            let diagonal = estimator
                .covariance()
                .zz
                .diagonal()
                .push(estimator.covariance().dd[0]);
            for (found, expected) in diagonal.iter().zip(covariance.diagonal().iter()) {
                assert!(
                    (found / expected - 1.0).abs() < 1e-5,
                    "{found} for {expected}"
                );
            }
            let u = rng.uniform(-1.0, 1.0);
            inputs.push(u);
            estimator.advance(&Vector1::new(u), T_S);
            x = f * x + g * u;
            x[1] += (0.3 * T_S).sqrt() * rng.normal();
            x[2] += (0.1 * T_S).sqrt() * rng.normal();
        }
    }
}

/// Between two samples, too, and in any order.
#[test]
fn readings_from_between_two_samples_find_their_place() {
    let settings = two_sensors();
    let new = || {
        Estimator::<_, f64, 2, 1, 1, 2, 1>::allocate(Linear, settings, Vector2::zeros(), 32)
            .unwrap()
    };
    let (mut in_time, mut late) = (new(), new());
    let u = Vector1::new(0.7);
    let times = [0.002, 0.005, 0.009, 0.0125, 0.02];
    let mut now = 0.0;
    for (i, time) in times.into_iter().enumerate() {
        // The same stretches in both, since the noise of a stretch counts at its end.
        for end in [0.01_f64.clamp(now, time), time] {
            if end > now {
                in_time.advance(&u, end - now);
                now = end;
            }
        }
        let fresh = |j: usize| Some(Reading::fresh(0.01 * (i + j) as f64));
        in_time.update(&[fresh(0), fresh(1)]);
    }
    late.advance(&u, 0.01);
    late.advance(&u, 0.01);
    for i in [3, 0, 4, 1, 2] {
        let age = now - times[i];
        let reading = |j: usize| {
            Some(Reading {
                value: 0.01 * (i + j) as f64,
                age,
            })
        };
        assert_eq!(late.update(&[reading(0), reading(1)]), [Verdict::Used; 2]);
    }
    let error = (in_time.state() - late.state()).norm();
    assert!(error < 1e-9, "{error}");
}

#[test]
fn what_is_older_than_the_memory_is_stale_and_what_comes_twice_is_said() {
    let mut estimator =
        Estimator::<_, f64, 2, 1, 1, 2, 1>::allocate(Linear, two_sensors(), Vector2::zeros(), 4)
            .unwrap();
    for _ in 0..10 {
        estimator.advance(&Vector1::zeros(), T_S);
    }
    let aged = |samples: f64| {
        [
            Some(Reading {
                value: 0.01,
                age: samples * T_S,
            }),
            None,
        ]
    };
    assert_eq!(estimator.update(&aged(4.0))[0], Verdict::Stale);
    assert_eq!(estimator.update(&aged(3.0))[0], Verdict::Used);
    let (state, covariance) = (estimator.state(), *estimator.covariance());
    assert_eq!(estimator.update(&aged(3.0))[0], Verdict::Repeated);
    assert_eq!(
        (state, covariance),
        (estimator.state(), *estimator.covariance())
    );
    // Full, with the oldest instant needed: there is no room between the two oldest.
    assert_eq!(estimator.update(&aged(2.5))[0], Verdict::Stale);
    assert_eq!(estimator.update(&aged(1.5))[0], Verdict::Used);
}

/// With memory for few instants the estimate is that of much memory and the readings that were not called stale: what
/// was used has been used. Readings from many instants were called so and forgotten.
#[test]
fn what_little_memory_uses_is_used() {
    let mut rng = Rng::new(5);
    let new = |memory| {
        Estimator::<_, f64, 2, 1, 1, 2, 1>::allocate(
            Linear,
            two_sensors(),
            Vector2::zeros(),
            memory,
        )
        .unwrap()
    };
    for memory in 3..7 {
        let (mut little, mut much) = (new(memory), new(64));
        let [mut used, mut stale] = [0; 2];
        for k in 0..300 {
            let readings = [(); 2].map(|()| {
                Some(Reading {
                    value: 0.01 * (0.1 * f64::from(k)).sin() + 0.001 * rng.normal(),
                    age: rng.uniform(0.0, 0.03),
                })
            });
            let verdicts = little.update(&readings);
            let fits = |i: usize| readings[i].filter(|_| verdicts[i] != Verdict::Stale);
            much.update(&[fits(0), fits(1)]);
            used += verdicts.iter().filter(|verdict| verdict.is_used()).count();
            stale += verdicts
                .iter()
                .filter(|verdict| **verdict == Verdict::Stale)
                .count();
            let error = (little.state() - much.state()).norm();
            assert!(
                error < 1e-9,
                "{memory} instants, update {k}: {error}, {verdicts:?}"
            );
            let u = Vector1::new((0.2 * f64::from(k)).cos());
            little.advance(&u, 0.01);
            much.advance(&u, 0.01);
        }
        assert!(
            used > 50 && stale > 50,
            "{memory}: {used} used, {stale} stale"
        );
    }
}
