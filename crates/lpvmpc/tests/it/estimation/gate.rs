//! Readings that must not be believed.

use super::pendulum::{INSTANTS, Observer, PENDULUM, settings};
use crate::pendulum::Pendulum;
use lpvmpc::{EstimatorSettings, Gate, LpvModel, Reading, Rk4, Verdict};
use nalgebra::{Matrix1x2, Matrix2, Vector1, Vector2};

const T_S: f64 = 0.01;

/// An estimator that has settled at the upright pendulum, and the held-up pendulum itself.
fn settled() -> Observer<Pendulum<f64>> {
    settled_with(settings().gate)
}

fn settled_with(gate: Gate<f64>) -> Observer<Pendulum<f64>> {
    let settings = EstimatorSettings { gate, ..settings() };
    let mut estimator = Observer::allocate(PENDULUM, settings, Vector2::zeros(), INSTANTS).unwrap();
    for _ in 0..500 {
        estimator.advance(&Vector1::zeros(), T_S);
        estimator.update(&[Some(Reading::fresh(0.0))]);
    }
    // An instant without a reading.
    estimator.advance(&Vector1::zeros(), T_S);
    estimator
}

#[test]
fn an_outlier_is_seen_and_changes_nothing() {
    let mut estimator = settled();
    let before = (
        estimator.state(),
        *estimator.disturbance(),
        *estimator.covariance(),
    );
    for value in [0.3, -0.3, 1e300] {
        let verdict = estimator.update(&[Some(Reading::fresh(value))]);
        assert_eq!(verdict, [Verdict::Outlier], "{value}");
    }
    let after = (
        estimator.state(),
        *estimator.disturbance(),
        *estimator.covariance(),
    );
    assert_eq!(before, after);
}

/// What leaves nothing of an estimate but rounding is not believed where there is no gate, either: after one reading of 1e200 no
/// plan was finite for seconds. Four in a row are.
#[test]
fn an_absurd_reading_is_an_outlier_without_a_gate() {
    let gate = Gate {
        deviations: f64::INFINITY,
        patience: 0,
        ..settings().gate
    };
    for absurd in [1e20, -1e100, 1e150, 1e300] {
        let mut estimator = settled_with(gate);
        let before = (estimator.state(), *estimator.covariance());
        let verdict = estimator.update(&[Some(Reading::fresh(absurd))]);
        assert_eq!(verdict, [Verdict::Outlier], "{absurd:e}");
        assert_eq!((estimator.state(), *estimator.covariance()), before);
        estimator.advance(&Vector1::zeros(), T_S);
        let verdict = estimator.update(&[Some(Reading::fresh(0.0))]);
        assert_eq!(verdict, [Verdict::Used]);
        assert!(estimator.state().norm() < 1e-3, "{}", estimator.state());
    }
    let mut estimator = settled_with(gate);
    let verdicts = [(); 4].map(|()| {
        estimator.advance(&Vector1::zeros(), T_S);
        estimator.update(&[Some(Reading::fresh(1e20))])[0]
    });
    assert_eq!(verdicts[..3], [Verdict::Outlier; 3]);
    assert_eq!(verdicts[3], Verdict::UsedAfterBlow);
    // Far away is not absurd.
    let mut estimator = settled_with(gate);
    let verdict = estimator.update(&[Some(Reading::fresh(1e6))]);
    assert_eq!(verdict, [Verdict::Used]);
}

#[test]
fn what_is_no_number_and_what_is_old_is_refused_and_said() {
    let mut estimator = settled();
    let before = estimator.state();
    for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let verdict = estimator.update(&[Some(Reading::fresh(value))]);
        assert_eq!(verdict, [Verdict::NotFinite], "{value}");
    }
    for age in [0.0501, f64::NAN, f64::INFINITY] {
        let reading = Reading { value: 0.001, age };
        assert_eq!(
            estimator.update(&[Some(reading)]),
            [Verdict::Stale],
            "{age}"
        );
    }
    assert_eq!(estimator.state(), before);
    let reading = Reading {
        value: 0.001,
        age: 0.045,
    };
    assert_eq!(estimator.update(&[Some(reading)]), [Verdict::Used]);
    assert_ne!(estimator.state(), before);
}

#[test]
fn after_a_blow_the_state_follows_the_sensor() {
    let mut estimator = settled();
    // The angle is elsewhere at once, and the pendulum is caught there.
    let mut truth = Vector2::new(0.3, 0.5);
    let mut verdicts = Vec::new();
    for _ in 0..60 {
        let u = Vector1::new(-40.0 * truth[0] - 12.0 * truth[1]);
        truth = Rk4 { substeps: 1 }.advance(&PENDULUM, &truth, &u, T_S);
        estimator.advance(&u, T_S);
        verdicts.extend(estimator.update(&[Some(Reading::fresh(truth[0]))]));
    }
    assert_eq!(
        verdicts[..3],
        [Verdict::Outlier; 3],
        "at first it does not believe"
    );
    assert_eq!(verdicts[3], Verdict::UsedAfterBlow);
    let error = estimator.state() - truth;
    assert!(error[0].abs() < 0.005 && error[1].abs() < 0.05, "{error}");
}

#[test]
fn one_bad_sample_now_and_then_is_not_a_blow() {
    let mut estimator = settled();
    for k in 0..300 {
        estimator.advance(&Vector1::zeros(), T_S);
        let (value, verdict) = match k % 3 {
            0 => (0.2, Verdict::Outlier),
            _ => (0.0, Verdict::Used),
        };
        assert_eq!(estimator.update(&[Some(Reading::fresh(value))]), [verdict]);
    }
    assert!(estimator.state().norm() < 1e-3);
}

/// The blow opened the states that C shows, which is not read where a sensor is a function of the state.
#[test]
fn a_blow_is_found_by_a_sensor_that_is_a_function() {
    /// The pendulum with its angle as such a sensor.
    struct Seen;
    impl LpvModel<f64, 2, 1, 1> for Seen {
        fn scheduling(&self, x: &Vector2<f64>, u: &Vector1<f64>) -> Vector1<f64> {
            PENDULUM.scheduling(x, u)
        }
        fn matrices(&self, s: &Vector1<f64>) -> (Matrix2<f64>, Vector2<f64>) {
            PENDULUM.matrices(s)
        }
        fn sensor(&self, i: usize, x: &Vector2<f64>) -> Option<(f64, Vector2<f64>)> {
            (i == 0).then(|| (x[0], Vector2::x()))
        }
    }
    let rows = settings();
    let none = EstimatorSettings {
        c: Matrix1x2::zeros(),
        ..rows
    };
    let mut by_row = Observer::allocate(PENDULUM, rows, Vector2::zeros(), INSTANTS).unwrap();
    let mut seen = Observer::allocate(Seen, none, Vector2::zeros(), INSTANTS).unwrap();
    let mut blows = 0;
    for k in 0..200 {
        let angle = if k < 100 { 0.0 } else { 0.3 };
        let reading = [Some(Reading::fresh(angle))];
        let verdict = by_row.update(&reading);
        assert_eq!(seen.update(&reading), verdict, "update {k}");
        assert!((seen.state() - by_row.state()).norm() < 1e-12, "update {k}");
        blows += usize::from(k >= 100 && verdict == [Verdict::UsedAfterBlow]);
        let u = Vector1::new(-9.81 * angle.sin());
        by_row.advance(&u, T_S);
        seen.advance(&u, T_S);
    }
    assert!(blows > 0);
}
