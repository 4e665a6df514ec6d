//! A pendulum.

use lpvmpc::{LpvModel, Scalar};
use nalgebra::{Matrix2, Vector1, Vector2};

/// A pendulum about its upright: (angle, rate), torque per moment of inertia.
#[derive(Clone, Copy, Debug)]
pub struct Pendulum<T> {
    /// Gravity over length, 1/s^2.
    pub stiffness: T,
    /// 1/s.
    pub damping: T,
}

impl<T: Scalar> LpvModel<T, 2, 1, 1> for Pendulum<T> {
    fn scheduling(&self, x: &Vector2<T>, _: &Vector1<T>) -> Vector1<T> {
        Vector1::new(if x[0] == T::zero() {
            T::one()
        } else {
            x[0].sin() / x[0]
        })
    }

    fn matrices(&self, sinc: &Vector1<T>) -> (Matrix2<T>, Vector2<T>) {
        let a = Matrix2::new(T::zero(), T::one(), self.stiffness * sinc[0], -self.damping);
        (a, Vector2::new(T::zero(), T::one()))
    }
}
