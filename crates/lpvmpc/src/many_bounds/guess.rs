//! Guesses of the active bounds: those of the last answer, and inputs that the regulator saturates.

use super::side::{BoundSide, Role};
use super::weighted::{split_first_mut, split_off_mut};
use crate::model::Scalar;
use crate::ocp::Ocp;
use crate::riccati::StageFactor;
use crate::solution::{ActiveRow, ActiveSet, Part, Quantity};
use nalgebra::SVector;

/// One stage in so many is at the end of the horizon, of which the last answer knows least.
pub(super) const TAIL: usize = 8;

/// The inputs of the stages from `begin` on that the regulator without bounds drives into them from `x`, when
/// they are bounded. Of all sides there.
pub(super) fn saturated<T: Scalar, const NX: usize, const NU: usize>(
    ocp: &Ocp<T, NX, NU>,
    factors: &[StageFactor<T, NX, NU>],
    mut sides: &mut [BoundSide<T>],
    (begin, mut x): (usize, SVector<T, NX>),
) {
    let at_rest = SVector::zeros();
    let stages = ocp.stages.iter().zip(factors).enumerate();
    for (i, (stage, factor)) in stages.take(ocp.length()).skip(begin) {
        let mut u = factor.policy(&x, &at_rest);
        for side in split_first_mut(&mut sides, i) {
            if let Some(j) = side.input() {
                side.role = Role::Free;
                if side.distance_of(u[j]) < T::zero() {
                    side.role = Role::Held;
                    u[j] = side.limit;
                }
            }
        }
        x = stage.next(&x, &u);
    }
}

/// The inputs at the end of the horizon, of which the last answer knows least (of several inputs, that act together,
/// where it knows nothing): those that the regulator saturates from where that answer's states, `shift` stages
/// earlier, lead to.
pub(super) fn tail<T: Scalar, const NX: usize, const NU: usize>(
    ocp: &Ocp<T, NX, NU>,
    factors: &[StageFactor<T, NX, NU>],
    mut sides: &mut [BoundSide<T>],
    (last, shift): (&[SVector<T, NX>], usize),
) {
    let n = ocp.length();
    let length = if NU == 1 { n / TAIL } else { shift };
    let begin = n.saturating_sub(length);
    let before = (begin + shift).checked_sub(1);
    // Of the same horizon the last answer knows the end, too.
    if let Some(x) = before
        .filter(|_| shift > 0)
        .and_then(|before| last.get(before))
    {
        let end = split_off_mut(&mut sides, begin);
        saturated(ocp, factors, end, (begin, *x));
    }
}

/// Whether most of the bounds that were active are of general rows.
pub(super) fn mostly_rows<T: Scalar>(before: &ActiveSet<T>) -> bool {
    let of_row = |row: &ActiveRow<T>| matches!(row.bound.quantity, Quantity::Row(_));
    2 * before.iter().filter(of_row).count() > before.len()
}

/// The roles of the rows that were active before, `shift` stages earlier.
pub(super) fn again<T: Scalar>(sides: &mut [BoundSide<T>], before: &ActiveSet<T>, shift: usize) {
    for side in sides.iter_mut() {
        side.role = Role::Free;
        side.estimate = T::zero();
    }
    for row in before.iter() {
        let Some(stage) = row.bound.stage.checked_sub(shift) else {
            continue;
        };
        let begin = sides.partition_point(|side| side.bound.stage < stage);
        let here = sides.iter_mut().skip(begin);
        let mut here = here.take_while(|side| side.bound.stage == stage);
        let same = |side: &&mut BoundSide<T>| {
            side.bound.quantity == row.bound.quantity && side.bound.side == row.bound.side
        };
        if let Some(side) = here.find(same) {
            let exceeded = row.part == Part::Quadratic || row.exceeded;
            if exceeded && side.soft.is_some() {
                side.role = Role::Exceeded;
            } else if side.role == Role::Free {
                side.role = Role::Held;
                side.estimate = row.multiplier.min(side.price());
            }
            side.known_role = side.role;
        }
    }
}

/// The roles that are known, again, after others were tried.
pub(super) fn known<T: Scalar>(sides: &mut [BoundSide<T>]) {
    for side in sides {
        side.role = side.known_role;
    }
}

/// The roles that are nearest to right, again, after others were tried.
pub(super) fn nearest<T: Scalar>(sides: &mut [BoundSide<T>]) {
    for side in sides {
        side.role = side.nearest_role;
    }
}
