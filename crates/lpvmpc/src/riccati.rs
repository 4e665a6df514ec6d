//! The Riccati kernel: one backward step of the linear-quadratic problem, and the vector
//! recursions that reuse its factor.
//!
//! With the cost-to-go x'Px/2 + p'x behind a stage, the stage's minimisation over u gives
//! u = K x + k. Written with the Cholesky factor R + B'PB = L L' and the normalised deviation
//! v = L'(u - K x - k), the whole cost becomes `constant + sum |v_i|^2 / 2`: the horizon's
//! Hessian is the identity, and a bound is a plain linear row in v.

use crate::model::Scalar;
use crate::ocp::{Common, Stage};
use crate::small_matrix::{add_product, plus_product, product, symmetric_sum, transposed_product};
use nalgebra::{SMatrix, SVector};

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

/// What a stage's minimisation leaves behind: the policy u = K x + k + L^-T v and, once
/// [`close_loop`](Self::close_loop) has been called, the dynamics under it,
/// x+ = (A + BK) x + B L^-T v + (c + B k).
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
    /// one in front of it, and leaves the stage's policy in `self`.
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

        // H u = -(G x + g) is the condition for the stage's minimum.
        let b_t = b.transpose();
        let p_b = product(quadratic, b);
        let hessian = plus_product(&weights.r, &b_t, &p_b);
        let UnitFactor { inverse, pivots } = UnitFactor::new(&hessian)?;
        let reciprocals = pivots.map(|pivot| T::one() / pivot);

        let a_t = a.transpose();
        let p_a = product(quadratic, a);
        let p_next = plus_product(linear, quadratic, c);
        // P is symmetric, so G' = S' + A'P B.
        let g_x_t = plus_product(&weights.s.transpose(), &a_t, &p_b);
        let g = plus_product(&stage.linear_u, &b_t, &p_next);

        // (L^-1 G)' and -(D^-1 L^-1 G)', whose columns are as long as a state.
        let l_g_x_t = times_transposed_lower(&g_x_t, &inverse);
        let scaled_g_x_t = scaled_columns(&l_g_x_t, &-reciprocals);
        let scaled_g = -scaled_rows(&product(&inverse, &g), &reciprocals);
        self.feedback = times_lower(&scaled_g_x_t, &inverse).transpose();
        self.feedforward = transposed_product(&inverse, &scaled_g);

        // A'P(A + BK) + Q + S'K, and the same for the linear part.
        let scaled_g_x = scaled_g_x_t.transpose();
        symmetric_sum(quadratic, &weights.q, (&a_t, &p_a), (&l_g_x_t, &scaled_g_x));
        let front = plus_product(&stage.linear_x, &a_t, &p_next);
        *linear = plus_product(&front, &l_g_x_t, &scaled_g);

        self.inverse_factor = scaled_rows(&inverse, &reciprocals.map(|d| d.sqrt()));
        Ok(())
    }

    /// Leaves the dynamics under the policy that [`eliminate`](Self::eliminate) has found for `stage` in
    /// `self`. Only rows of bounds need them, and with many states they are a good part of the work.
    #[inline(never)]
    pub fn close_loop(&mut self, stage: &Stage<T, NX, NU>) {
        self.closed_loop = plus_product(&stage.a, &stage.b, &self.feedback);
        self.input = times_transposed_lower(&stage.b, &self.inverse_factor);
        self.drift = plus_product(&stage.c, &stage.b, &self.feedforward);
    }

    /// The next state under the policy, by the closed loop.
    #[inline(always)]
    pub fn next(&self, x: &SVector<T, NX>, v: &SVector<T, NU>) -> SVector<T, NX> {
        let mut next = self.drift;
        add_product(&mut next, &self.input, v);
        add_product(&mut next, &self.closed_loop, x);
        next
    }

    /// The input at the state `x` with the normalised deviation `v`.
    #[inline(always)]
    pub fn policy(&self, x: &SVector<T, NX>, v: &SVector<T, NU>) -> SVector<T, NU> {
        let mut u = self.feedforward;
        add_product(&mut u, &self.feedback, x);
        u += transposed_product(&self.inverse_factor, v);
        u
    }
}

/// `m` L' with the lower triangular matrix `l`.
#[inline(always)]
fn times_transposed_lower<T: Scalar, const R: usize, const K: usize>(
    m: &SMatrix<T, R, K>,
    l: &SMatrix<T, K, K>,
) -> SMatrix<T, R, K> {
    let mut out = SMatrix::<T, R, K>::zeros();
    for (i, out) in out.data.0.iter_mut().enumerate() {
        let mut column = m.data.0[i].map(|entry| entry * l[(i, i)]);
        for k in 0..i {
            add_scaled(&mut column, &m.data.0[k], l[(i, k)]);
        }
        *out = column;
    }
    out
}

/// `m` L with the lower triangular matrix `l`.
#[inline(always)]
fn times_lower<T: Scalar, const R: usize, const K: usize>(
    m: &SMatrix<T, R, K>,
    l: &SMatrix<T, K, K>,
) -> SMatrix<T, R, K> {
    let mut out = SMatrix::<T, R, K>::zeros();
    for (j, out) in out.data.0.iter_mut().enumerate() {
        let mut column = m.data.0[j].map(|entry| entry * l[(j, j)]);
        for k in j + 1..K {
            add_scaled(&mut column, &m.data.0[k], l[(k, j)]);
        }
        *out = column;
    }
    out
}

/// sum += `column` factor
#[inline(always)]
fn add_scaled<T: Scalar, const R: usize>(sum: &mut [T; R], column: &[T; R], factor: T) {
    for (sum, entry) in sum.iter_mut().zip(column) {
        *sum += *entry * factor;
    }
}

/// `m` diag(`factors`)
#[inline(always)]
fn scaled_columns<T: Scalar, const R: usize, const C: usize>(
    m: &SMatrix<T, R, C>,
    factors: &SVector<T, C>,
) -> SMatrix<T, R, C> {
    let mut out = *m;
    for (column, factor) in out.data.0.iter_mut().zip(&factors.data.0[0]) {
        for entry in column {
            *entry *= *factor;
        }
    }
    out
}

/// diag(`factors`) `m`
#[inline(always)]
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
