//! Time by stamps: its beginning, gaps, other clocks, in both precisions.

use super::pendulum::{INSTANTS, Observer, PENDULUM, settings};
use crate::pendulum::Pendulum;
use lpvmpc::{
    Clock, DelayLine, Estimator, EstimatorSettings, Gate, LpvModel, Observation, Reading, Restart,
    Rk4, Tick, Verdict,
};
use nalgebra::{Matrix2, SMatrix, SVector, Vector1, Vector2};

const T_S: f64 = 0.01;
const UNIX: f64 = 1.8e9;

/// The held-up pendulum under an unknown torque, observed at stamps from `start` on: the estimator
/// after `samples` measurements, and the line of its inputs.
fn observed(
    start: f64,
    samples: usize,
) -> (Observer<Pendulum<f64>>, DelayLine<f64, 1>, Vector2<f64>) {
    let mut estimator =
        Observer::allocate(PENDULUM, settings(), Vector2::zeros(), INSTANTS).unwrap();
    let mut line = DelayLine::allocate(4);
    let mut x = Vector2::new(0.05, 0.0);
    for k in 0..samples {
        let stamp = start + k as f64 * T_S;
        let seen = estimator.observe(stamp, &mut line, &[Some(Reading::fresh(x[0]))]);
        let restart = (k == 0).then_some(Restart::Start);
        assert_eq!(seen.restart, restart, "sample {k}");
        assert!(seen.verdicts[0].is_used(), "sample {k}: {seen:?}");
        let u = Vector1::new(-30.0 * x[0] - 8.0 * x[1]);
        line.command(u, 0.0);
        x = Rk4 { substeps: 1 }.advance(&PENDULUM, &x, &u.add_scalar(0.2), T_S);
    }
    (estimator, line, x)
}

/// A first stamp of 10 s was integrated as 10 s of free fall: NaN, or an estimate that no reading
/// could reach any more.
#[test]
fn time_begins_with_the_first_measurement() {
    let (from_zero, ..) = observed(0.0, 300);
    for start in [0.01, 10.0, 40.0, 100.0, 1e6, UNIX, -5.0] {
        let (estimator, ..) = observed(start, 300);
        // Stamps are rounded: by 2.4e-7 s at most.
        let error = (estimator.state() - from_zero.state()).norm();
        assert!(error < 1e-5, "{start}: {error}");
        assert!((estimator.disturbance()[0] - 0.2).abs() < 1e-2);
    }
}

/// The state that it is made with counts as much as its variances say, at the beginning and after a gap.
#[test]
fn the_estimate_begins_from_the_state_that_it_was_made_with() {
    let start = Vector2::new(0.3, -1.0);
    let sure = EstimatorSettings {
        initial_state: Vector2::repeat(1e-12),
        ..settings()
    };
    let mut estimator = Observer::allocate(PENDULUM, sure, start, INSTANTS).unwrap();
    let mut line = DelayLine::allocate(4);
    assert!(!estimator.observe(UNIX, &mut line, &[None]).verdicts[0].is_used());
    // Nothing was read: there is no estimate yet, and time does not move it.
    assert!(estimator.is_lost());
    estimator.observe(UNIX + 0.3, &mut line, &[None]);
    assert_eq!(estimator.state(), start);
    for (stamp, cause) in [(UNIX + 0.6, Restart::Start), (UNIX + 9.0, Restart::Gap)] {
        let seen = estimator.observe(stamp, &mut line, &[Some(Reading::fresh(0.301))]);
        assert_eq!(seen.restart, Some(cause));
        assert!(seen.verdicts[0].is_used() && !estimator.is_lost());
        let error = estimator.state() - start;
        assert!(error.norm() < 1e-6, "{cause:?}: {error}");
    }
    // From where it is put, once.
    let other = Vector2::new(0.1, 0.5);
    estimator.begin_at(None, other);
    estimator.observe(5.0, &mut line, &[Some(Reading::fresh(0.1))]);
    assert!((estimator.state() - other).norm() < 1e-6);
}

