//! What the phase hands on: the answer, or the rows with which the dual method is to begin.

use super::exchange::Program;
use super::side::{BoundSide, Role};
use crate::cost::cost;
use crate::model::Scalar;
use crate::solution::{ActiveRow, ActiveSet, Part, Solution};
use crate::solver::{clip_inputs, roll_forward};
use crate::working_set::{copy, first, first_mut};

/// The answer of the last guess becomes the solution; `false` where it has no place for all active rows.
pub(super) fn report<T: Scalar, const NX: usize, const NU: usize>(
    program: &Program<'_, T, NX, NU>,
    sides: &[BoundSide<T>],
    solution: &mut Solution<T, NX, NU>,
) -> bool {
    let ocp = program.span.ocp;
    let n = ocp.length();
    let listed = list(sides, &mut solution.active);
    copy(first_mut(&mut solution.u, n), program.u);
    copy(first_mut(&mut solution.x, n), program.x);
    // As a rule nothing moves, and the states stay what they are.
    clip_inputs(ocp, solution);
    if first(&solution.u, n) != first(program.u, n) {
        roll_forward(ocp, solution);
    }
    solution.cost = cost(ocp, solution);
    listed && solution.cost.is_finite()
}

/// Lists the rows that are active in the answer.
pub(super) fn list<T: Scalar>(sides: &[BoundSide<T>], active: &mut ActiveSet<T>) -> bool {
    active.clear();
    sides.iter().all(|side| {
        let row = |part, multiplier, exceeded| ActiveRow {
            bound: side.bound,
            part,
            multiplier,
            exceeded,
        };
        match (side.role, side.soft) {
            (Role::Free, _) | (Role::Exceeded, None) => true,
            (Role::Held, soft) => {
                let part = soft.map_or(Part::Hard, |_| Part::Linear);
                active.push(row(part, side.estimate.max(T::zero()), false))
            }
            (Role::Exceeded, Some(price)) => {
                let linear =
                    price.linear <= T::zero() || active.push(row(Part::Linear, price.linear, true));
                let excess = (-side.distance).max(T::zero());
                linear
                    && (price.quadratic <= T::zero()
                        || active.push(row(Part::Quadratic, price.quadratic * excess, false)))
            }
        }
    })
}
