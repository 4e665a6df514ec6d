//! The terms of the equations of motion as the paper prints them (eqs. (1) and (2)), written here once
//! more, to compare with.

use ballbot::{Ballbot, CREEP_SPEED};
use nalgebra::{Matrix2, Vector2};

/// M(q), m^2.
pub fn mass(robot: &Ballbot<f64>, theta: f64) -> Matrix2<f64> {
    let coupling = robot.geometry.centre_of_mass * robot.geometry.ball_radius * theta.cos();
    let off_diagonal = -robot.b2 + coupling;
    Matrix2::new(robot.b1, off_diagonal, off_diagonal, robot.b3)
}

/// C(q, q_dot), m^2/s^2.
pub fn coriolis(robot: &Ballbot<f64>, theta: f64, theta_dot: f64) -> Vector2<f64> {
    let arm = robot.geometry.centre_of_mass * robot.geometry.ball_radius;
    Vector2::new(-arm * theta.sin() * theta_dot * theta_dot, 0.0)
}

/// D(q_dot), m^2/s^2, with the friction of the drive, which the paper does not have.
pub fn friction(robot: &Ballbot<f64>, phi_dot: f64, theta_dot: f64) -> Vector2<f64> {
    let slip = phi_dot - theta_dot;
    let drive = robot.drive.viscous * slip + robot.drive.coulomb * slip / slip.hypot(CREEP_SPEED);
    Vector2::new(robot.b4 * phi_dot + drive, -drive)
}

/// G(q), m^2/s^2.
pub fn gravity(robot: &Ballbot<f64>, theta: f64) -> Vector2<f64> {
    let pull = robot.geometry.centre_of_mass * robot.geometry.gravity;
    Vector2::new(0.0, -pull * theta.sin())
}

/// B~.
pub fn input(robot: &Ballbot<f64>) -> Vector2<f64> {
    let gear = robot.geometry.ball_radius / robot.geometry.wheel_radius;
    Vector2::new(gear, -gear)
}
