//! Parameters of the ballbot, with units and source.
//!
//! The paper is D. S. Karachalios and H. S. Abbas, "Parameter Refinement of a Ballbot and
//! Predictive Control for Reference Tracking with Linear Parameter-Varying Embedding".

use crate::friction::DriveFriction;
use lpvmpc::{Number, Scalar};
use nalgebra::convert;

/// Lengths and gravity (the paper's Table of p).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Geometry<T> {
    /// l: distance from the ball's centre to the body's centre of mass, m.
    pub centre_of_mass: T,
    /// r_b: radius of the ball, m.
    pub ball_radius: T,
    /// r_w: radius of the virtual wheel, m.
    pub wheel_radius: T,
    /// g: acceleration of gravity, m/s^2.
    pub gravity: T,
}

impl<T: Scalar> Geometry<T> {
    /// The paper's ballbot.
    pub fn paper() -> Self {
        Self {
            centre_of_mass: convert(0.2978),
            ball_radius: convert(0.12),
            wheel_radius: convert(0.05),
            gravity: convert(9.81),
        }
    }

    /// x = r_b phi: where the ball is, in m, after it has turned by `phi` rad.
    pub fn position(&self, phi: T) -> T {
        self.ball_radius * phi
    }

    /// The ball's angle in rad at the position `x` in m.
    pub fn ball_angle(&self, x: T) -> T {
        x / self.ball_radius
    }
}

/// The planar ballbot: parameters b of eq. (2), all per unit of body mass.
///
/// State x = (phi, theta, phi_dot, theta_dot) in rad and rad/s: the ball's angle and the
/// body's tilt. Input u = tau, the torque of the virtual wheel in N m. As in the paper, the
/// torque is not divided by the body mass; its effect is absorbed in b.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ballbot<T> {
    /// b1: inertia of the ball's rolling, m^2.
    pub b1: T,
    /// b2: coupling inertia, m^2.
    pub b2: T,
    /// b3: inertia of the body's tilt, m^2.
    pub b3: T,
    /// b4: viscous friction on phi_dot, m^2/s; positive when it takes energy away.
    pub b4: T,
    /// Friction in the drive, on phi_dot - theta_dot; the paper has none.
    pub drive: DriveFriction<T>,
    /// Lengths and gravity.
    pub geometry: Geometry<T>,
}

impl<T: Scalar + Number> Ballbot<T> {
    /// The paper's refined parameters b*, as printed.
    pub fn paper() -> Self {
        Self {
            b1: convert(0.002483),
            b2: convert(0.059325),
            b3: convert(0.143093),
            b4: convert(-0.07436),
            drive: DriveFriction::none(),
            geometry: Geometry::paper(),
        }
    }

    /// The same robot with parameters of another kind of number.
    #[inline(always)]
    pub fn over<N: Number>(&self) -> Ballbot<N> {
        let over = |value: T| N::constant(value.to_subset_unchecked());
        let Self {
            b1,
            b2,
            b3,
            b4,
            drive,
            geometry,
        } = *self;
        Ballbot {
            b1: over(b1),
            b2: over(b2),
            b3: over(b3),
            b4: over(b4),
            drive: DriveFriction {
                viscous: over(drive.viscous),
                coulomb: over(drive.coulomb),
            },
            geometry: Geometry {
                centre_of_mass: over(geometry.centre_of_mass),
                ball_radius: over(geometry.ball_radius),
                wheel_radius: over(geometry.wheel_radius),
                gravity: over(geometry.gravity),
            },
        }
    }

    /// The same robot without Coulomb friction, whose slope at rest says nothing about motion:
    /// what a linear model of a moving robot is made from.
    pub fn without_coulomb(self) -> Self {
        Self {
            drive: DriveFriction {
                coulomb: T::zero(),
                ..self.drive
            },
            ..self
        }
    }
}

impl<T: Number> Ballbot<T> {
    /// k(theta) = b2 - l r_b cos(theta), m^2: minus the off-diagonal entry of M.
    pub(crate) fn coupling(&self, cos_theta: T) -> T {
        self.b2 - self.arm() * cos_theta
    }

    /// l r_b, m^2.
    #[inline(always)]
    pub(crate) fn arm(&self) -> T {
        self.geometry.centre_of_mass * self.geometry.ball_radius
    }

    /// l g, m^2/s^2: what gravity pulls the body with, per sin(theta).
    #[inline(always)]
    pub(crate) fn pull(&self) -> T {
        self.geometry.centre_of_mass * self.geometry.gravity
    }

    /// d = det M = b1 b3 - k^2, m^4.
    pub(crate) fn determinant(&self, coupling: T) -> T {
        self.b1 * self.b3 - coupling * coupling
    }

    /// r_b / r_w: from the virtual wheel's torque to the ball's.
    pub fn gear(&self) -> T {
        self.geometry.ball_radius / self.geometry.wheel_radius
    }
}

/// Parameters p of the linear model at the upright equilibrium (eq. (10)), as identified from
/// a stabilised robot.
///
/// ```text
/// phi_ddot   = p1 theta + p2 phi_dot + p3 tau
/// theta_ddot = p4 theta + p5 phi_dot + p6 tau
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearParameters<T> {
    /// p1, 1/s^2.
    pub p1: T,
    /// p2, 1/s.
    pub p2: T,
    /// p3, rad/(s^2 N m).
    pub p3: T,
    /// p4, 1/s^2.
    pub p4: T,
    /// p5, 1/s.
    pub p5: T,
    /// p6, rad/(s^2 N m).
    pub p6: T,
}

impl<T: Scalar> LinearParameters<T> {
    /// The paper's Table of p with p6 negative.
    ///
    /// The paper prints p6 = +251.8476. Its own b* then leaves a residual of 503.7, with the
    /// negative sign 0.4333: the printed sign is a slip.
    pub fn paper() -> Self {
        Self {
            p1: convert(-342.6038),
            p2: convert(-52.8301),
            p3: convert(-1425.9),
            p4: convert(-36.0734),
            p5: convert(-9.1477),
            p6: convert(-251.8476),
        }
    }
}

/// The paper's Table of MPC constraints; phi is free.
pub mod limits {
    use core::f64::consts::{FRAC_PI_3, PI};

    /// Largest tilt, rad.
    pub const THETA: f64 = FRAC_PI_3;
    /// Largest speed of the ball, rad/s.
    pub const PHI_DOT: f64 = 10.0 * PI;
    /// Largest tilt rate, rad/s.
    pub const THETA_DOT: f64 = 2.0 * PI;
    /// Largest torque of the virtual wheel, N m.
    pub const TORQUE: f64 = 1.5;
}
