//! Plants of the tests.

use lpvmpc::{LpvModel, Scalar};
use nalgebra::{Matrix2, SMatrix, SVector, Vector1, Vector2, convert};

pub const NX: usize = 3;
pub const NU: usize = 2;

/// x_dot = (A + s A_s) x + B u; with its own scheduling s = 0 it is linear.
#[derive(Clone, Debug)]
pub struct Scheduled<T: Scalar> {
    pub a: SMatrix<T, NX, NX>,
    pub a_s: SMatrix<T, NX, NX>,
    pub b: SMatrix<T, NX, NU>,
}

impl<T: Scalar> LpvModel<T, NX, NU, 1> for Scheduled<T> {
    fn scheduling(&self, _: &SVector<T, NX>, _: &SVector<T, NU>) -> Vector1<T> {
        Vector1::zeros()
    }

    fn matrices(&self, s: &Vector1<T>) -> (SMatrix<T, NX, NX>, SMatrix<T, NX, NU>) {
        (self.a + self.a_s * s[0], self.b)
    }
}

/// A pendulum about its upright: (angle, rate), torque per moment of inertia.
#[derive(Clone, Copy, Debug)]
pub struct Pendulum<T> {
    /// Gravity over length, 1/s^2.
    pub stiffness: T,
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
        let a = Matrix2::new(T::zero(), T::one(), self.stiffness * sinc[0], convert(-0.1));
        (a, Vector2::new(T::zero(), T::one()))
    }
}

/// A cart on a rail: (position, speed), acceleration.
#[derive(Clone, Copy, Debug)]
pub struct Cart;

impl LpvModel<f64, 2, 1, 1> for Cart {
    fn scheduling(&self, _: &Vector2<f64>, _: &Vector1<f64>) -> Vector1<f64> {
        Vector1::zeros()
    }

    fn matrices(&self, _: &Vector1<f64>) -> (Matrix2<f64>, Vector2<f64>) {
        (Matrix2::new(0.0, 1.0, 0.0, 0.0), Vector2::new(0.0, 1.0))
    }
}
