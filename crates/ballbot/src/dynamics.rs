//! The equations of motion M(q) q_ddot + C(q, q_dot) + D(q_dot) + G(q) = B~ tau (eq. (1)) with
//! q = (phi, theta), written once, on every kind of number.

use crate::embedding::state_matrix;
use crate::friction::DriveFriction;
use crate::parameters::Ballbot;
use lpvmpc::{Number, Tangent};
use nalgebra::{Matrix2, Vector4};

/// What the equations of motion need of an attitude of the body.
#[derive(Clone, Copy)]
pub(crate) struct Attitude<T> {
    /// Sine of the body's angle from the vertical: what gravity pulls at.
    pub sin_lean: T,
    /// Sine of its angle from the normal of the floor, and its cosine.
    pub sin_normal: T,
    pub cos_normal: T,
}

/// Accelerations (phi_ddot, theta_ddot) in rad/s^2, and what they change by per theta, phi_dot,
/// theta_dot and torque.
pub(crate) struct Slopes<T> {
    pub accelerations: [T; 2],
    pub by_theta: [T; 2],
    pub by_phi_dot: [T; 2],
    pub by_theta_dot: [T; 2],
    pub by_torque: [T; 2],
    /// 1/det M, 1/m^4.
    pub inverse: T,
    /// What stands in M with a minus sign, m^2.
    pub coupling: T,
}

impl<T: Number> Attitude<T> {
    /// At the tilt `theta` (rad) on a level floor.
    #[inline(always)]
    fn level(theta: T) -> Self {
        let (sin, cos) = theta.sin_cos();
        Self {
            sin_lean: sin,
            sin_normal: sin,
            cos_normal: cos,
        }
    }
}

impl<T: Number> Ballbot<T> {
    /// Mass matrix M(q), 2 x 2, m^2 (eq. (2)).
    pub fn mass(&self, theta: T) -> Matrix2<T> {
        let coupling = self.coupling(theta.cos());
        Matrix2::new(self.b1, -coupling, -coupling, self.b3)
    }

    /// x_dot = f(x, u) of the nonlinear plant (eq. (3)): `x` = (phi, theta, phi_dot,
    /// theta_dot) in rad and rad/s, `torque` in N m.
    // Inlined, so that the stages of a Runge-Kutta step overlap in the processor.
    #[inline(always)]
    pub fn f(&self, x: &Vector4<T>, torque: T) -> Vector4<T> {
        let attitude = Attitude::level(x[1]);
        let drive = self.driving_force(torque, x[2] - x[3]);
        let [force_phi, force_theta] = self.forces(&attitude, x, drive);
        let coupling = self.coupling(attitude.cos_normal);
        let [phi_ddot, theta_ddot] = self.accelerate(coupling, force_phi, force_theta);
        Vector4::new(x[2], x[3], phi_ddot, theta_ddot)
    }

    /// (f, df/dx, df/du): f as [`Ballbot::f`] has it, 4 x 4 per second, and 4 x 1. Of Coulomb friction
    /// it has the secant F(v)/v in place of the derivative: that is next to zero while the drive moves,
    /// so that a linear model with it has friction push on where the motion turns round, and its plans
    /// chatter.
    #[inline(always)]
    pub(crate) fn tangent_of_f(&self, x: &Vector4<T>, torque: T) -> Tangent<T, 4, 1> {
        let zero = T::constant(0.0);
        let slopes = self.slopes(x, torque, DriveFriction::coefficient);
        let row = |i: usize| {
            [
                slopes.by_theta[i],
                slopes.by_phi_dot[i],
                slopes.by_theta_dot[i],
            ]
        };
        let a = state_matrix(row(0), row(1));
        let [phi_ddot, theta_ddot] = slopes.accelerations;
        let f = Vector4::new(x[2], x[3], phi_ddot, theta_ddot);
        (
            f,
            a,
            Vector4::new(zero, zero, slopes.by_torque[0], slopes.by_torque[1]),
        )
    }

