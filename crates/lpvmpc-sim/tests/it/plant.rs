//! The continuous plant between two samples.

use ballbot::{Ballbot, DriveFriction, Geometry};
use lpvmpc::LpvModel;
use lpvmpc_design::zero_order_hold;
use lpvmpc_sim::{PlantError, Tolerances, advance};
use nalgebra::{DMatrix, Matrix1, Matrix4, Vector1, Vector3, Vector4};

fn tolerances(both: f64) -> Tolerances {
    Tolerances {
        relative: both,
        absolute: both,
    }
}

/// A rigid robot of 10 kg on a ball of 2.5 kg, without friction.
fn frictionless() -> Ballbot<f64> {
    let geometry = Geometry::<f64>::paper();
    let b2 = 0.01;
    let robot = Ballbot {
        b1: b2 + (0.4 * 2.5 + 12.5) * geometry.ball_radius.powi(2) / 10.0,
        b2,
        b3: b2 + geometry.centre_of_mass.powi(2) + 0.05,
        b4: 0.0,
        drive: DriveFriction::none(),
        geometry,
    };
    assert!(robot.consistency(std::f64::consts::PI).is_physical());
    robot
}

#[test]
fn energy_is_conserved_without_friction_and_torque() {
    let robot = frictionless();
    // Falls from 0.1 rad, and swings about the lower equilibrium for 20 s.
    let start = Vector4::new(0.0, 0.1, 0.0, 0.0);
    let scale = robot.geometry.gravity * robot.geometry.centre_of_mass;
    for tolerance in [1e-6, 1e-9, 1e-12] {
        let mut x = start;
        let mut lowest = x[1];
        for _ in 0..400 {
            x = advance(&robot, &x, &Vector1::zeros(), 0.05, tolerances(tolerance)).unwrap();
            lowest = x[1].max(lowest);
            let drift = (robot.energy(&x) - robot.energy(&start)).abs() / scale;
            // At most about a thousand steps with a local error below the tolerance each.
            assert!(drift < 1e3 * tolerance, "{drift:e} at {tolerance:e}");
        }
        assert!(lowest > std::f64::consts::PI, "it has swung through");
    }
}

/// The ballbot with its scheduling held: a linear plant.
struct Frozen(Vector3<f64>);

impl LpvModel<f64, 4, 1, 3> for Frozen {
    fn scheduling(&self, _: &Vector4<f64>, _: &Vector1<f64>) -> Vector3<f64> {
        self.0
    }

    fn matrices(&self, scheduling: &Vector3<f64>) -> (Matrix4<f64>, Vector4<f64>) {
        Ballbot::<f64>::paper().matrices(scheduling)
    }
}

#[test]
fn a_linear_plant_is_sampled_exactly() {
    let (x, u) = (Vector4::new(0.3, -0.2, 4.0, 1.0), Vector1::new(0.7));
    for scheduling in [Vector3::zeros(), Vector3::new(0.8, -4.0, 1.0)] {
        let plant = Frozen(scheduling);
        let (a, b) = plant.matrices(&scheduling);
        let a = DMatrix::from_column_slice(4, 4, a.as_slice());
        let b = DMatrix::from_column_slice(4, 1, b.as_slice());
        for t_s in [0.001, 0.05, 0.2] {
            let (a_d, b_d) = zero_order_hold(&a, &b, t_s).unwrap();
            let expected = a_d * x + b_d * u;
            let found = advance(&plant, &x, &u, t_s, tolerances(1e-12)).unwrap();
            for (found, expected) in found.iter().zip(&expected) {
                assert!(
                    (found - expected).abs() <= 1e-9 * expected.abs(),
                    "{found} for {expected} after {t_s} s"
                );
            }
        }
    }
}

