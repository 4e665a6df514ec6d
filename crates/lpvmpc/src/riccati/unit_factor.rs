//! The factorisation of a stage's Hessian in its inputs, without square roots.

use super::BadPivot;
use crate::model::Scalar;
use nalgebra::{SMatrix, SVector};

/// L^-1 and D^-1 of the factorisation L D L' with unit lower triangular L.
pub(super) struct UnitFactor<T, const K: usize> {
    pub inverse: SMatrix<T, K, K>,
    pub reciprocals: SVector<T, K>,
}

impl<T: Scalar, const K: usize> UnitFactor<T, K> {
    /// Factorises the symmetric matrix `m`; its lower triangle is read.
    #[inline(always)]
    pub fn new(m: &SMatrix<T, K, K>) -> Result<Self, BadPivot<T>> {
        // Below the diagonal L, above it D L'.
        let mut l = *m;
        let mut pivots = SVector::<T, K>::zeros();
        let mut reciprocals = SVector::<T, K>::zeros();
        for j in 0..K {
            let mut pivot = l[(j, j)];
            for k in 0..j {
                pivot -= l[(j, k)] * l[(j, k)] * pivots[k];
            }
            if !(pivot > T::zero() && pivot.is_finite()) {
                return Err(BadPivot(pivot));
            }
            pivots[j] = pivot;
            reciprocals[j] = T::one() / pivot;
            for i in j + 1..K {
                let mut entry = l[(i, j)];
                for k in 0..j {
                    entry -= l[(i, k)] * l[(k, j)];
                }
                l[(j, i)] = entry;
                l[(i, j)] = entry * reciprocals[j];
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
        Ok(Self {
            inverse,
            reciprocals,
        })
    }
}