    /// The accelerations and their slopes, with `slope` for that of the drive's friction at a speed, m^2/s.
    ///
    /// From M q_ddot = force: M dq_ddot = dforce - dM q_ddot, which is half the work of dual numbers.
    #[inline(always)]
    pub(crate) fn slopes(
        &self,
        x: &Vector4<T>,
        torque: T,
        slope: impl Fn(DriveFriction<T>, T) -> T,
    ) -> Slopes<T> {
        let (phi_dot, theta_dot) = (x[2], x[3]);
        let attitude = Attitude::level(x[1]);
        let (sin_theta, cos_theta) = (attitude.sin_normal, attitude.cos_normal);
        let coupling = self.coupling(cos_theta);
        let speed = phi_dot - theta_dot;
        let swing = self.arm() * theta_dot;
        let inverse = T::constant(1.0) / self.determinant(coupling);
        let accelerate = |force_phi, force_theta| {
            self.accelerate_with(inverse, coupling, force_phi, force_theta)
        };
        let drive = self.driving_force(torque, speed);
        let [force_phi, force_theta] = self.forces(&attitude, x, drive);
        let [phi_ddot, theta_ddot] = accelerate(force_phi, force_theta);
        // The coupling stands in M with a minus sign, and moves by arm sin(theta) per theta.
        let shift = self.arm() * sin_theta;
        let by_theta = accelerate(
            swing * theta_dot * cos_theta + shift * theta_ddot,
            self.pull() * cos_theta + shift * phi_ddot,
        );
        let friction = if self.drive.is_none() {
            T::constant(0.0)
        } else {
            slope(self.drive, speed)
        };
        Slopes {
            accelerations: [phi_ddot, theta_ddot],
            by_theta,
            by_phi_dot: accelerate(-self.b4 - friction, friction),
            by_theta_dot: accelerate(swing * (sin_theta + sin_theta) + friction, -friction),
            by_torque: accelerate(self.gear(), -self.gear()),
            inverse,
            coupling,
        }
    }

    /// B~ tau - C - D - G: the generalised forces on ball and body, m^2/s^2, where the drive acts with
    /// `drive` between them.
    #[inline(always)]
    pub(crate) fn forces(&self, attitude: &Attitude<T>, x: &Vector4<T>, drive: T) -> [T; 2] {
        let (phi_dot, theta_dot) = (x[2], x[3]);
        let centrifugal = self.arm() * theta_dot * theta_dot * attitude.sin_normal;
        [
            drive + centrifugal - self.b4 * phi_dot,
            self.pull() * attitude.sin_lean - drive,
        ]
    }

    /// What the drive does to the ball, and the opposite to the body, m^2/s^2: torque (N m) less
    /// friction at the speed phi_dot - theta_dot (rad/s).
    #[inline(always)]
    pub(crate) fn driving_force(&self, torque: T, speed: T) -> T {
        let driven = self.gear() * torque;
        if self.drive.is_none() {
            driven
        } else {
            driven - self.drive.coefficient(speed) * speed
        }
    }

    /// M^-1 (force_phi, force_theta) in rad/s^2, for generalised forces in m^2/s^2.
    #[inline(always)]
    pub(crate) fn accelerate(&self, coupling: T, force_phi: T, force_theta: T) -> [T; 2] {
        let inverse = T::constant(1.0) / self.determinant(coupling);
        self.accelerate_with(inverse, coupling, force_phi, force_theta)
    }

    /// The same with the `inverse` of det M, 1/m^4.
    #[inline(always)]
    pub(crate) fn accelerate_with(
        &self,
        inverse: T,
        coupling: T,
        force_phi: T,
        force_theta: T,
    ) -> [T; 2] {
        [
            (self.b3 * force_phi + coupling * force_theta) * inverse,
            (coupling * force_phi + self.b1 * force_theta) * inverse,
        ]
    }

    /// The ball's acceleration in rad/s^2 while the body keeps the tilt `theta` (rad), from rest
    /// or without friction: the sum of both lines of eq. (1) with theta_ddot = 0.
    pub fn acceleration_at_tilt(&self, theta: T) -> T {
        let (sin_theta, cos_theta) = theta.sin_cos();
        self.pull() * sin_theta / (self.b1 - self.coupling(cos_theta))
    }

    /// Kinetic plus potential energy per unit of body mass, m^2/s^2. Constant without friction
    /// and torque.
    pub fn energy(&self, x: &Vector4<T>) -> T {
        let (phi_dot, theta_dot) = (x[2], x[3]);
        let cos_theta = x[1].cos();
        let twice_kinetic = self.b1 * phi_dot * phi_dot + self.b3 * theta_dot * theta_dot
            - T::constant(2.0) * self.coupling(cos_theta) * phi_dot * theta_dot;
        T::constant(0.5) * twice_kinetic + self.pull() * cos_theta
    }
}
