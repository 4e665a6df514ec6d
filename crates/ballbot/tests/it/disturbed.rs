//! The disturbed plant against the undisturbed one, energy, and statics.

use crate::robots;
use ballbot::{Ballbot, CREEP_SPEED, Disturbed};
use fastrand::Rng;
use nalgebra::{Vector2, Vector4};

/// Kinetic and potential energy per body mass on the slope, written out from the geometry: the
/// ball's centre moves along the floor, the body's centre of mass leans off it.
fn energy(robot: &Disturbed<f64>, x: &Vector4<f64>) -> f64 {
    let Ballbot {
        b1,
        b2,
        b3,
        geometry,
        ..
    } = robot.ballbot;
    let l = geometry.centre_of_mass;
    let lean = x[1] + robot.tilt_offset;
    let (ball, body) = (geometry.ball_radius * x[2], l * x[3]);
    // Velocities of the ball's centre and of the body relative to it, in level coordinates.
    let along = Vector2::new(robot.slope.cos(), robot.slope.sin()) * ball;
    let swing = Vector2::new(lean.cos(), -lean.sin()) * body;
    // b1, b3 hold the squares; b2 couples through the wheels.
    let kinetic =
        (b1 * x[2] * x[2] + b3 * x[3] * x[3]) / 2.0 + along.dot(&swing) - b2 * x[2] * x[3];
    let height = geometry.ball_radius * x[0] * robot.slope.sin();
    kinetic + geometry.gravity * (robot.total_mass * height + l * lean.cos())
}

fn on_a_slope(rng: &mut Rng) -> Disturbed<f64> {
    Disturbed {
        ballbot: robots::rigid(rng),
        slope: robots::uniform(rng, -0.3, 0.3),
        total_mass: robots::uniform(rng, 1.0, 1.5),
        tilt_offset: robots::uniform(rng, -0.1, 0.1),
    }
}

#[test]
fn level_and_unloaded_it_is_the_ballbot() {
    let mut rng = Rng::with_seed(1);
    for _ in 0..200 {
        let ballbot = robots::rigid(&mut rng);
        let (x, torque) = (robots::state(&mut rng), robots::torque(&mut rng));
        let found = Disturbed::level(ballbot).f(&x, torque, &Vector2::zeros());
        assert_eq!(found, ballbot.f(&x, torque), "to the last bit, at {x}");
    }
}

#[test]
fn forces_do_the_work_that_the_energy_gains() {
    let mut rng = Rng::with_seed(2);
    for _ in 0..200 {
        let robot = on_a_slope(&mut rng);
        let (x, torque) = (robots::state(&mut rng), robots::torque(&mut rng));
        let load = Vector2::new(
            robots::uniform(&mut rng, -2.0, 2.0),
            robots::uniform(&mut rng, -2.0, 2.0),
        );
        let x_dot = robot.f(&x, torque, &load);
        let geometry = robot.ballbot.geometry;
        let gear = geometry.ball_radius / geometry.wheel_radius;
        let drive = robot.ballbot.drive;
        let speed = x[2] - x[3];
        let friction = drive.viscous * speed + drive.coulomb * speed / speed.hypot(CREEP_SPEED);
        let power = (gear * torque - friction) * speed - robot.ballbot.b4 * x[2] * x[2]
            + load[0] * geometry.ball_radius * x[2]
            + load[1] * x[3];
        // Central difference along the motion: its error is of order h^2.
        let h = 1e-5;
        let gain =
            (energy(&robot, &(x + x_dot * h)) - energy(&robot, &(x - x_dot * h))) / (2.0 * h);
        let size = power.abs() + energy(&robot, &x).abs() + x_dot.norm();
        assert!(
            (gain - power).abs() < 1e-5 * size,
            "{gain} for {power} at {x}"
        );
    }
}

#[test]
fn it_can_rest_on_a_slope_that_is_not_too_steep() {
    let mut rng = Rng::with_seed(3);
    for _ in 0..50 {
        let robot = on_a_slope(&mut rng);
        if let Some((x, torque)) = robot.rest(1.0) {
            let x_dot = robot.f(&x, torque, &Vector2::zeros());
            assert!(x_dot.norm() < 1e-9, "{x_dot}");
        }
    }
    let steep = Disturbed {
        slope: 1.5,
        ..Disturbed::level(Ballbot::paper())
    };
    // sin(lean) = r_b sin(slope) / l = 0.4: possible; with ten times the mass it is not.
    assert!(steep.rest(0.0).is_some());
    let heavy = Disturbed {
        total_mass: 10.0,
        ..steep
    };
    assert_eq!(heavy.rest(0.0), None);
}
