//! The Riccati kernel: one backward step of the linear-quadratic problem, and the vector
//! recursions that reuse its factor.
//!
//! With the cost-to-go x'Px/2 + p'x behind a stage, the stage's minimisation over u gives
//! u = K x + k. Written with the Cholesky factor R + B'PB = L L' and the normalised deviation
//! v = L'(u - K x - k), the whole cost becomes `constant + sum |v_i|^2 / 2`: the horizon's
//! Hessian is the identity, and a bound is a plain linear row in v.

use crate::model::Scalar;
use crate::ocp::{Common, Stage};
use crate::small_matrix::{add_product, product, transposed_product};
use nalgebra::{SMatrix, SVector, convert};

/// Cost-to-go x'Px/2 + p'x.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CostToGo<T, const NX: usize> {
    /// P, `NX` x `NX`, symmetric.
    pub quadratic: SMatrix<T, NX, NX>,
    /// p, `NX`.
    pub linear: SVector<T, NX>,
}

impl<T: Scalar, const NX: usize> CostToGo<T, NX> {
    /// No cost.
    pub fn zeros() -> Self {
        Self {
            quadratic: SMatrix::zeros(),
            linear: SVector::zeros(),
        }
    }
}

/// What a stage's minimisation leaves behind: the policy u = K x + k + L^-T v and the dynamics
/// under it, x+ = (A + BK) x + B L^-T v + (c + B k).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StageFactor<T, const NX: usize, const NU: usize> {
    /// Feedback K, `NU` x `NX`, with the sign of u = K x; gains are for u = -K x throughout.
    pub feedback: SMatrix<T, NU, NX>,
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
            feedback: SMatrix::zeros(),
            feedforward: SVector::zeros(),
            inverse_factor: SMatrix::zeros(),
            closed_loop: SMatrix::zeros(),
            input: SMatrix::zeros(),
            drift: SVector::zeros(),
        }
    }

    /// One backward step: takes the cost-to-go behind `stage`, whose bounds do not matter here, to the
    /// one in front of it, and leaves the stage's factor in `self`.
    ///
    /// # Errors
    /// [`BadPivot`] if R + B'PB is not numerically positive definite.
    #[inline(never)]
    pub fn eliminate(
        &mut self,
        stage: &Stage<T, NX, NU>,
        weights: &Common<T, NX, NU>,
        cost_to_go: &mut CostToGo<T, NX>,
    ) -> Result<(), BadPivot<T>> {
        let Stage { a, b, c, .. } = stage;
        let CostToGo { quadratic, linear } = cost_to_go;
        let p_a = product(quadratic, a);
        let p_b = product(quadratic, b);
        let p_next = *linear + product(quadratic, c);

        // H u = -(G x + g) is the condition for the stage's minimum. P is symmetric, so
        // B'P = (P B)'.
        let hessian = weights.r + transposed_product(b, &p_b);
        let g_x = weights.s + transposed_product(&p_b, a);
        let g = stage.linear_u + transposed_product(b, &p_next);
        let UnitFactor { inverse, pivots } = UnitFactor::new(&hessian)?;
        let reciprocals = pivots.map(|pivot| T::one() / pivot);
        let l_g_x = product(&inverse, &g_x);
        let scaled_g_x = scaled_rows(&l_g_x, &reciprocals);
        let scaled_g = scaled_rows(&product(&inverse, &g), &reciprocals);
        self.feedback = -transposed_product(&inverse, &scaled_g_x);
        self.feedforward = -transposed_product(&inverse, &scaled_g);

        // A'P(A + BK) + Q + S'K, and the same for the linear part.
        *quadratic = symmetric(
            &(weights.q + transposed_product(a, &p_a) - transposed_product(&l_g_x, &scaled_g_x)),
        );
        *linear =
            stage.linear_x + transposed_product(a, &p_next) - transposed_product(&l_g_x, &scaled_g);

        self.inverse_factor = scaled_rows(&inverse, &reciprocals.map(|d| d.sqrt()));
        self.closed_loop = a + product(b, &self.feedback);
        self.input = product(b, &self.inverse_factor.transpose());
        self.drift = c + product(b, &self.feedforward);
        Ok(())
    }

    /// The input at the state `x` with the normalised deviation `v`.
    #[inline(always)]
    pub fn policy(&self, x: &SVector<T, NX>, v: &SVector<T, NU>) -> SVector<T, NU> {
        let mut u = self.feedforward;
        add_product(&mut u, &self.feedback, x);
        u += transposed_product(&self.inverse_factor, v);
        u
    }

    /// The next state under the policy.
    #[inline(always)]
    pub fn next(&self, x: &SVector<T, NX>, v: &SVector<T, NU>) -> SVector<T, NX> {
        let mut next = self.drift;
        add_product(&mut next, &self.input, v);
        add_product(&mut next, &self.closed_loop, x);
        next
    }
}

#[inline(always)]
/// The mean of `m` and its transpose: rounding would make the cost-to-go drift apart.
fn symmetric<T: Scalar, const K: usize>(m: &SMatrix<T, K, K>) -> SMatrix<T, K, K> {
    (m + m.transpose()) * convert::<f64, T>(0.5)
}

#[inline(always)]
/// diag(`factors`) `m`
fn scaled_rows<T: Scalar, const R: usize, const C: usize>(
    m: &SMatrix<T, R, C>,
    factors: &SVector<T, R>,
) -> SMatrix<T, R, C> {
    SMatrix::from_fn(|i, j| m[(i, j)] * factors[i])
}

/// L^-1 and D of the factorisation L D L' with unit lower triangular L.
struct UnitFactor<T, const K: usize> {
    inverse: SMatrix<T, K, K>,
    pivots: SVector<T, K>,
}

impl<T: Scalar, const K: usize> UnitFactor<T, K> {
    #[inline(always)]
    /// Factorises the symmetric matrix `m`; its lower triangle is read.
    fn new(m: &SMatrix<T, K, K>) -> Result<Self, BadPivot<T>> {
        let mut l = *m;
        let mut pivots = SVector::<T, K>::zeros();
        for j in 0..K {
            let mut pivot = l[(j, j)];
            for k in 0..j {
                pivot -= l[(j, k)] * l[(j, k)] * pivots[k];
            }
            if !(pivot > T::zero() && pivot.is_finite()) {
                return Err(BadPivot(pivot));
            }
            pivots[j] = pivot;
            for i in j + 1..K {
                let mut entry = l[(i, j)];
                for k in 0..j {
                    entry -= l[(i, k)] * l[(j, k)] * pivots[k];
                }
                l[(i, j)] = entry / pivot;
            }
        }
        let mut inverse = SMatrix::<T, K, K>::identity();
        for j in 0..K {
            for i in j + 1..K {
                let mut entry = T::zero();
                for k in j..i {
                    entry -= l[(i, k)] * inverse[(k, j)];
                }
                inverse[(i, j)] = entry;
            }
        }
        Ok(Self { inverse, pivots })
    }
}
