//! What a guess that is nearly right is missing, by the dual method.
//!
//! Each exchange of a guess takes a factorisation, and where a bound that is taken in makes the trajectory violate the next
//! one, such as the same speed limit two stages later, one exchange follows the other. The dual method finds all of them on
//! the guess's own factors, a pass along the horizon for each.

use super::exchange::{Program, measure, rounding};
use super::newton;
use super::side::{BoundSide, Role};
use crate::model::Scalar;
use crate::rows::{self, Candidate};
use crate::solution::Part;

/// Holds, of the sides that are free in the guess, those that its trajectory needs: with them it violates none by more than the
/// `violation` that counts as none. What is held stays, for whatever seems wrong with it may come from what is missing.
/// Where that takes more changes than a factorisation is worth, or cannot be done, no role changes, and the trajectory is that of
/// the guess's policies: `false`.
#[inline(never)]
pub(super) fn complete<T: Scalar, const NX: usize, const NU: usize>(
    program: &mut Program<'_, T, NX, NU>,
    sides: &mut [BoundSide<T>],
    violation: T,
) -> bool {
    // The rows of the dual method begin at the first stage.
    if program.span.begin > 0 {
        return false;
    }
    let left = program.most_spent.saturating_sub(program.spent.get());
    let tolerance = program.dual.tolerance;
    program.dual.reset(tolerance, left.min(NX + NU));
    let complete = take_in_violated(program, sides, violation);
    program
        .spent
        .set(program.spent.get() + program.dual.changes);
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
    program.dual.reset(tolerance, 0);
    if !complete {
        roll_out(program, sides);
    }
    complete
}

/// Takes in one side after the other that is free in the guess and violated; whether none is left, before the changes run out.
fn take_in_violated<T: Scalar, const NX: usize, const NU: usize>(
    program: &mut Program<'_, T, NX, NU>,
    sides: &mut [BoundSide<T>],
    violation: T,
) -> bool {
    while let Some(candidate) = most_violated(program, sides, violation) {
        let taken_in = program
            .dual
            .satisfy(program.span.ocp, program.factors, &candidate, None);
        let newest = program.dual.working.rows().last();
        if taken_in.is_err() || newest.is_none_or(|row| row.active.bound != candidate.bound) {
            return false;
        }
        roll_out(program, sides);
    }
    true
}

/// The trajectory with the deviations of the dual method, and the distances of the sides on it.
fn roll_out<T: Scalar, const NX: usize, const NU: usize>(
    program: &mut Program<'_, T, NX, NU>,
    sides: &mut [BoundSide<T>],
) {
    let Program {
        span,
        dual,
        factors,
        u,
        x,
        ..
    } = program;
    newton::roll_out(span, factors, &dual.v, (u, x));
    measure(program, sides, rounding());
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

#[cfg(all(test, feature = "alloc"))]
mod tests {
    use super::*;
    use crate::many_bounds::fixture::{self, Fixture};
    use crate::many_bounds::roles::reassign;
    use crate::many_bounds::span::Span;
    use crate::memory::Capacity;
    use crate::ocp::Ocp;
    use crate::solution::Solution;
    use crate::solver::Solver;
    use crate::solver_settings::SolverSettings;
    use alloc::vec::Vec;
    use lpvmpc_testkit::rng::Rng;
    use nalgebra::{SMatrix, SVector};

    const NX: usize = 4;
    const NU: usize = 2;
    const N: usize = 12;
    const ROOM: Capacity = Capacity {
        stages: N,
        rows: N * NU,
        active: N * NU,
        own_stages: 0,
        general_rows: 0,
        second_plan: false,
    };

    /// A stable plant with limits of its inputs and of two states, which its trajectory without them exceeds.
    fn problem(random: &mut Rng) -> Ocp<f64, NX, NU> {
        let mut ocp = Ocp::<f64, NX, NU>::allocate(N);
        let a = random.matrix::<NX, NX>();
        for stage in ocp.stages.iter_mut() {
            stage.a = a * (0.9 / a.norm());
            stage.b = random.matrix();
            stage.linear_x = SVector::from_fn(|_, _| random.uniform(-3.0, 3.0));
        }
        (ocp.common.q, ocp.common.r) = (SMatrix::identity(), SMatrix::identity());
        ocp.terminal.p = SMatrix::identity();
        ocp.x0 = SVector::from_fn(|_, _| random.uniform(-1.0, 1.0));
        ocp.common.u.lower.fill(-1.2);
        ocp.common.u.upper.fill(1.2);
        for j in 0..2 {
            (ocp.common.x.lower[j], ocp.common.x.upper[j]) = (-1.0, 1.0);
        }
        ocp
    }

    /// A guess that holds every second of the bounds that are active at the optimum misses the others: the dual method finds
    /// them with their multipliers, as the solver, by itself, does. Where there are more than it may take, all stays.
    #[test]
    fn what_a_guess_misses_is_found() {
        let (mut found, mut too_many) = (0, 0);
        for seed in 0..200 {
            let ocp = problem(&mut Rng::new(seed));
            let mut expected = Solution::allocate(ROOM);
            Solver::allocate(ROOM).solve(&ocp, &SolverSettings::default(), &mut expected);
            if !expected.status.is_solved() {
                continue;
            }
            let active: Vec<_> = expected.active.iter().collect();
            for known in [2, usize::MAX] {
                let mut sides = fixture::sides(&ocp);
                for (k, row) in active.iter().enumerate() {
                    let mut same = sides.iter_mut().filter(|side| side.bound == row.bound);
                    let side = same.next().unwrap();
                    if (k + 1).is_multiple_of(known) {
                        (side.role, side.base) = (Role::Held, row.multiplier);
                        side.weight = if side.input().is_none() { 1e6 } else { 0.0 };
                    }
                }
                let mut fixture = Fixture::new(ROOM);
                let span = Span::whole(&ocp, &[]);
                let mut program = fixture.program(span);
                newton::factorize(&span, &sides, program.factors).unwrap();
                roll_out(&mut program, &mut sides);
                reassign(&mut sides, 1e-9, f64::INFINITY);
                let roles =
                    |sides: &[BoundSide<f64>]| sides.iter().map(|s| s.role).collect::<Vec<_>>();
                let before = (roles(&sides), program.u.to_vec(), program.x.to_vec());
                if !complete(&mut program, &mut sides, 1e-9) {
                    let after = (roles(&sides), program.u.to_vec(), program.x.to_vec());
                    assert_eq!(after, before, "{seed}");
                    too_many += 1;
                    continue;
                }
                assert!(program.spent.get() <= NX + NU);
                let held = || sides.iter().filter(|side| side.role == Role::Held);
                assert_eq!(held().count(), active.len(), "{seed}");
                for side in held() {
                    let row = active.iter().find(|row| row.bound == side.bound).unwrap();
                    if side.last_role == Role::Free {
                        let error = (side.estimate - row.multiplier).abs();
                        assert!(error < 1e-7, "{seed}: {error:e}");
                        found += 1;
                    }
                }
            }
        }
        assert!(found > 200 && too_many > 20, "{found}, {too_many}");
    }
}
