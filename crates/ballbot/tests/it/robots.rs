//! Robots and states to try the model on, the same ones in every run.

use ballbot::{Ballbot, DriveFriction, Geometry};
use fastrand::Rng;
use nalgebra::Vector4;
use std::f64::consts::{FRAC_PI_4, PI};

/// A uniform number from `low` to `high`.
pub fn uniform(rng: &mut Rng, low: f64, high: f64) -> f64 {
    low + (high - low) * rng.f64()
}

/// A state with any tilt, at speeds beyond the paper's bounds.
pub fn state(rng: &mut Rng) -> Vector4<f64> {
    Vector4::new(
        uniform(rng, -30.0, 30.0),
        uniform(rng, -PI, PI),
        uniform(rng, -40.0, 40.0),
        uniform(rng, -10.0, 10.0),
    )
}

/// A torque beyond the paper's bounds, N m.
pub fn torque(rng: &mut Rng) -> f64 {
    uniform(rng, -3.0, 3.0)
}

/// A robot put together from a ball, a body and wheels of random sizes and masses (kg, m,
/// kg m^2): b1 = b2 + (I_k + (m_k + m_a) r_b^2)/m_a,
/// b2 = 3/2 cos^2(alpha) (r_b/r_w)^2 I_w/m_a, b3 = b2 + l^2 + I_a/m_a.
pub fn rigid(rng: &mut Rng) -> Ballbot<f64> {
    let (body, ball) = (uniform(rng, 0.5, 80.0), uniform(rng, 0.1, 10.0));
    let geometry = Geometry {
        centre_of_mass: uniform(rng, 0.05, 1.0),
        ball_radius: uniform(rng, 0.03, 0.2),
        wheel_radius: uniform(rng, 0.01, 0.1),
        gravity: 9.81,
    };
    let square = |length: f64| length * length;
    // From a solid ball to a shell.
    let ball_inertia = uniform(rng, 0.4, 2.0 / 3.0) * ball * square(geometry.ball_radius);
    let body_inertia = body * square(uniform(rng, 0.02, 0.5));
    let wheel_inertia = uniform(rng, 0.0, 0.5) * square(geometry.wheel_radius);
    let gear = geometry.ball_radius / geometry.wheel_radius;
    let b2 = 1.5 * square(FRAC_PI_4.cos() * gear) * wheel_inertia / body;
    Ballbot {
        b1: b2 + (ball_inertia + (ball + body) * square(geometry.ball_radius)) / body,
        b2,
        b3: b2 + square(geometry.centre_of_mass) + body_inertia / body,
        b4: uniform(rng, 0.0, 0.2),
        drive: DriveFriction {
            viscous: uniform(rng, 0.0, 0.2),
            coulomb: uniform(rng, 0.0, 0.5),
        },
        geometry,
    }
}
