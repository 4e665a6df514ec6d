//! The drive's friction: what it is called after, and what it must do.

use crate::{equations, robots};
use ballbot::{CREEP_SPEED, DriveFriction};
use fastrand::Rng;
use nalgebra::{Vector2, Vector4};

const DRIVE: DriveFriction<f64> = DriveFriction {
    viscous: 0.03,
    coulomb: 0.2,
};

#[test]
fn it_is_coulombs_law_but_for_the_jump() {
    for sign in [-1.0, 1.0] {
        for speed in [1.0, 10.0, 100.0] {
            let speed = sign * speed;
            let dry = DRIVE.coefficient(speed) * speed - DRIVE.viscous * speed;
            // 1/sqrt(1 + r^2) is within r^2/2 of 1.
            let rounding = 0.5 * (CREEP_SPEED / speed).powi(2) + 1e-12;
            assert!(
                (dry / (sign * DRIVE.coulomb) - 1.0).abs() <= rounding,
                "{dry}"
            );
        }
    }
    let at_rest = DRIVE.viscous + DRIVE.coulomb / CREEP_SPEED;
    assert!((DRIVE.coefficient(0.0) - at_rest).abs() < 1e-15 * at_rest);
}

#[test]
fn a_torque_below_it_hardly_moves_the_drive_and_one_above_it_does() {
    // A robot that is held upright by a huge inertia of tilt: what is left is the drive.
    let mut robot = robots::rigid(&mut Rng::with_seed(21));
    robot.b3 = 1e9;
    robot.b4 = 0.0;
    robot.drive = DRIVE;
    let gear = robot.geometry.ball_radius / robot.geometry.wheel_radius;
    let speed_after = |torque: f64| {
        let mut x = Vector4::zeros();
        for _ in 0..100_000 {
            x += robot.f(&x, torque) * 1e-4;
        }
        x[2]
    };
    let limit = DRIVE.coulomb / gear;
    assert!(speed_after(0.7 * limit).abs() < CREEP_SPEED);
    assert!(speed_after(2.0 * limit) > 20.0 * CREEP_SPEED);
}

#[test]
fn it_always_takes_energy_away() {
    let mut rng = Rng::with_seed(22);
    for _ in 0..1000 {
        let robot = robots::rigid(&mut rng);
        let x = robots::state(&mut rng);
        let rates = Vector2::new(x[2], x[3]);
        assert!(rates.dot(&equations::friction(&robot, x[2], x[3])) >= 0.0);
    }
}
