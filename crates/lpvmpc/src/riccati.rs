//! The Riccati kernel: one backward step of the linear-quadratic problem, and the vector
//! recursions that reuse its factor.
//!
//! With the cost-to-go x'Px/2 + p'x behind a stage, the stage's minimisation over u gives
//! u = K x + k. Written with the Cholesky factor R + B'PB = L L' and the normalised deviation
//! v = L'(u - K x - k), the whole cost becomes `constant + sum |v_i|^2 / 2`: the horizon's
//! Hessian is the identity, and a bound is a plain linear row in v.

use crate::model::Scalar;
use crate::ocp::Stage;
use nalgebra::{SMatrix, SVector, convert};

/// Cost-to-go x'Px/2 + p'x.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CostToGo<T, const NX: usize> {
    /// P, `NX` x `NX`, symmetric.
    pub quadratic: SMatrix<T, NX, NX>,
    /// p, `NX`.
    pub linear: SVector<T, NX>,
}

/// What a stage's minimisation leaves behind: the policy u = K x + k + L^-T v and the dynamics
/// under it, x+ = (A + BK) x + B L^-T v + (c + B k).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StageFactor<T, const NX: usize, const NU: usize> {
    /// Feedback K, `NU` x `NX`.
    pub gain: SMatrix<T, NU, NX>,
    /// Feedforward k, `NU`.
    pub feedforward: SVector<T, NU>,
    /// L^-1, `NU` x `NU`, lower triangular.
    pub inverse_factor: SMatrix<T, NU, NU>,
    /// A + BK, `NX` x `NX`.
    pub closed_loop: SMatrix<T, NX, NX>,
    /// B L^-T, `NX` x `NU`.
    pub input: SMatrix<T, NX, NU>,
    /// c + B k, `NX`.
    pub drift: SVector<T, NX>,
}

/// R + B'PB is not positive definite: the pivot that is not positive (or not finite).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BadPivot<T>(pub T);

impl<T: Scalar, const NX: usize, const NU: usize> StageFactor<T, NX, NU> {
    /// The factor of a stage that does nothing, to fill a workspace with.
    pub fn zeros() -> Self {
        Self {
            gain: SMatrix::zeros(),
            feedforward: SVector::zeros(),
            inverse_factor: SMatrix::zeros(),
            closed_loop: SMatrix::zeros(),
            input: SMatrix::zeros(),
            drift: SVector::zeros(),
        }
    }

    /// One backward step: the stage's factor, and the cost-to-go in front of the stage.
    ///
    /// # Errors
    /// [`BadPivot`] if R + B'PB is not numerically positive definite.
    pub fn new<const NG: usize>(
        stage: &Stage<T, NX, NU, NG>,
        behind: &CostToGo<T, NX>,
    ) -> Result<(Self, CostToGo<T, NX>), BadPivot<T>> {
        let (a, b) = (&stage.a, &stage.b);
        let p_a = behind.quadratic * a;
        let p_b = behind.quadratic * b;
        let linear_next = behind.linear + behind.quadratic * stage.c;

        let inverse_factor = inverse_cholesky(&(stage.r + b.tr_mul(&p_b)))?;
        let normalised_gain = inverse_factor * (stage.s + b.tr_mul(&p_a));
        let normalised_feedforward = inverse_factor * (stage.linear_u + b.tr_mul(&linear_next));
        let gain = -inverse_factor.tr_mul(&normalised_gain);
        let feedforward = -inverse_factor.tr_mul(&normalised_feedforward);

        let quadratic = stage.q + a.tr_mul(&p_a) - normalised_gain.tr_mul(&normalised_gain);
        let front = CostToGo {
            quadratic: (quadratic + quadratic.transpose()) * convert::<f64, T>(0.5),
            linear: stage.linear_x + a.tr_mul(&linear_next)
                - normalised_gain.tr_mul(&normalised_feedforward),
        };
        let factor = Self {
            gain,
            feedforward,
            inverse_factor,
            closed_loop: a + b * gain,
            input: b * inverse_factor.transpose(),
            drift: stage.c + b * feedforward,
        };
        Ok((factor, front))
    }

    /// The input at the state `x` with the normalised deviation `v`.
    pub fn policy(&self, x: &SVector<T, NX>, v: &SVector<T, NU>) -> SVector<T, NU> {
        self.gain * x + self.feedforward + self.inverse_factor.tr_mul(v)
    }

    /// The next state under the policy.
    pub fn next(&self, x: &SVector<T, NX>, v: &SVector<T, NU>) -> SVector<T, NX> {
        self.closed_loop * x + self.input * v + self.drift
    }
}

/// L^-1 for the symmetric matrix `m` = L L' (its lower triangle is read).
fn inverse_cholesky<T: Scalar, const K: usize>(
    m: &SMatrix<T, K, K>,
) -> Result<SMatrix<T, K, K>, BadPivot<T>> {
    let mut l = *m;
    let mut inverse = SMatrix::<T, K, K>::zeros();
    for j in 0..K {
        let mut pivot = l[(j, j)];
        for k in 0..j {
            pivot -= l[(j, k)] * l[(j, k)];
        }
        if !(pivot > T::zero() && pivot.is_finite()) {
            return Err(BadPivot(pivot));
        }
        let reciprocal = T::one() / pivot.sqrt();
        l[(j, j)] = pivot * reciprocal;
        inverse[(j, j)] = reciprocal;
        for i in j + 1..K {
            let mut entry = l[(i, j)];
            for k in 0..j {
                entry -= l[(i, k)] * l[(j, k)];
            }
            l[(i, j)] = entry * reciprocal;
        }
    }
    for j in 0..K {
        for i in j + 1..K {
            let mut entry = T::zero();
            for k in j..i {
                entry -= l[(i, k)] * inverse[(k, j)];
            }
            inverse[(i, j)] = entry * inverse[(i, i)];
        }
    }
    Ok(inverse)
}