#[test]
fn two_samples_are_one_of_twice_the_length() {
    let robot = Ballbot::<f64>::paper();
    let (x, u) = (Vector4::new(0.0, 0.2, -1.0, 0.5), Vector1::new(0.4));
    let step =
        |x: &Vector4<f64>, duration| advance(&robot, x, &u, duration, tolerances(1e-12)).unwrap();
    let (twice, once) = (step(&step(&x, 0.05), 0.05), step(&x, 0.1));
    assert!((twice - once).norm() < 1e-10, "{twice}{once}");
    // The input is held: with another one in the second half the end is another.
    let other = advance(&robot, &step(&x, 0.05), &-u, 0.05, tolerances(1e-12)).unwrap();
    assert!((other - once).norm() > 0.1);
}

#[test]
fn the_form_of_the_plant_does_not_matter() {
    /// The ballbot by A(sigma(x)) x + B(sigma(x)) u instead of f(x, u).
    struct Embedded(Ballbot<f64>);

    impl LpvModel<f64, 4, 1, 3> for Embedded {
        fn scheduling(&self, x: &Vector4<f64>, u: &Vector1<f64>) -> Vector3<f64> {
            self.0.scheduling(x, u)
        }

        fn matrices(&self, scheduling: &Vector3<f64>) -> (Matrix4<f64>, Vector4<f64>) {
            self.0.matrices(scheduling)
        }
    }

    let robot = Ballbot::<f64>::paper();
    let (x, u) = (Vector4::new(0.0, 0.5, 10.0, -3.0), Vector1::new(-0.9));
    let direct = advance(&robot, &x, &u, 0.05, tolerances(1e-12)).unwrap();
    let embedded = advance(&Embedded(robot), &x, &u, 0.05, tolerances(1e-12)).unwrap();
    assert!((direct - embedded).norm() < 1e-11, "{direct}{embedded}");
}

#[test]
fn no_time_no_motion() {
    let x = Vector4::new(0.1, 0.2, 0.3, 0.4);
    let u = Vector1::new(1.0);
    let after = advance(&Ballbot::<f64>::paper(), &x, &u, 0.0, tolerances(1e-9));
    assert_eq!(after, Ok(x));
    // Times at which a step is below the resolution of the state.
    for duration in [1e-300, 1e-30, 1e-15] {
        let after = advance(&Ballbot::<f64>::paper(), &x, &u, duration, tolerances(1e-9)).unwrap();
        assert!((after - x).norm() < 1e-11, "{duration:e}: {after}");
    }
}

#[test]
fn bad_tolerances_are_refused() {
    let x = Vector4::zeros();
    for (relative, absolute) in [
        (0.0, 1e-9),
        (9e-15, 1e-9),
        (1.1, 1e-9),
        (-1e-9, 1e-9),
        (f64::NAN, 1e-9),
        (1e-9, 0.0),
        (1e-9, -1e-9),
        (1e-9, f64::NAN),
        (1e-9, f64::INFINITY),
    ] {
        let bad = Tolerances { relative, absolute };
        let error =
            advance(&Ballbot::<f64>::paper(), &x, &Vector1::zeros(), 0.05, bad).unwrap_err();
        assert!(matches!(error, PlantError::Tolerances { .. }), "{error}");
        let words = error.to_string();
        for part in [
            &format!("{relative:e}"),
            &format!("{absolute:e}"),
            "1e-14 to 1",
        ] {
            assert!(words.contains(part), "`{part}` is not in: {words}");
        }
    }
}

#[test]
fn numbers_that_are_not_finite_are_refused() {
    let robot = Ballbot::<f64>::paper();
    let good = Vector4::new(0.0, 0.1, 0.0, 0.0);
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for index in 0..4 {
            let mut x = good;
            x[index] = bad;
            let error = advance(&robot, &x, &Vector1::zeros(), 0.05, tolerances(1e-9));
            assert_eq!(error, Err(PlantError::NotFinite), "x[{index}] = {bad}");
        }
        let error = advance(&robot, &good, &Vector1::new(bad), 0.05, tolerances(1e-9));
        assert_eq!(error, Err(PlantError::NotFinite), "u = {bad}");
    }
}

