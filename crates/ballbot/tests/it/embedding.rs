//! The LPV embedding: equal to f everywhere, and the paper's Table of elements.

use crate::robots;
use ballbot::Ballbot;
use fastrand::Rng;
use lpvmpc::{AlongMotion, Dynamics, LpvModel, Number, RampedInput};
use nalgebra::{Matrix4, SMatrix, SVector, Vector1, Vector3, Vector4};
use std::f64::consts::{FRAC_PI_3, PI, TAU};

fn assert_embeds(robot: &Ballbot<f64>, x: &Vector4<f64>, torque: f64) {
    let (a, b) = robot.matrices(&robot.scheduling(x, &Vector1::zeros()));
    let found = a * x + b * torque;
    let expected = robot.f(x, torque);
    let scale = a.abs() * x.abs() + b.abs() * torque.abs();
    for i in 0..4 {
        assert!(
            (found[i] - expected[i]).abs() <= 1e-12 * scale[i],
            "{robot:?} at {x}, {torque} N m: {found} for {expected}"
        );
    }
    assert_eq!(robot.derivative(x, &Vector1::new(torque)), expected);
}

#[test]
fn the_embedding_is_exact() {
    let mut rng = Rng::with_seed(4);
    for _ in 0..100_000 {
        let (x, torque) = (robots::state(&mut rng), robots::torque(&mut rng));
        assert_embeds(&Ballbot::paper(), &x, torque);
        assert_embeds(&robots::rigid(&mut rng), &x, torque);
    }
}

/// The model's own way to multiply with its A gives what A gives.
fn assert_multiplies<const NX: usize>(model: &impl LpvModel<f64, NX, 1, 3>, rng: &mut Rng) {
    let x = SVector::from_fn(|_, _| 10.0 * rng.f64() - 5.0);
    let (a, _) = model.matrices(&model.scheduling(&x, &Vector1::zeros()));
    let v = SMatrix::<f64, NX, 3>::from_fn(|_, _| 2.0 * rng.f64() - 1.0);
    let (found, expected) = (model.a_times(&a, &v), a * v);
    let scale = a.abs() * v.abs();
    for (i, found) in found.iter().enumerate() {
        assert!(
            (found - expected[i]).abs() <= 1e-14 * scale[i],
            "at {x}: entry {i} is {found}, not {}",
            expected[i]
        );
    }
}

#[test]
fn products_with_the_matrices_leave_out_nothing() {
    let mut rng = Rng::with_seed(5);
    for _ in 0..1000 {
        let mut robot = robots::rigid(&mut rng);
        (robot.drive.viscous, robot.drive.coulomb) = (rng.f64(), rng.f64());
        assert_multiplies(&robot, &mut rng);
        assert_multiplies::<5>(&RampedInput::<_, 4>(robot), &mut rng);
    }
}

/// Against central differences of the equations of motion, whose error is 1e-9 here.
fn assert_differentiates<const NX: usize>(model: &impl LpvModel<f64, NX, 1, 3>, rng: &mut Rng) {
    let x = SVector::<f64, NX>::from_fn(|_, _| 2.0 * rng.f64() - 1.0);
    let u = Vector1::new(2.0 * rng.f64() - 1.0);
    let step = 1e-5;
    let (a, b) = model.jacobian(&x, &u);
    let slope = |dx: SVector<f64, NX>, du: Vector1<f64>| {
        (model.derivative(&(x + dx), &(u + du)) - model.derivative(&(x - dx), &(u - du)))
            / (2.0 * step)
    };
    let close = |found: &SVector<f64, NX>, expected: &SVector<f64, NX>| {
        let error = (found - expected).amax();
        assert!(
            error <= 1e-5 * (1.0 + expected.amax()),
            "{found}, not {expected}"
        );
    };
    for j in 0..NX {
        let mut dx = SVector::<f64, NX>::zeros();
        dx[j] = step;
        let column = slope(dx, Vector1::zeros());
        close(&a.column(j).into_owned(), &column);
    }
    close(&b, &slope(SVector::zeros(), Vector1::new(step)));
}

#[test]
fn the_jacobian_is_that_of_the_equations_of_motion() {
    let mut rng = Rng::with_seed(6);
    for _ in 0..300 {
        let mut robot = robots::rigid(&mut rng);
        // Of Coulomb friction it has the secant.
        robot.drive.coulomb = 0.0;
        assert_differentiates(&robot, &mut rng);
        assert_differentiates::<5>(&RampedInput::<_, 4>(robot), &mut rng);
    }
    assert_differentiates(&Ballbot::<f64>::paper(), &mut rng);
}

#[test]
fn the_tangent_is_the_derivative_with_the_jacobian() {
    let mut rng = Rng::with_seed(8);
    for _ in 0..300 {
        let mut robot = robots::rigid(&mut rng);
        (robot.drive.viscous, robot.drive.coulomb) = (rng.f64(), rng.f64());
        let x = Vector4::from_fn(|_, _| 2.0 * rng.f64() - 1.0);
        let u = Vector1::new(2.0 * rng.f64() - 1.0);
        let (f, a, b) = robot.tangent(&x, &u);
        let expected = robot.derivative(&x, &u);
        assert!((f - expected).amax() <= 1e-13 * (1.0 + expected.amax()));
        assert_eq!((a, b), robot.jacobian(&x, &u));
    }
}

