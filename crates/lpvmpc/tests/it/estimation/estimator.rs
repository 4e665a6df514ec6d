//! The estimator against a dense textbook filter, statistics, and what it has to find.

use super::pendulum::{INSTANTS, Observer, PENDULUM, settings};
use crate::pendulum::Pendulum;
use lpvmpc::{Estimator, EstimatorError, EstimatorSettings, Gate, LpvModel, Reading, Rk4, Verdict};
use lpvmpc_testkit::rng::Rng;
use nalgebra::{Matrix1x2, Matrix2, Matrix3, SMatrix, SVector, Vector1, Vector2, Vector3};

/// The pendulum with its scheduling held: a linear plant.
#[derive(Clone, Copy)]
pub struct Linear;

impl LpvModel<f64, 2, 1, 1> for Linear {
    fn scheduling(&self, _: &Vector2<f64>, _: &Vector1<f64>) -> Vector1<f64> {
        Vector1::new(1.0)
    }

    fn matrices(&self, sinc: &Vector1<f64>) -> (Matrix2<f64>, Vector2<f64>) {
        PENDULUM.matrices(sinc)
    }
}

const T_S: f64 = 0.01;

/// The disturbance is partly a torque and partly an offset of the angle.
fn mixed() -> EstimatorSettings<f64, 2, 1, 1, 1> {
    EstimatorSettings {
        state_offset: Vector2::new(0.1, 0.0),
        input_offset: Vector1::new(0.7),
        state_noise: Vector2::new(1e-3, 1e-2),
        gate: Gate {
            deviations: f64::INFINITY,
            ..settings().gate
        },
        ..settings()
    }
}