#[test]
fn after_a_gap_the_estimate_begins_anew_and_says_so() {
    for gap in [0.6, 30.0, 3600.0, 1e6] {
        let (mut estimator, mut line, _) = observed(UNIX, 300);
        let stamp = UNIX + 299.0 * T_S + gap;
        // Nothing to be read yet.
        let nothing = estimator.observe(stamp, &mut line, &[None]);
        assert_eq!(
            nothing,
            Observation {
                verdicts: [Verdict::Missing],
                restart: None
            }
        );
        assert!(estimator.is_lost());
        let no_number = [Some(Reading::fresh(f64::NAN))];
        let seen = estimator.observe(stamp + T_S, &mut line, &no_number);
        assert_eq!(
            seen,
            Observation {
                verdicts: [Verdict::NotFinite],
                restart: None
            }
        );
        assert!(estimator.is_lost());
        let seen = estimator.observe(stamp + 2.0 * T_S, &mut line, &[Some(Reading::fresh(2.5))]);
        assert_eq!(seen.restart, Some(Restart::Gap));
        assert!(seen.verdicts[0].is_used() && !estimator.is_lost());
        assert!(
            (estimator.state()[0] - 2.5).abs() < 1e-6,
            "{}",
            estimator.state()
        );
    }
}

/// As long as the readings are NaN, it is the same as a gap.
#[test]
fn readings_that_are_no_numbers_lead_to_a_restart() {
    let (mut estimator, mut line, x) = observed(5.0, 300);
    let mut restarts = Vec::new();
    for k in 300..400 {
        let value = if k < 380 { f64::NAN } else { x[0] };
        let seen = estimator.observe(
            5.0 + k as f64 * T_S,
            &mut line,
            &[Some(Reading::fresh(value))],
        );
        assert_eq!(seen.verdicts[0] == Verdict::NotFinite, k < 380);
        assert_eq!(estimator.is_lost(), (350..380).contains(&k), "{k}");
        assert!(estimator.state().iter().all(|x| x.is_finite()));
        restarts.extend(seen.restart.map(|cause| (k, cause)));
    }
    assert_eq!(restarts, [(380, Restart::Gap)]);
}

#[test]
fn stamps_out_of_order_are_left_out_and_a_clock_set_back_is_a_new_beginning() {
    let (mut estimator, mut line, x) = observed(100.0, 300);
    let reading = [Some(Reading::fresh(x[0]))];
    let before = estimator.state();
    for stamp in [102.9, f64::NAN, f64::INFINITY] {
        let verdict = if stamp.is_finite() {
            Verdict::Stale
        } else {
            Verdict::NotFinite
        };
        let seen = estimator.observe(stamp, &mut line, &reading);
        assert_eq!(
            seen,
            Observation {
                verdicts: [verdict],
                restart: None
            }
        );
        assert_eq!(estimator.state(), before);
    }
    let seen = estimator.observe(3.0, &mut line, &reading);
    assert_eq!(seen.restart, Some(Restart::ClockSetBack));
    let seen = estimator.observe(3.0 + T_S, &mut line, &reading);
    assert_eq!((seen.restart, seen.verdicts), (None, [Verdict::Used]));
}

#[test]
fn an_input_that_is_no_number_costs_the_estimate_and_not_the_estimator() {
    let (mut estimator, mut line, x) = observed(0.0, 300);
    line.command(Vector1::new(f64::NAN), 0.0);
    let reading = [Some(Reading::fresh(x[0]))];
    let seen = estimator.observe(3.0, &mut line, &reading);
    assert_eq!(seen.restart, Some(Restart::NotFinite));
    assert!((estimator.state()[0] - x[0]).abs() < 1e-3);
}

