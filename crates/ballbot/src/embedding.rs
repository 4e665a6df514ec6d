//! The LPV embedding of the ballbot: scheduling (theta, theta_dot), matrices A_c and B_c
//! (eq. (4) and the paper's Table of elements).
//!
//! The table prints B31 with an unbalanced bracket; here it is r_b (b3 - k) / (r_w d), as
//! M^-1 B~ gives. Its sinc(theta) is sin(theta)/theta.

use crate::parameters::Ballbot;
use crate::trigonometry::sin_cos;
use lpvmpc::{LpvModel, Scalar};
use nalgebra::{Matrix4, Vector1, Vector2, Vector4};

impl<T: Scalar> LpvModel<T, 4, 1, 2> for Ballbot<T> {
    /// sigma(x) = (theta, theta_dot), rad and rad/s.
    fn scheduling(&self, x: &Vector4<T>) -> Vector2<T> {
        Vector2::new(x[1], x[3])
    }

    #[inline(always)]
    fn matrices(&self, scheduling: &Vector2<T>) -> (Matrix4<T>, Vector4<T>) {
        let (theta, theta_dot) = (scheduling[0], scheduling[1]);
        let (sin_theta, cos_theta) = sin_cos(theta);
        let Self {
            b1,
            b3,
            b4,
            geometry,
            ..
        } = *self;
        let k = self.coupling(cos_theta);
        let inverse = T::one() / self.determinant(k);
        let gravity = geometry.centre_of_mass * geometry.gravity * sinc(theta, sin_theta) * inverse;
        let centrifugal =
            geometry.centre_of_mass * geometry.ball_radius * sin_theta * theta_dot * inverse;
        let friction = -b4 * inverse;
        let torque = self.gear() * inverse;
        let (zero, one) = (T::zero(), T::one());
        #[rustfmt::skip]
        let a = Matrix4::new(
            zero, zero,         one,           zero,
            zero, zero,         zero,          one,
            zero, gravity * k,  friction * b3, centrifugal * b3,
            zero, gravity * b1, friction * k,  centrifugal * k,
        );
        let b = Vector4::new(zero, zero, torque * (b3 - k), torque * (k - b1));
        (a, b)
    }

    #[inline(always)]
    fn derivative(&self, x: &Vector4<T>, u: &Vector1<T>) -> Vector4<T> {
        self.f(x, u[0])
    }
}

/// sin(x)/x, 1 at x = 0.
fn sinc<T: Scalar>(x: T, sin_x: T) -> T {
    if x == T::zero() { T::one() } else { sin_x / x }
}
