//! The discrete-time predictor: classical Runge-Kutta of order four under zero-order hold.
//!
//! The same method in two forms. With the scheduling given it is linear and becomes a pair of
//! matrices (lines 2 to 8 of Algorithm 1); with the scheduling read off the state it is the
//! nonlinear map of the rollout (eq. (5), step 4 of Algorithm 2).

use crate::kernel::{add_product, product};
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
    /// With h = t_s / substeps and M = hA, one step is
    /// A_h = I + M + M^2/2 + M^3/6 + M^4/24 and B_h = h (I + M/2 + M^2/6 + M^3/24) B: the
    /// Taylor polynomials of order four of the exact zero-order-hold pair. Frozen scheduling
    /// over the whole sample is the paper's predictor.
    #[inline(always)]
    pub fn discretize<T: Scalar, const NX: usize, const NU: usize>(
        self,
        a: &SMatrix<T, NX, NX>,
        b: &SMatrix<T, NX, NU>,
        t_s: T,
    ) -> (SMatrix<T, NX, NX>, SMatrix<T, NX, NU>) {
        let (a_step, b_step) = taylor_step(a, b, self.step_length(t_s));
        if self.substeps == 1 {
            return (a_step, b_step);
        }
        let (mut a_d, mut b_d) = (a_step, b_step);
        for _ in 1..self.substeps {
            b_d = product(&a_step, &b_d) + b_step;
            a_d = product(&a_step, &a_d);
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

/// One step of length `h` seconds for a constant pair: the Taylor polynomials of order four.
#[inline(always)]
fn taylor_step<T: Scalar, const NX: usize, const NU: usize>(
    a: &SMatrix<T, NX, NX>,
    b: &SMatrix<T, NX, NU>,
    h: T,
) -> (SMatrix<T, NX, NX>, SMatrix<T, NX, NU>) {
    let [half, sixth, last] = [0.5, 1.0 / 6.0, 1.0 / 24.0].map(convert::<f64, T>);
    let m = a * h;
    let m2 = product(&m, &m);
    let mut a_step = m + m2 * half;
    for i in 0..NX {
        a_step[(i, i)] += T::one();
    }
    add_product(&mut a_step, &m2, &(m * sixth + m2 * last));
    let b = b * h;
    let m_b = product(&m, &b);
    let mut b_step = b + m_b * half;
    add_product(&mut b_step, &m2, &(b * sixth + m_b * last));
    (a_step, b_step)
}