/// The first reading and the first after a gap were called stale where they were late: the estimate was the state that it
/// was made with, and passed for one.
#[test]
fn an_estimate_begins_with_late_readings_too() {
    let late = 2;
    let mut estimator =
        Observer::allocate(PENDULUM, settings(), Vector2::zeros(), INSTANTS).unwrap();
    let mut line = DelayLine::allocate(4);
    let mut x = Vector2::new(0.2, 0.0);
    let mut past = vec![];
    for k in 0..300 {
        past.push(x[0]);
        let missing = (100..160).contains(&k);
        let taken = past.len().checked_sub(1 + late).filter(|_| !missing);
        let reading = taken.map(|taken| Reading {
            value: past[taken],
            age: late as f64 * T_S,
        });
        let seen = estimator.observe(UNIX + f64::from(k) * T_S, &mut line, &[reading]);
        let restart = match k {
            2 => Some(Restart::Start),
            160 => Some(Restart::Gap),
            _ => None,
        };
        assert_eq!(seen.restart, restart, "sample {k}");
        assert_eq!(seen.verdicts[0].is_used(), reading.is_some(), "sample {k}");
        if !estimator.is_lost() {
            let deviation = estimator.covariance().zz[(0, 0)].sqrt();
            let error = (estimator.state()[0] - x[0]).abs();
            assert!(error < 3.0 * deviation, "sample {k}: {error}, {deviation}");
        }
        let u = Vector1::new(-30.0 * x[0] - 8.0 * x[1]);
        line.command(u, 0.0);
        x = Rk4 { substeps: 1 }.advance(&PENDULUM, &x, &u, T_S);
    }
    // With a memory of the present alone nothing can be taken in, so there is no estimate.
    let mut present = Observer::allocate(PENDULUM, settings(), Vector2::zeros(), 1).unwrap();
    let reading = [Some(Reading {
        value: 0.2,
        age: 0.02,
    })];
    let seen = present.observe(UNIX, &mut DelayLine::allocate(4), &reading);
    assert_eq!((seen.verdicts[0], seen.restart), (Verdict::Stale, None));
    assert!(present.is_lost());
    assert_eq!(present.state(), Vector2::zeros());
}

#[test]
fn a_clock_tells_what_passes_and_refuses_what_does_not() {
    let mut clock = Clock::default();
    assert_eq!(clock.now(), None);
    assert_eq!(clock.tick::<f32>(UNIX), Tick::First);
    assert_eq!(clock.tick::<f32>(UNIX + 0.25), Tick::Elapsed(0.25));
    assert_eq!(clock.tick::<f32>(UNIX + 0.25), Tick::Elapsed(0.0));
    assert_eq!(clock.tick::<f32>(UNIX), Tick::Backward(0.25));
    assert_eq!(clock.tick::<f32>(f64::NAN), Tick::NotFinite);
    assert_eq!(clock.now(), Some(UNIX + 0.25));
}

/// In `f32` two Unix times are equal for a minute and more; their difference is not.
#[test]
fn unix_time_works_in_single_precision() {
    /// The pendulum in `f32`.
    struct Single;
    impl LpvModel<f32, 2, 1, 1> for Single {
        fn scheduling(&self, x: &SVector<f32, 2>, _: &Vector1<f32>) -> SVector<f32, 1> {
            Vector1::new(x[0])
        }
        fn matrices(&self, _: &SVector<f32, 1>) -> (SMatrix<f32, 2, 2>, SMatrix<f32, 2, 1>) {
            (Matrix2::new(0.0, 1.0, 9.81, 0.0), Vector2::new(0.0, 1.0))
        }
    }
    let double = settings();
    let settings = EstimatorSettings::<f32, 2, 1, 1, 1> {
        longest_step: 0.01,
        c: double.c.cast(),
        state_offset: double.state_offset.cast(),
        input_offset: double.input_offset.cast(),
        state_noise: double.state_noise.cast(),
        disturbance_noise: double.disturbance_noise.cast(),
        measurement_noise: double.measurement_noise.cast(),
        initial_state: double.initial_state.cast(),
        initial_disturbance: double.initial_disturbance.cast(),
        gate: Gate {
            deviations: 6.0,
            patience: 3,
            oldest: 0.05,
            longest_gap: 0.5,
        },
    };
    let run = |start: f64| {
        let mut estimator =
            Estimator::<_, f32, 2, 1, 1, 1, 1>::allocate(Single, settings, SVector::zeros(), 8)
                .unwrap();
        let mut line = DelayLine::<f32, 1>::allocate(4);
        let mut x = Vector2::new(0.05_f32, 0.0);
        for k in 0..300 {
            let value = x[0] + 1e-3 * (k as f32).sin();
            estimator.observe(
                start + f64::from(k) * T_S,
                &mut line,
                &[Some(Reading::fresh(value))],
            );
            let u = Vector1::new(-30.0 * x[0] - 8.0 * x[1]);
            line.command(u, 0.0);
            x = Rk4 { substeps: 1 }.advance(&Single, &x, &u.add_scalar(0.2), T_S as f32);
        }
        estimator
    };
    let (zero, unix) = (run(0.0), run(UNIX));
    assert!((zero.state() - unix.state()).norm() < 1e-5);
    assert!(
        (unix.disturbance()[0] - 0.2).abs() < 0.05,
        "{}",
        unix.disturbance()
    );
}