#[test]
fn the_embedding_is_exact_at_the_smallest_tilts() {
    // sin(theta)/theta where theta is zero of either sign, denormal, or so small that its sine
    // is itself.
    for theta in [0.0, 5e-324, 1e-310, 1e-200, 1e-20, 1e-9, 1e-8, 1e-4, PI] {
        for theta in [theta, -theta] {
            let x = Vector4::new(0.0, theta, 3.0, -2.0);
            assert_embeds(&Ballbot::paper(), &x, 0.3);
        }
    }
}

#[test]
fn sinc_is_one_upright_and_zero_upside_down() {
    let robot = Ballbot::<f64>::paper();
    let element = |theta: f64| robot.matrices(&Vector3::new(theta, 0.0, 0.0)).0[(3, 1)];
    // A42 = b1 l g sinc(theta) / d; with sin(pi x)/(pi x) it would vanish at 1 rad.
    assert!(element(1.0).abs() > 1.0);
    assert!((element(PI) / element(0.0)).abs() < 1e-15);
    for tiny in [-0.0, 5e-324, 1e-160, -1e-9] {
        let ratio = element(tiny) / element(0.0);
        assert!((ratio - 1.0).abs() <= 1e-15, "sinc({tiny:e}) = {ratio}");
    }
}

/// The paper's table, written out again with its own symbols; B31 with the bracket closed
/// before the division.
#[rustfmt::skip]
fn table_of_elements(robot: &Ballbot<f64>, theta: f64, theta_dot: f64) -> (Matrix4<f64>, Vector4<f64>) {
    let Ballbot { b1, b2, b3, b4, geometry, .. } = *robot;
    let (l, r_b) = (geometry.centre_of_mass, geometry.ball_radius);
    let (r_w, g) = (geometry.wheel_radius, geometry.gravity);
    let (sin, cos) = (theta.sin(), theta.cos());
    let sinc = sin / theta;
    let d = b1 * b3 - (-b2 + l * r_b * cos).powi(2);
    let a = Matrix4::new(
        0.0, 0.0, 1.0, 0.0,
        0.0, 0.0, 0.0, 1.0,
        0.0, l * g * sinc * (b2 - l * r_b * cos) / d, -b3 * b4 / d, b3 * l * r_b * sin * theta_dot / d,
        0.0, b1 * l * g * sinc / d, -b4 * (b2 - l * r_b * cos) / d, l * r_b * sin * theta_dot * (b2 - l * r_b * cos) / d,
    );
    let b31 = r_b * (b3 - (b2 - l * r_b * cos)) / (r_w * d);
    let b41 = r_b * ((b2 - l * r_b * cos) - b1) / (r_w * d);
    (a, Vector4::new(0.0, 0.0, b31, b41))
}

#[test]
fn the_elements_are_those_of_the_papers_table() {
    let robot = Ballbot::paper();
    for theta in [-FRAC_PI_3, -0.5, 1e-3, 0.2, FRAC_PI_3] {
        for theta_dot in [-TAU, 0.0, 1.3] {
            let (a, b) = robot.matrices(&Vector3::new(theta, theta_dot, 0.0));
            let (a_table, b_table) = table_of_elements(&robot, theta, theta_dot);
            for (found, expected) in a.iter().chain(&b).zip(a_table.iter().chain(&b_table)) {
                assert!(
                    (found - expected).abs() <= 1e-14 * expected.abs(),
                    "{found} for {expected} at {theta}, {theta_dot}"
                );
            }
        }
    }
}

#[test]
fn a_positive_torque_lowers_the_tilt_over_the_whole_range() {
    // B41 < 0, as the prose of scenario 1 needs; the Table of p prints p6 positive.
    for step in -100..=100 {
        let theta = FRAC_PI_3 * f64::from(step) / 100.0;
        let (_, b) = Ballbot::<f64>::paper().matrices(&Vector3::new(theta, 0.0, 0.0));
        assert!(b[3] < 0.0, "B41 = {} at {theta}", b[3]);
    }
}

/// The closed form of the derivatives, and A(s) x + B(s) u, are those of f itself.
#[test]
fn the_tangent_is_what_dual_numbers_give() {
    struct ByDual(Ballbot<f64>);
    impl Dynamics<4, 1> for ByDual {
        fn f<N: Number>(&self, x: &Vector4<N>, u: &Vector1<N>) -> Vector4<N> {
            lpvmpc::Embedding::f(&self.0, x, u)
        }
    }
    let mut rng = Rng::with_seed(9);
    for _ in 0..1000 {
        let mut robot = robots::rigid(&mut rng);
        // Of Coulomb friction the tangent has the secant.
        robot.drive.viscous = rng.f64();
        robot.drive.coulomb = 0.0;
        let (x, u) = (
            robots::state(&mut rng),
            Vector1::new(robots::torque(&mut rng)),
        );
        let (_, a, b) = LpvModel::<f64, 4, 1, 3>::tangent(&robot, &x, &u);
        let (f, by_dual_a, by_dual_b) = AlongMotion::<_, 5>(ByDual(robot)).tangent(&x, &u);
        assert_eq!(f, robot.f(&x, u[0]));
        assert!(
            (a - by_dual_a).amax() <= 1e-12 * (1.0 + a.amax()),
            "{a}{by_dual_a}"
        );
        assert!(
            (b - by_dual_b).amax() <= 1e-12 * (1.0 + b.amax()),
            "{b}{by_dual_b}"
        );
    }
}
