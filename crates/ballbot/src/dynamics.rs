//! The equations of motion M(q) q_ddot + C(q, q_dot) + D(q_dot) + G(q) = B~ tau (eq. (1)),
//! with q = (phi, theta).

use crate::parameters::Ballbot;
use crate::trigonometry::sin_cos;
use lpvmpc::Scalar;
use nalgebra::{Matrix2, Matrix4, Vector2, Vector4, convert};

impl<T: Scalar> Ballbot<T> {
    /// Mass matrix M(q), 2 x 2, m^2 (eq. (2)).
    pub fn mass(&self, theta: T) -> Matrix2<T> {
        let coupling = self.coupling(theta.cos());
        Matrix2::new(self.b1, -coupling, -coupling, self.b3)
    }

    /// Centrifugal term C(q, q_dot), m^2/s^2.
    pub fn coriolis(&self, theta: T, theta_dot: T) -> Vector2<T> {
        let Self { geometry, .. } = self;
        let arm = geometry.centre_of_mass * geometry.ball_radius;
        Vector2::new(-arm * theta.sin() * theta_dot * theta_dot, T::zero())
    }

    /// Friction term D(q_dot), m^2/s^2: rolling on the floor, and the drive between ball and body.
    pub fn friction(&self, phi_dot: T, theta_dot: T) -> Vector2<T> {
        let speed = phi_dot - theta_dot;
        let drive = self.drive.coefficient(speed) * speed;
        Vector2::new(self.b4 * phi_dot + drive, -drive)
    }

    /// Gravity term G(q), m^2/s^2.
    pub fn gravity(&self, theta: T) -> Vector2<T> {
        let Self { geometry, .. } = self;
        Vector2::new(
            T::zero(),
            -geometry.centre_of_mass * geometry.gravity * theta.sin(),
        )
    }

    /// Input vector B~.
    pub fn input(&self) -> Vector2<T> {
        Vector2::new(self.gear(), -self.gear())
    }

    /// x_dot = f(x, u) of the nonlinear plant (eq. (3)): `x` = (phi, theta, phi_dot,
    /// theta_dot) in rad and rad/s, `torque` in N m.
    // Inlined, so that the stages of a Runge-Kutta step overlap in the processor.
    #[inline(always)]
    pub fn f(&self, x: &Vector4<T>, torque: T) -> Vector4<T> {
        let (theta, phi_dot, theta_dot) = (x[1], x[2], x[3]);
        let (sin_theta, cos_theta) = sin_cos(theta);
        let Self { geometry, .. } = self;
        let arm = geometry.centre_of_mass * geometry.ball_radius;
        let coupling = self.coupling(cos_theta);
        // B~ tau - C - D - G
        let drive = self.driving_force(torque, phi_dot - theta_dot);
        let force_phi = drive + arm * sin_theta * theta_dot * theta_dot - self.b4 * phi_dot;
        let force_theta = geometry.centre_of_mass * geometry.gravity * sin_theta - drive;
        let [phi_ddot, theta_ddot] = self.accelerate(coupling, force_phi, force_theta);
        Vector4::new(phi_dot, theta_dot, phi_ddot, theta_ddot)
    }

    /// (f, df/dx, df/du): f as [`Ballbot::f`] has it, 4 x 4 per second, and 4 x 1. Of Coulomb friction it has the secant F(v)/v in
    /// place of the derivative: that is next to zero while the drive moves, so that a linear model
    /// with it has friction push on where the motion turns round, and its plans chatter.
    ///
    /// From M q_ddot = force: M dq_ddot = dforce - dM q_ddot.
    #[inline(always)]
    pub(crate) fn tangent_of_f(
        &self,
        x: &Vector4<T>,
        torque: T,
    ) -> (Vector4<T>, Matrix4<T>, Vector4<T>) {
        let (theta, phi_dot, theta_dot) = (x[1], x[2], x[3]);
        let (sin_theta, cos_theta) = sin_cos(theta);
        let Self { geometry, .. } = self;
        let (zero, one) = (T::zero(), T::one());
        let arm = geometry.centre_of_mass * geometry.ball_radius;
        let pull = geometry.centre_of_mass * geometry.gravity;
        let coupling = self.coupling(cos_theta);
        let speed = phi_dot - theta_dot;
        let drive = self.driving_force(torque, speed);
        let swing = arm * theta_dot;
        let inverse = one / self.determinant(coupling);
        let accelerate = |force_phi, force_theta| {
            self.accelerate_with(inverse, coupling, force_phi, force_theta)
        };
        let [phi_ddot, theta_ddot] = accelerate(
            drive + swing * theta_dot * sin_theta - self.b4 * phi_dot,
            pull * sin_theta - drive,
        );
        // The coupling stands in M with a minus sign, and moves by arm sin(theta) per theta.
        let shift = arm * sin_theta;
        let by_theta = accelerate(
            swing * theta_dot * cos_theta + shift * theta_ddot,
            pull * cos_theta + shift * phi_ddot,
        );
        let friction = if self.drive.is_none() {
            zero
        } else {
            self.drive.coefficient(speed)
        };
        let by_phi_dot = accelerate(-self.b4 - friction, friction);
        let by_theta_dot = accelerate(swing * (sin_theta + sin_theta) + friction, -friction);
        let by_torque = accelerate(self.gear(), -self.gear());
        #[rustfmt::skip]
        let a = Matrix4::new(
            zero, zero,        one,           zero,
            zero, zero,        zero,          one,
            zero, by_theta[0], by_phi_dot[0], by_theta_dot[0],
            zero, by_theta[1], by_phi_dot[1], by_theta_dot[1],
        );
        let f = Vector4::new(phi_dot, theta_dot, phi_ddot, theta_ddot);
        (f, a, Vector4::new(zero, zero, by_torque[0], by_torque[1]))
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
        let inverse = T::one() / self.determinant(coupling);
        self.accelerate_with(inverse, coupling, force_phi, force_theta)
    }

    /// The same with the `inverse` of det M, 1/m^4.
    #[inline(always)]
    fn accelerate_with(&self, inverse: T, coupling: T, force_phi: T, force_theta: T) -> [T; 2] {
        [
            (self.b3 * force_phi + coupling * force_theta) * inverse,
            (coupling * force_phi + self.b1 * force_theta) * inverse,
        ]
    }

    /// The ball's acceleration in rad/s^2 while the body keeps the tilt `theta` (rad), from rest
    /// or without friction: the sum of both lines of eq. (1) with theta_ddot = 0.
    pub fn acceleration_at_tilt(&self, theta: T) -> T {
        let (sin_theta, cos_theta) = sin_cos(theta);
        let Self { geometry, .. } = self;
        let pull = geometry.centre_of_mass * geometry.gravity * sin_theta;
        pull / (self.b1 - self.coupling(cos_theta))
    }

    /// Kinetic plus potential energy per unit of body mass, m^2/s^2. Constant without friction
    /// and torque.
    pub fn energy(&self, x: &Vector4<T>) -> T {
        let rates = Vector2::new(x[2], x[3]);
        let kinetic = rates.dot(&(self.mass(x[1]) * rates)) * convert::<f64, T>(0.5);
        let Self { geometry, .. } = self;
        kinetic + geometry.centre_of_mass * geometry.gravity * x[1].cos()
    }
}
