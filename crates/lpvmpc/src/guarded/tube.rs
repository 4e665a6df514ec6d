//! Where a plant can be that follows a plan while the rollout is wrong by its integration error.
//!
//! The deviation from the plan grows and shrinks by the policy's own closed loop, e+ = (A + B K) e + w
//! with |w_i| <= error_i, and is enclosed in ellipsoids e'S^-1 e <= 1. The sum of two of them lies in
//! (1 + 1/c) S_1 + (1 + c) S_2 for every c > 0 (Kurzhanski and Valyi, Ellipsoidal Calculus, 1997);
//! c is that of the smallest trace. Where the input may be at its bound, it may follow the feedback
//! or not: the sum of both S holds either. The matrices are those of the quadratic program.

use super::plan::Plan;
use super::{GuardedController, GuardedWorkspace};
use crate::kernel::product;
use crate::model::{LpvModel, Scalar};
use nalgebra::{SMatrix, SVector, convert};

impl<
    P,
    T,
    const NX: usize,
    const NU: usize,
    const NS: usize,
    const N: usize,
    const NA: usize,
    const NP: usize,
> GuardedController<P, T, NX, NU, NS, N, NA, NP>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
{
    /// How far the plant may be from x_1 to x_N of `plan` under the policy of the last program, and
    /// from x_N in the norm of P.
    pub(super) fn tube<const M: usize>(
        &self,
        plan: &Plan<T, NX, NU, N>,
        workspace: &GuardedWorkspace<T, NU, NA, NP, M>,
    ) -> ([SVector<T, NX>; N], T) {
        let mut drifts = [SVector::zeros(); N];
        let error = &self.settings.rollout.error;
        // The box lies in the ellipsoid through its corners.
        let parts: T = convert(NX as f64);
        let noise = SMatrix::from_diagonal(&error.component_mul(error)) * parts;
        let stages = workspace.ocp.stages.iter().skip(1);
        let factors = workspace.solver.factors().iter().skip(1);
        let places = drifts.iter_mut().zip(&plan.u);
        let mut shape = SMatrix::<T, NX, NX>::zeros();
        let steps = places.zip(stages.zip(factors));
        for ((drift, u), (stage, factor)) in steps.take(self.settings.horizon) {
            let closed = factor.closed_loop.fixed_view::<NX, NX>(0, 0).into_owned();
            let mut moved = around(&closed, &shape);
            let gain = factor.gain.fixed_columns::<NX>(0).into_owned();
            if self.may_saturate(u, &gain, &shape) {
                let open = stage.a.fixed_view::<NX, NX>(0, 0).into_owned();
                moved += around(&open, &shape);
            }
            shape = sum(&moved, &noise);
            *drift = shape.diagonal().map(|square| square.max(T::zero()).sqrt());
        }
        let square = product(&self.settings.terminal.p, &shape).trace();
        (drifts, square.max(T::zero()).sqrt())
    }

    /// Whether the feedback within the ellipsoid `shape` can push an input to its bound.
    fn may_saturate(
        &self,
        u: &SVector<T, NU>,
        gain: &SMatrix<T, NU, NX>,
        shape: &SMatrix<T, NX, NX>,
    ) -> bool {
        let reach = (gain * shape * gain.transpose()).diagonal();
        let reach = reach.map(|square| square.max(T::zero()).sqrt());
        let bounds = &self.settings.u;
        !(bounds.hold_at(&(u + reach)) && bounds.hold_at(&(u - reach)))
    }
}

/// M S M'
fn around<T: Scalar, const K: usize>(
    m: &SMatrix<T, K, K>,
    s: &SMatrix<T, K, K>,
) -> SMatrix<T, K, K> {
    product(&product(m, s), &m.transpose())
}

/// An ellipsoid around the sum of two.
fn sum<T: Scalar, const K: usize>(
    one: &SMatrix<T, K, K>,
    other: &SMatrix<T, K, K>,
) -> SMatrix<T, K, K> {
    let (first, second) = (one.trace(), other.trace());
    if !(first > T::zero()) {
        return *other;
    }
    if !(second > T::zero()) {
        return *one;
    }
    let ratio = (second / first).sqrt();
    one * (T::one() + ratio) + other * (T::one() + T::one() / ratio)
}
