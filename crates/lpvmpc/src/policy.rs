//! Plans as policies: an unstable plant that is rolled out in open loop leaves its plan behind, and
//! at long horizons becomes non-finite. With feedback towards the plan it stays where it was planned.

use crate::model::Scalar;
use crate::ocp::Bounds;
use crate::small_matrix::add_product;
use nalgebra::{SMatrix, SVector};

/// The input at the state `x` of a stage that is `planned` to be at (x_planned, u_planned):
/// u_planned + K (x - x_planned), moved into its bounds. K is `feedback`, `NU` x `NX`; a
/// *gain*, as of an LQR or a terminal law, has the other sign, u = -K x.
// Once in the machine code of a microcontroller, for its flash.
#[cfg_attr(target_arch = "arm", inline(never))]
#[cfg_attr(not(target_arch = "arm"), inline(always))]
pub(crate) fn input_at<T: Scalar, const NX: usize, const NU: usize>(
    x: &SVector<T, NX>,
    (x_planned, u_planned): (&SVector<T, NX>, &SVector<T, NU>),
    feedback: &SMatrix<T, NU, NX>,
    bounds: &Bounds<T, NU>,
) -> SVector<T, NU> {
    let mut u = *u_planned;
    add_product(&mut u, feedback, &(x - x_planned));
    bounds.project(&u)
}
