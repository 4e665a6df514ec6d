//! Linear models along the motion.

use super::{joined, parted, tangent, tangent_each};
use crate::embedding::{Dynamics, Tangent};
use crate::model::{LpvModel, Scalar};
use crate::number::Number;
use crate::small_matrix::product;
use nalgebra::{SMatrix, SVector, convert};

/// The linear models of a plant along its motion: A and B are the derivatives of f at the scheduling
/// (x, u), and c = f - A x - B u makes the model exact there. No factorisation is done by hand.
///
/// `NS` is the number of scheduling parameters, that of states and inputs together: for 2 states and 1
/// input, `AlongMotion::<_, 3>(plant)`. Any other number does not compile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AlongMotion<P, const NS: usize>(pub P);

impl<P, T, const NX: usize, const NU: usize, const NS: usize> LpvModel<T, NX, NU, NS>
    for AlongMotion<P, NS>
where
    T: Scalar + Number,
    P: Dynamics<NX, NU>,
{
    #[inline(always)]
    fn period(&self) -> Option<T> {
        self.0.period().map(convert)
    }

    /// (x, u).
    fn scheduling(&self, x: &SVector<T, NX>, u: &SVector<T, NU>) -> SVector<T, NS> {
        joined(x, u)
    }

    fn matrices(&self, scheduling: &SVector<T, NS>) -> (SMatrix<T, NX, NX>, SMatrix<T, NX, NU>) {
        let (x, u) = parted(scheduling);
        self.jacobian(&x, &u)
    }

    fn offset(&self, scheduling: &SVector<T, NS>) -> Option<SVector<T, NX>> {
        let (x, u) = parted(scheduling);
        let (rate, a, b) = self.tangent(&x, &u);
        Some(rate - product(&a, &x) - product(&b, &u))
    }

    fn embedded(&self, x: &SVector<T, NX>, u: &SVector<T, NU>) -> Tangent<T, NX, NU> {
        self.tangent(x, u)
    }

    fn derivative(&self, x: &SVector<T, NX>, u: &SVector<T, NU>) -> SVector<T, NX> {
        self.0.f(x, u)
    }

    fn jacobian(
        &self,
        x: &SVector<T, NX>,
        u: &SVector<T, NU>,
    ) -> (SMatrix<T, NX, NX>, SMatrix<T, NX, NU>) {
        let (_, a, b) = self.tangent(x, u);
        (a, b)
    }

    fn tangent(&self, x: &SVector<T, NX>, u: &SVector<T, NU>) -> Tangent<T, NX, NU> {
        tangent::<_, _, NX, NU, NS>(&self.0, x, u)
    }

    const TOGETHER: bool = P::TOGETHER;

    fn embedded_each<const POINTS: usize>(
        &self,
        x: &[SVector<T, NX>; POINTS],
        u: &[SVector<T, NU>; POINTS],
        tangents: &mut [Tangent<T, NX, NU>; POINTS],
    ) {
        self.tangent_each(x, u, tangents);
    }

    fn tangent_each<const POINTS: usize>(
        &self,
        x: &[SVector<T, NX>; POINTS],
        u: &[SVector<T, NU>; POINTS],
        tangents: &mut [Tangent<T, NX, NU>; POINTS],
    ) {
        tangent_each::<_, _, NX, NU, NS, POINTS>(&self.0, x, u, tangents);
    }

    fn has_offset(&self) -> bool {
        true
    }
}