#[test]
fn bad_durations_are_refused() {
    // A negative one was once said to be not finite.
    let (x, u) = (Vector4::zeros(), Vector1::zeros());
    for duration in [-0.05, -1e-300, f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let error =
            advance(&Ballbot::<f64>::paper(), &x, &u, duration, tolerances(1e-9)).unwrap_err();
        assert!(matches!(error, PlantError::Duration { .. }), "{error}");
        let words = error.to_string();
        for part in [&format!("{duration} s"), "not negative"] {
            assert!(words.contains(part), "`{part}` is not in: {words}");
        }
    }
}

/// x_dot = x^2 (1 + u): from x at the time 1/x it has become infinite.
struct Explosion;

impl LpvModel<f64, 1, 1, 1> for Explosion {
    fn scheduling(&self, x: &Vector1<f64>, _: &Vector1<f64>) -> Vector1<f64> {
        *x
    }

    fn matrices(&self, scheduling: &Vector1<f64>) -> (Matrix1<f64>, Matrix1<f64>) {
        (*scheduling, Matrix1::zeros())
    }
}

#[test]
fn an_exploding_plant_is_an_error_with_its_time() {
    for start in [1.0, 10.0, 1e6] {
        let x = Vector1::new(start);
        let error = advance(&Explosion, &x, &Vector1::zeros(), 3.0, tolerances(1e-9));
        let Err(PlantError::Diverged { after, reason }) = &error else {
            panic!("{error:?}");
        };
        assert!((after * start - 1.0).abs() < 1e-6, "{after} s from {start}");
        assert!(!reason.is_empty());
        let words = error.unwrap_err().to_string();
        assert!(words.contains(&format!("{:.6} s", 1.0 / start)), "{words}");
        // Until shortly before, its motion is x/(1 - x t).
        let nearly = advance(
            &Explosion,
            &x,
            &Vector1::zeros(),
            0.9 / start,
            tolerances(1e-12),
        );
        assert!((nearly.unwrap()[0] / (10.0 * start) - 1.0).abs() < 1e-8);
    }
}

/// Moves at 1 m/s until 1 m, where its model ends.
struct Cliff;

impl LpvModel<f64, 1, 1, 1> for Cliff {
    fn scheduling(&self, x: &Vector1<f64>, _: &Vector1<f64>) -> Vector1<f64> {
        *x
    }

    fn matrices(&self, _: &Vector1<f64>) -> (Matrix1<f64>, Matrix1<f64>) {
        (Matrix1::zeros(), Matrix1::new(1.0))
    }

    fn derivative(&self, x: &Vector1<f64>, u: &Vector1<f64>) -> Vector1<f64> {
        if x[0] < 1.0 {
            *u
        } else {
            Vector1::new(f64::NAN)
        }
    }
}

#[test]
fn a_model_that_ends_is_an_error_with_its_time() {
    let error = advance(
        &Cliff,
        &Vector1::zeros(),
        &Vector1::new(1.0),
        2.0,
        tolerances(1e-9),
    );
    let Err(PlantError::Diverged { after, .. }) = error else {
        panic!("{error:?}");
    };
    assert!((after - 1.0).abs() < 1e-6, "{after}");
}

#[test]
fn a_stiff_plant_ends_in_time() {
    /// x_dot = -1e9 (x - u).
    struct Stiff;

    impl LpvModel<f64, 1, 1, 1> for Stiff {
        fn scheduling(&self, x: &Vector1<f64>, _: &Vector1<f64>) -> Vector1<f64> {
            *x
        }

        fn matrices(&self, _: &Vector1<f64>) -> (Matrix1<f64>, Matrix1<f64>) {
            (Matrix1::new(-1e9), Matrix1::new(1e9))
        }
    }

    let started = std::time::Instant::now();
    let x = Vector1::new(0.5);
    let error = advance(&Stiff, &x, &Vector1::new(1.0), 1.0, tolerances(1e-9));
    assert!(
        matches!(error, Err(PlantError::Diverged { .. })),
        "{error:?}"
    );
    assert!(started.elapsed().as_secs() < 10);
}
