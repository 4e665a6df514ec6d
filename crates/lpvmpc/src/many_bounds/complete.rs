//! What a guess that is nearly right is missing, by the dual method.
//!
//! Each exchange of a guess takes a factorisation, and where a bound that is taken in makes the trajectory violate the next
//! one, such as the same speed limit two stages later, one exchange follows the other. The dual method finds all of them on
//! the guess's own factors, a pass along the horizon for each.

use super::exchange::Program;
use super::newton;
use super::side::{BoundSide, Role};
use crate::model::Scalar;
use crate::rows::{self, Candidate, Trajectory};
use crate::solution::Part;

/// Holds, of the sides that are free in the guess, those that its trajectory needs: with them it violates none by more than the
/// `violation` that counts as none. What is held stays, for whatever seems wrong with it may come from what is missing.
/// Where that takes more changes than a factorisation is worth, or cannot be done, no role changes: `false`.
#[inline(never)]
pub(super) fn complete<T: Scalar, const NX: usize, const NU: usize>(
    program: &mut Program<'_, T, NX, NU>,
    sides: &mut [BoundSide<T>],
    violation: T,
) -> bool {
    let span = program.span;
    // The rows of the dual method begin at the first stage.
    if span.begin > 0 {
        return false;
    }
    program.dual.begin_again();
    let mut complete = false;
    for _ in 0..NX + NU {
        let Some(candidate) = most_violated(program, sides, violation) else {
            complete = true;
            break;
        };
        let bound = candidate.bound;
        let taken_in = program
            .dual
            .satisfy(span.ocp, program.factors, &candidate, None);
        let newest = program.dual.working.rows().last();
        if taken_in.is_err() || newest.is_none_or(|row| row.active.bound != bound) {
            break;
        }
        let v = &program.dual.v;
        newton::roll_out(&span, program.factors, v, (program.u, program.x));
        let trajectory = Trajectory {
            x: program.x,
            u: program.u,
        };
        newton::measure(&span, sides, &trajectory);
    }
    if complete {
        for side in sides.iter_mut() {
            side.role = side.last_role;
            if side.role == Role::Free {
                let mut rows = program.dual.working.rows().iter();
                let row = rows.find(|row| row.active.bound == side.bound);
                (side.role, side.estimate) = match row {
                    Some(row) => (Role::Held, row.active.multiplier),
                    None => (Role::Free, T::zero()),
                };
            }
        }
    }
    program.dual.begin_again();
    complete
}

/// Of the sides that are free in the guess the one that is violated most beside its size.
fn most_violated<T: Scalar, const NX: usize, const NU: usize>(
    program: &Program<'_, T, NX, NU>,
    sides: &[BoundSide<T>],
    violation: T,
) -> Option<Candidate<T>> {
    let mut least = -violation;
    let mut worst = None;
    for side in sides.iter().filter(|side| side.last_role == Role::Free) {
        let distance = side.distance / side.size;
        if distance < least {
            least = distance;
            worst = Some(side);
        }
    }
    let side = worst?;
    Some(Candidate {
        bound: side.bound,
        part: Part::Hard,
        soft: None,
        slack: side.distance,
        limits: rows::limits(program.span.ocp, &side.bound),
        rank: -least,
    })
}
