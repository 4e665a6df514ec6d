//! The discrete-time predictor: classical Runge-Kutta of order four under zero-order hold.
//!
//! The same method in two forms. With the scheduling given it is linear and becomes a pair of
//! matrices (lines 2 to 8 of Algorithm 1); with the scheduling read off the state it is the
//! nonlinear map of the rollout (eq. (5), step 4 of Algorithm 2).

use crate::model::{LpvModel, Scalar};
use nalgebra::{SMatrix, SVector, convert};

/// Classical Runge-Kutta method of order four with `substeps` equal steps per sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rk4 {
    /// Steps per sample, at least 1; the paper uses 1.
    pub substeps: usize,
}

impl Rk4 {
    /// x_{k+1} = A_d x_k + B_d u_k over one sample of `t_s` seconds, for the constant
    /// continuous-time pair (`a`, `b`).
    ///
    /// With h = t_s / substeps and S = I + hA/2 (I + hA/3 (I + hA/4)), one step is
    /// A_h = I + hA S, B_h = h S B: the Taylor polynomial of order four of the exact
    /// zero-order-hold pair. Frozen scheduling over the whole sample is the paper's predictor.
    pub fn discretize<T: Scalar, const NX: usize, const NU: usize>(
        self,
        a: &SMatrix<T, NX, NX>,
        b: &SMatrix<T, NX, NU>,
        t_s: T,
    ) -> (SMatrix<T, NX, NX>, SMatrix<T, NX, NU>) {
        let h = self.step_length(t_s);
        let identity = SMatrix::<T, NX, NX>::identity();
        let ah = a * h;
        let third = identity + ah * convert::<f64, T>(0.25);
        let second = identity + ah * third * convert::<f64, T>(1.0 / 3.0);
        let series = identity + ah * second * convert::<f64, T>(0.5);
        let a_step = identity + ah * series;
        let b_step = series * b * h;

        let mut a_d = a_step;
        let mut b_d = b_step;
        for _ in 1..self.substeps {
            b_d = a_step * b_d + b_step;
            a_d = a_step * a_d;
        }
        (a_d, b_d)
    }

    /// The state `t_s` seconds after `x` under the constant input `u`, of the nonlinear plant.
    pub fn advance<T, M, const NX: usize, const NU: usize, const NS: usize>(
        self,
        model: &M,
        x: &SVector<T, NX>,
        u: &SVector<T, NU>,
        t_s: T,
    ) -> SVector<T, NX>
    where
        T: Scalar,
        M: LpvModel<T, NX, NU, NS>,
    {
        let h = self.step_length(t_s);
        let half: T = h * convert::<f64, T>(0.5);
        let sixth: T = h * convert::<f64, T>(1.0 / 6.0);
        let two: T = convert(2.0);
        let mut x = *x;
        for _ in 0..self.substeps {
            let k1 = model.derivative(&x, u);
            let k2 = model.derivative(&(x + k1 * half), u);
            let k3 = model.derivative(&(x + k2 * half), u);
            let k4 = model.derivative(&(x + k3 * h), u);
            x += (k1 + (k2 + k3) * two + k4) * sixth;
        }
        x
    }

    fn step_length<T: Scalar>(self, t_s: T) -> T {
        t_s / convert::<f64, T>(self.substeps as f64)
    }
}
