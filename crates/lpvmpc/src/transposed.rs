//! The matrices of a stage transposed: kept where the stage is factorised again and again, else made for one backward step.

use crate::model::Scalar;
use crate::ocp::Stage;
use crate::products;
use crate::small_matrix::{
    product, sizes_of_product, transposed, transposed_sizes, transposed_times,
};
use core::ops::Deref;
use nalgebra::{SMatrix, SVector};

/// A' and B' of a stage: products with them go along columns, as vectors do.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Transposed<T, const NX: usize, const NU: usize> {
    pub a: SMatrix<T, NX, NX>,
    pub b: SMatrix<T, NU, NX>,
}

impl<T: Scalar, const NX: usize, const NU: usize> Transposed<T, NX, NU> {
    #[cfg(all(feature = "alloc", not(target_arch = "wasm32")))]
    pub fn zeros() -> Self {
        Self {
            a: SMatrix::zeros(),
            b: SMatrix::zeros(),
        }
    }

    #[inline(always)]
    pub fn of(stage: &Stage<T, NX, NU>) -> Self {
        Self {
            a: transposed(&stage.a),
            b: transposed(&stage.b),
        }
    }
}

/// A stage, and its matrices transposed where these are kept.
#[derive(Clone, Copy)]
pub(crate) struct StageBothWays<'a, T, const NX: usize, const NU: usize> {
    stage: &'a Stage<T, NX, NU>,
    transposed: Option<&'a Transposed<T, NX, NU>>,
}

impl<T, const NX: usize, const NU: usize> Deref for StageBothWays<'_, T, NX, NU> {
    type Target = Stage<T, NX, NU>;

    #[inline(always)]
    fn deref(&self) -> &Stage<T, NX, NU> {
        self.stage
    }
}

impl<'a, T: Scalar, const NX: usize, const NU: usize> StageBothWays<'a, T, NX, NU> {
    /// A stage of which nothing is kept.
    #[inline(always)]
    pub fn new(stage: &'a Stage<T, NX, NU>) -> Self {
        Self {
            stage,
            transposed: None,
        }
    }

    /// Stage `i` of a horizon, with its part of what is kept, if that is so much.
    #[inline(always)]
    pub fn with(self, all: &'a [Transposed<T, NX, NU>], i: usize) -> Self {
        let transposed = if products::are_in_vectors(NX) {
            all.get(i)
        } else {
            None
        };
        Self { transposed, ..self }
    }

    /// The stage with its matrices transposed, in `place` where they are not kept.
    #[cfg(feature = "simd")]
    #[inline(always)]
    pub fn or_transposed_in(self, place: &'a mut Option<Transposed<T, NX, NU>>) -> Self {
        let transposed = match self.transposed {
            Some(kept) => kept,
            None => place.insert(Transposed::of(self.stage)),
        };
        Self {
            transposed: Some(transposed),
            ..self
        }
    }

    /// What is kept; nothing, as the compiler knows, where columns are too short for vectors.
    #[inline(always)]
    pub fn transposed(&self) -> Option<&'a Transposed<T, NX, NU>> {
        if products::are_in_vectors(NX) {
            self.transposed
        } else {
            None
        }
    }

    /// A' v
    #[inline(always)]
    pub fn transposed_a_times(&self, v: &SVector<T, NX>) -> SVector<T, NX> {
        match self.transposed() {
            Some(kept) => product(&kept.a, v),
            None => transposed_times(&self.stage.a, v),
        }
    }

    /// B' v
    #[inline(always)]
    pub fn transposed_b_times(&self, v: &SVector<T, NX>) -> SVector<T, NU> {
        match self.transposed() {
            Some(kept) => product(&kept.b, v),
            None => transposed_times(&self.stage.b, v),
        }
    }

    /// |B'| |v|: the sizes of what adds up to B' v.
    #[inline(always)]
    pub fn transposed_b_sizes(&self, v: &SVector<T, NX>) -> SVector<T, NU> {
        match self.transposed() {
            Some(kept) => sizes_of_product(&kept.b, v),
            None => transposed_sizes(&self.stage.b, v),
        }
    }
}
