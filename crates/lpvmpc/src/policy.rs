//! Plans as policies: an unstable plant that is rolled out in open loop leaves its plan behind, and
//! at long horizons becomes non-finite. With feedback towards the plan it stays where it was planned.

use crate::kernel::add_product;
use crate::model::Scalar;
use crate::ocp::Bounds;
use nalgebra::{SMatrix, SVector};

/// The input at the state `x` of a stage that is `planned` to be at (x_planned, u_planned):
/// u_planned + K (x - x_planned), moved into its bounds. K is `gain`, `NU` x `NX`, with the sign of
/// u = K x.
#[inline(always)]
pub(crate) fn input_at<T: Scalar, const NX: usize, const NU: usize>(
    x: &SVector<T, NX>,
    (x_planned, u_planned): (&SVector<T, NX>, &SVector<T, NU>),
    gain: &SMatrix<T, NU, NX>,
    bounds: &Bounds<T, NU>,
) -> SVector<T, NU> {
    let mut u = *u_planned;
    add_product(&mut u, gain, &(x - x_planned));
    bounds.project(&u)
}
