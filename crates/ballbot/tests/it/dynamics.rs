//! f against the equations of motion, and the equations of motion against mechanics.

use crate::{equations, robots};
use ballbot::{Ballbot, Geometry};
use fastrand::Rng;
use nalgebra::{Vector2, Vector4};

/// q_ddot = M^-1 (B~ tau - C - D - G) by elimination with pivoting.
fn accelerations(robot: &Ballbot<f64>, x: &Vector4<f64>, torque: f64) -> Vector2<f64> {
    let force = equations::input(robot) * torque
        - equations::coriolis(robot, x[1], x[3])
        - equations::friction(robot, x[2], x[3])
        - equations::gravity(robot, x[1]);
    let solution = equations::mass(robot, x[1]).lu().solve(&force);
    solution.expect("M is invertible")
}

/// Robots of two kinds: the paper's, whose det M is negative, and rigid ones.
fn assert_f_solves_the_equations_of_motion(robot: &Ballbot<f64>, rng: &mut Rng) {
    let (x, torque) = (robots::state(rng), robots::torque(rng));
    let found = robot.f(&x, torque);
    assert_eq!([found[0], found[1]], [x[2], x[3]], "the rates themselves");
    let expected = accelerations(robot, &x, torque);
    let found = Vector2::new(found[2], found[3]);
    // Forces may cancel: the accuracy is relative to each of them alone.
    let inverse = equations::mass(robot, x[1])
        .try_inverse()
        .expect("M is invertible");
    let forces = (equations::input(robot) * torque).abs()
        + equations::coriolis(robot, x[1], x[3]).abs()
        + equations::friction(robot, x[2], x[3]).abs()
        + equations::gravity(robot, x[1]).abs();
    let scale = inverse.abs() * forces;
    for i in 0..2 {
        assert!(
            (found[i] - expected[i]).abs() <= 1e-12 * scale[i],
            "{robot:?} at {x}, {torque} N m: {found} for {expected}"
        );
    }
}

#[test]
fn f_solves_the_equations_of_motion() {
    let mut rng = Rng::with_seed(1);
    for _ in 0..100_000 {
        assert_f_solves_the_equations_of_motion(&Ballbot::paper(), &mut rng);
    }
    for _ in 0..100_000 {
        let robot = robots::rigid(&mut rng);
        assert_f_solves_the_equations_of_motion(&robot, &mut rng);
    }
}

#[test]
fn energy_changes_by_the_power_of_torque_and_friction_alone() {
    // dE/dt = q_dot' (B~ tau - D) holds only if M, C and G come from one Lagrangian.
    let mut rng = Rng::with_seed(2);
    for _ in 0..10_000 {
        let robot = robots::rigid(&mut rng);
        let (x, torque) = (robots::state(&mut rng), robots::torque(&mut rng));
        let rate = robot.f(&x, torque);
        let h = 1e-3 / rate.norm();
        let at = |step: f64| robot.energy(&(x + rate * step));
        // Five-point stencil: the error is of order h^4.
        let (far, near) = (at(2.0 * h) - at(-2.0 * h), at(h) - at(-h));
        let found = (8.0 * near - far) / (12.0 * h);
        let q_dot = Vector2::new(x[2], x[3]);
        let expected = q_dot
            .dot(&(equations::input(&robot) * torque - equations::friction(&robot, x[2], x[3])));
        // Rounding of the energies, and the stencil's own error.
        let accuracy = 1e-15 * at(0.0).abs() / h + 1e-9 * rate.norm();
        assert!(
            (found - expected).abs() <= 10.0 * accuracy,
            "{found} for {expected} within {accuracy}: {robot:?} at {x}"
        );
    }
}

#[test]
fn signs_of_the_torque() {
    // "Positive virtual torque ... decrease the tilt angle ... move the ballbot to the negative
    // phi", as the paper says of its robot.
    let pushed = Ballbot::paper().f(&Vector4::zeros(), 1.0);
    assert!(pushed[2] < 0.0 && pushed[3] < 0.0, "{pushed}");
    // A rigid robot's ball goes the way it is pushed, its body the other way.
    let mut rng = Rng::with_seed(3);
    for _ in 0..1000 {
        let pushed = robots::rigid(&mut rng).f(&Vector4::zeros(), 1.0);
        assert!(pushed[2] > 0.0 && pushed[3] < 0.0, "{pushed}");
    }
}

#[test]
fn every_ball_angle_is_an_equilibrium() {
    for phi in [-40.0, 0.0, 3.0] {
        let rest = Vector4::new(phi, 0.0, 0.0, 0.0);
        assert_eq!(Ballbot::<f64>::paper().f(&rest, 0.0), Vector4::zeros());
    }
}

#[test]
fn once_around_moves_the_ball_by_its_circumference() {
    let geometry = Geometry::<f64>::paper();
    let turn = std::f64::consts::TAU;
    // The paper's Lissajous curve has the amplitude 0.12 * 2 pi m.
    assert!((geometry.position(turn) - 0.12 * turn).abs() < 1e-15);
    for phi in [-7.0, 0.0, 0.3] {
        let back = geometry.ball_angle(geometry.position(phi));
        assert!((back - phi).abs() <= 1e-15 * phi.abs());
    }
}
