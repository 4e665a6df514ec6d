//! The backward steps as pieces of work that are compiled for several kinds of vectors.

use super::{Adjustment, BadPivot, CostToGo, StageFactor};
use crate::model::Scalar;
use crate::ocp::Common;
use crate::products::Vectors;
use crate::transposed::StageBothWays;
use nalgebra::SVector;

/// A backward step.
pub(super) struct Elimination<'a, T, const NX: usize, const NU: usize> {
    pub factor: &'a mut StageFactor<T, NX, NU>,
    pub stage: StageBothWays<'a, T, NX, NU>,
    pub weights: &'a Common<T, NX, NU>,
    pub cost_to_go: &'a mut CostToGo<T, NX>,
    pub adjustment: Option<&'a dyn Adjustment<T, NX, NU>>,
}

impl<T: Scalar, const NX: usize, const NU: usize> pulp::WithSimd for Elimination<'_, T, NX, NU> {
    type Output = Result<(), BadPivot<T>>;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) -> Self::Output {
        let Self {
            factor,
            stage,
            weights,
            cost_to_go,
            adjustment,
        } = self;
        factor.eliminate_here(stage, weights, cost_to_go, adjustment, Vectors(simd))
    }
}

/// A backward step with a constant input.
pub(super) struct Passage<'a, T, const NX: usize, const NU: usize> {
    pub factor: &'a mut StageFactor<T, NX, NU>,
    pub stage: StageBothWays<'a, T, NX, NU>,
    pub weights: &'a Common<T, NX, NU>,
    pub cost_to_go: &'a mut CostToGo<T, NX>,
    pub input: &'a SVector<T, NU>,
}

impl<T: Scalar, const NX: usize, const NU: usize> pulp::WithSimd for Passage<'_, T, NX, NU> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) {
        let Self {
            factor,
            stage,
            weights,
            cost_to_go,
            input,
        } = self;
        factor.pass_here(stage, weights, cost_to_go, input, Vectors(simd));
    }
}
