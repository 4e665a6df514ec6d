//! What a solution costs, with the price of the soft bounds that it exceeds.

use crate::model::Scalar;
use crate::ocp::{Bounds, Common, Ocp, SoftBounds};
use crate::small_matrix::product;
use crate::solution::Solution;
use crate::working_set::first;
use nalgebra::{SVector, convert};

/// The problem's cost at the solution's inputs and states (with the factor 1/2 of [`Ocp`]'s
/// stages), including the price of exceeded soft bounds.
pub fn cost<T: Scalar, const NX: usize, const NU: usize>(
    ocp: &Ocp<T, NX, NU>,
    solution: &Solution<T, NX, NU>,
) -> T {
    let half: T = convert(0.5);
    let soft_at = |common: &Common<T, NX, NU>| common.soft_x.iter().any(Option::is_some);
    let soft = !ocp.own.is_empty() || soft_at(&ocp.common);
    let mut total = T::zero();
    let mut x = &ocp.x0;
    let steps = solution.u.iter().zip(solution.x.iter());
    let stages = first(&ocp.stages, ocp.length()).iter().zip(steps);
    for (i, (stage, (u, x_next))) in stages.enumerate() {
        let common = ocp.common_at(i);
        total += (product(&common.q, x) * half + stage.linear_x).dot(x);
        total += (product(&common.s, x) + product(&common.r, u) * half + stage.linear_u).dot(u);
        if i > 0 && soft {
            total += price(&common.soft_x, x, &common.x);
        }
        total += price_of_rows(ocp, i, x, Some(u));
        x = x_next;
    }
    let end = &ocp.terminal;
    total += (end.p * x * half + end.linear_x).dot(x) + price(&end.soft_x, x, &end.x);
    total + price_of_rows(ocp, ocp.length(), x, None)
}

/// The price of the soft general rows that a stage exceeds.
#[inline(always)]
fn price_of_rows<T: Scalar, const NX: usize, const NU: usize>(
    ocp: &Ocp<T, NX, NU>,
    stage: usize,
    x: &SVector<T, NX>,
    u: Option<&SVector<T, NU>>,
) -> T {
    // Most programs have none, which is not worth a call.
    match ocp.rows_per_stage {
        0 => T::zero(),
        _ => price_of_some_rows(ocp, stage, x, u),
    }
}

#[inline(never)]
fn price_of_some_rows<T: Scalar, const NX: usize, const NU: usize>(
    ocp: &Ocp<T, NX, NU>,
    stage: usize,
    x: &SVector<T, NX>,
    u: Option<&SVector<T, NU>>,
) -> T {
    ocp.rows_of(stage).iter().fold(T::zero(), |total, row| {
        let price = row.soft.map_or(T::zero(), |penalty| {
            penalty.of(excess(row.value(x, u), row.lower, row.upper))
        });
        total + price
    })
}

/// The price of the soft bounds that `value` exceeds.
pub(crate) fn price<T: Scalar, const K: usize>(
    soft: &SoftBounds<T, K>,
    value: &SVector<T, K>,
    bounds: &Bounds<T, K>,
) -> T {
    let sides = bounds.lower.iter().zip(bounds.upper.iter());
    let mut total = T::zero();
    for ((soft, v), (lower, upper)) in soft.iter().zip(value.iter()).zip(sides) {
        if let Some(penalty) = soft {
            total += penalty.of(excess(*v, *lower, *upper));
        }
    }
    total
}

/// How far `value` is outside its bounds; zero within them.
pub(crate) fn excess<T: Scalar>(value: T, lower: T, upper: T) -> T {
    let (below, above) = (lower - value, value - upper);
    if below > T::zero() {
        below
    } else if above > T::zero() {
        above
    } else {
        T::zero()
    }
}