#[test]
fn it_is_the_textbook_filter_of_the_joint_system() {
    let settings = mixed();
    let mut rng = Rng::new(1);
    let mut estimator =
        Observer::allocate(Linear, settings, Vector2::new(0.05, 0.0), INSTANTS).unwrap();
    // The joint system in (x, d), written out: x_dot = A (x + E_x d) + B (u + E_u d), sampled by
    // its own Taylor series, y = x_1.
    let (a, b) = Linear.matrices(&Vector1::new(1.0));
    let (coupling, b_d) = (a * settings.state_offset, b * settings.input_offset);
    let mut joint = Matrix3::zeros();
    joint.fixed_view_mut::<2, 2>(0, 0).copy_from(&a);
    joint
        .fixed_view_mut::<2, 1>(0, 2)
        .copy_from(&(coupling + b_d));
    let b = Vector3::new(b[0], b[1], 0.0);
    let (mut f, mut g, mut term) = (Matrix3::identity(), Matrix3::zeros(), Matrix3::identity());
    for i in 1..15 {
        g += term * (T_S / f64::from(i));
        term = term * joint * (T_S / f64::from(i));
        f += term;
    }
    let g = g * b;
    let c = Vector3::new(1.0, 0.0, 0.0);
    let mut x = Vector3::new(0.05, 0.0, 0.0);
    let mut p = Matrix3::from_diagonal(&Vector3::new(1e-2, 1e-1, 0.25));
    let q = Matrix3::from_diagonal(&Vector3::new(1e-3, 1e-2, 1e-4)) * T_S;
    // z = x + E_x d.
    let to_z = Matrix3::new(1.0, 0.0, 0.1, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
    for k in 0..300 {
        let (u, y) = (rng.uniform(-1.0, 1.0), rng.uniform(-0.1, 0.1));
        estimator.advance(&Vector1::new(u), T_S);
        estimator.update(&[Some(Reading::fresh(y))]);

        x = f * x + g * u;
        p = f * p * f.transpose() + q;
        let gain = p * c / (c.dot(&(p * c)) + 1e-6);
        x += gain * (y - c.dot(&x));
        p -= gain * (c.transpose() * p);

        let found = Vector3::new(
            estimator.state()[0],
            estimator.state()[1],
            estimator.disturbance()[0],
        );
        // RK4 leaves (h lambda)^5/120 = 2.5e-10 per sample, and the loop forgets.
        let size = 1.0 + x.norm();
        assert!(
            (found - x).norm() < 1e-6 * size,
            "sample {k}: {found} for {x}"
        );
        let covariance = estimator.covariance();
        let expected = to_z * p * to_z.transpose();
        let relative = (covariance.zz - expected.fixed_view::<2, 2>(0, 0)).norm() / expected.norm();
        assert!(relative < 1e-6, "sample {k}: {}", covariance.zz);
    }
}

#[test]
fn its_errors_have_the_covariance_that_it_states() {
    // Normalised squared errors of 400 runs: chi-square with 3 x 400 degrees of freedom.
    let mut rng = Rng::new(2);
    let (runs, mut total) = (400, 0.0);
    for _ in 0..runs {
        let settings = settings();
        let mut truth = Vector2::new(0.1 * rng.normal(), 0.1_f64.sqrt() * rng.normal());
        let mut d = 0.5 * rng.normal();
        let mut estimator =
            Observer::allocate(Linear, settings, Vector2::zeros(), INSTANTS).unwrap();
        for _ in 0..100 {
            // Anything that keeps the motion small.
            let u = Vector1::new(-20.0 * estimator.state()[0] - 8.0 * estimator.state()[1]);
            truth = Rk4 { substeps: 1 }.advance(&Linear, &truth, &u.add_scalar(d), T_S);
            truth[1] += (1e-4 * T_S).sqrt() * rng.normal();
            d += (1e-4 * T_S).sqrt() * rng.normal();
            estimator.advance(&u, T_S);
            estimator.update(&[Some(Reading::fresh(truth[0] + 1e-3 * rng.normal()))]);
        }
        let covariance = estimator.covariance();
        let mut joint = Matrix3::zeros();
        joint.fixed_view_mut::<2, 2>(0, 0).copy_from(&covariance.zz);
        joint.fixed_view_mut::<2, 1>(0, 2).copy_from(&covariance.zd);
        joint
            .fixed_view_mut::<1, 2>(2, 0)
            .copy_from(&covariance.zd.transpose());
        joint.fixed_view_mut::<1, 1>(2, 2).copy_from(&covariance.dd);
        let error = Vector3::new(
            truth[0] - estimator.state()[0],
            truth[1] - estimator.state()[1],
            d - estimator.disturbance()[0],
        );
        total += error.dot(&(joint.try_inverse().unwrap() * error));
    }
    let mean = total / f64::from(runs);
    // Five standard deviations of the mean: sqrt(2 * 3 / 400) each.
    assert!(
        (mean - 3.0).abs() < 5.0 * (6.0 / f64::from(runs)).sqrt(),
        "{mean}"
    );
}

/// Keeps the nonlinear pendulum upright for 20 s by the estimate alone, under an unknown torque
/// and with a sensor that is off; returns the estimator and z at the end.
fn held_upright(
    settings: EstimatorSettings<f64, 2, 1, 1, 1>,
    torque: f64,
    offset: f64,
) -> (Observer<Pendulum<f64>>, Vector2<f64>) {
    let mut estimator = Observer::allocate(PENDULUM, settings, Vector2::zeros(), INSTANTS).unwrap();
    let mut z = Vector2::new(0.1, 0.0);
    for _ in 0..2000 {
        let model = estimator.model_state();
        let v = Vector1::new(-30.0 * model[0] - 8.0 * model[1]);
        let u = v - estimator.input_disturbance();
        z = Rk4 { substeps: 1 }.advance(&PENDULUM, &z, &u.add_scalar(torque), T_S);
        estimator.advance(&u, T_S);
        estimator.update(&[Some(Reading::fresh(z[0] - offset))]);
    }
    (estimator, z)
}

#[test]
fn an_unknown_torque_is_found_and_leaves_no_error() {
    let (estimator, z) = held_upright(settings(), 0.4, 0.0);
    assert!((estimator.disturbance()[0] - 0.4).abs() < 1e-6);
    assert!(z.norm() < 1e-6 && estimator.state().norm() < 1e-6, "{z}");
}

#[test]
fn a_sensor_that_is_off_is_found_and_leaves_no_error() {
    let settings = EstimatorSettings {
        state_offset: Vector2::new(1.0, 0.0),
        input_offset: Vector1::zeros(),
        ..settings()
    };
    let (estimator, z) = held_upright(settings, 0.0, -0.05);
    assert!((estimator.disturbance()[0] + 0.05).abs() < 1e-6);
    assert!(z.norm() < 1e-6, "{z}");
    // The sensor's own coordinates.
    assert!((estimator.state()[0] - 0.05).abs() < 1e-6);
}

#[test]
fn without_a_disturbance_in_the_filter_the_torque_leaves_an_error() {
    let settings = EstimatorSettings {
        input_offset: Vector1::zeros(),
        ..settings()
    };
    let (_, z) = held_upright(settings, 0.4, 0.0);
    // Statics: 9.81 sin(z) + torque = 30 estimated angle; the test shows that it can fail.
    assert!(z[0].abs() > 0.01, "{z}");
}

#[test]
fn the_covariance_stays_positive_in_single_precision() {
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
    let settings = EstimatorSettings::<f32, 2, 1, 1, 1> {
        longest_step: 0.01,
        c: Matrix1x2::new(1.0, 0.0),
        state_offset: SMatrix::zeros(),
        input_offset: Vector1::new(1.0),
        state_noise: Vector2::new(0.0, 1e-3),
        disturbance_noise: Vector1::new(1e-6),
        // Ten orders of magnitude below the start.
        measurement_noise: Vector1::new(1e-8),
        initial_state: Vector2::new(1e2, 1e2),
        initial_disturbance: Vector1::new(1e2),
        gate: Gate {
            deviations: f32::INFINITY,
            patience: 0,
            oldest: 0.0,
            longest_gap: f32::INFINITY,
        },
    };
    let mut estimator = Estimator::allocate(Single, settings, Vector2::zeros(), 1).unwrap();
    for k in 0..200_000 {
        estimator.advance(&Vector1::zeros(), 0.001);
        estimator.update(&[Some(Reading::fresh(0.0))]);
        let covariance = estimator.covariance();
        let least = covariance.zz.symmetric_eigenvalues().min();
        let size = covariance.zz.norm();
        assert!(
            least > -1e-6 * size && covariance.dd[0] > 0.0,
            "sample {k}: {least} of {size}"
        );
    }
}

#[test]
fn without_readings_it_predicts_and_grows_less_certain() {
    let mut estimator =
        Observer::allocate(PENDULUM, settings(), Vector2::new(0.1, 0.0), INSTANTS).unwrap();
    let mut alone = Vector2::new(0.1, 0.0);
    let mut last = 0.0;
    for _ in 0..20 {
        estimator.advance(&Vector1::new(-1.0), T_S);
        assert_eq!(estimator.update(&[None]), [Verdict::Missing]);
        alone = Rk4 { substeps: 1 }.advance(&PENDULUM, &alone, &Vector1::new(-1.0), T_S);
        assert_eq!(estimator.state(), alone);
        let trace = estimator.covariance().zz.trace();
        assert!(trace > last);
        last = trace;
    }
    estimator.reset(Vector2::new(0.1, 0.0));
    let fresh = Observer::allocate(PENDULUM, settings(), Vector2::new(0.1, 0.0), INSTANTS).unwrap();
    assert_eq!(estimator.covariance(), fresh.covariance());
    assert_eq!(estimator.state(), fresh.state());
}

#[test]
fn settings_that_make_no_sense_are_named() {
    let refused = |change: &dyn Fn(&mut EstimatorSettings<f64, 2, 1, 1, 1>)| {
        let mut settings = settings();
        change(&mut settings);
        Observer::allocate(PENDULUM, settings, Vector2::zeros(), INSTANTS)
            .err()
            .unwrap()
    };
    assert_eq!(
        refused(&|s| s.longest_step = 0.0),
        EstimatorError::LongestStep
    );
    assert_eq!(refused(&|s| s.c[0] = f64::NAN), EstimatorError::Matrix("C"));
    assert_eq!(refused(&|s| s.gate.deviations = 0.0), EstimatorError::Gate);
    for (error, quantity) in [
        (refused(&|s| s.state_noise[1] = -1.0), "the state's noise 1"),
        (
            refused(&|s| s.measurement_noise[0] = 0.0),
            "the measurement 0",
        ),
        (
            refused(&|s| s.initial_state[0] = f64::NAN),
            "the initial state 0",
        ),
    ] {
        let message = error.to_string();
        assert!(message.contains(quantity), "{message}");
    }
}

/// Without anything that the model does not know, it is all one whether a reading is taken in
/// when it is taken, or when it arrives with its age.
#[test]
fn a_late_reading_corrects_the_state_as_it_was() {
    let settings = EstimatorSettings {
        state_noise: Vector2::zeros(),
        disturbance_noise: Vector1::zeros(),
        ..mixed()
    };
    let start = Vector2::new(0.1, -0.2);
    let mut in_time = Observer::allocate(Linear, settings, start, INSTANTS).unwrap();
    let mut late = Observer::allocate(Linear, settings, start, INSTANTS).unwrap();
    let u = Vector1::new(0.6);
    for (i, age) in [0.01, 0.03, 0.05, 0.02].into_iter().enumerate() {
        let value = 0.05 + 0.01 * i as f64;
        in_time.update(&[Some(Reading::fresh(value))]);
        in_time.advance(&u, age);
        late.advance(&u, age);
        assert_eq!(
            late.update(&[Some(Reading { value, age })]),
            [Verdict::Used]
        );
    }
    // Runge-Kutta backward is the inverse of forward to (lambda h)^5.
    let close = |a: f64, b: f64| (a - b).abs() < 1e-7 * a.abs().max(1e-3);
    let pairs = in_time
        .state()
        .iter()
        .zip(&late.state())
        .all(|(a, b)| close(*a, *b));
    assert!(pairs, "{} and {}", in_time.state(), late.state());
    let (a, b) = (in_time.disturbance()[0], late.disturbance()[0]);
    assert!(close(a, b), "{a} and {b}");
    let (a, b) = (in_time.covariance(), late.covariance());
    for (a, b) in a.zz.iter().chain(&a.zd).zip(b.zz.iter().chain(&b.zd)) {
        assert!(close(*a, *b), "{a} and {b}");
    }

    // Taken for a fresh one, it is wrong by the way that the pendulum has gone since.
    let mut deceived = in_time.clone();
    in_time.update(&[Some(Reading::fresh(0.2))]);
    in_time.advance(&u, 0.05);
    deceived.advance(&u, 0.05);
    deceived.update(&[Some(Reading::fresh(0.2))]);
    assert!((in_time.state() - deceived.state()).norm() > 1e-3);
}

/// The covariance follows the model at the input that acts, known or found; it followed it at the commanded one.
#[test]
fn the_covariance_is_that_at_the_input_that_acts() {
    /// A mass whose friction grows with the input.
    struct Sticking;
    impl LpvModel<f64, 2, 1, 1> for Sticking {
        fn scheduling(&self, _: &Vector2<f64>, u: &Vector1<f64>) -> Vector1<f64> {
            *u
        }
        fn matrices(&self, s: &Vector1<f64>) -> (Matrix2<f64>, Vector2<f64>) {
            (
                Matrix2::new(0.0, 1.0, 0.0, -4.0 - s[0]),
                Vector2::new(0.0, 1.0),
            )
        }
    }
    let [told, found] = [2.0, 0.0].map(|commanded| {
        let mut estimator =
            Observer::allocate(Sticking, settings(), Vector2::zeros(), INSTANTS).unwrap();
        let (mut x, acts) = (Vector2::zeros(), Vector1::new(2.0));
        for _ in 0..3000 {
            estimator.update(&[Some(Reading::fresh(x[0]))]);
            estimator.advance(&Vector1::new(commanded), 0.01);
            x = Rk4 { substeps: 1 }.advance(&Sticking, &x, &acts, 0.01);
        }
        let all = commanded + estimator.input_disturbance()[0];
        assert!((all - 2.0).abs() < 1e-3, "{all}");
        estimator.covariance().zz
    });
    assert!((told - found).amax() < 1e-3 * told.amax(), "{told}{found}");
}
