//! Plants of the tests.

use crate::pendulum::Pendulum;
use lpvmpc::{LpvModel, Scalar};
use nalgebra::{SMatrix, SVector, Vector1};

pub const NX: usize = 4;
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

/// A cart on a rail: (position, speed), acceleration.
pub const CART: Pendulum<f64> = Pendulum {
    stiffness: 0.0,
    damping: 0.0,
};

/// A pendulum with little friction.
pub const PENDULUM: Pendulum<f64> = Pendulum {
    stiffness: 9.81,
    damping: 0.1,
};
