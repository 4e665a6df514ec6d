//! A first phase for many inputs at their bounds: the primal-dual active-set method.
//!
//! The dual method takes one bound after the other, each at the price of a pass along the horizon and
//! of all rows before it. Here a guess of all inputs that are at a bound is held there by the
//! factorisation, and is right, or the next one follows from it at once: an input that is pulled into
//! its bound is let go, one beyond its bound is held. That is a semismooth Newton method
//! (Hintermueller, Ito and Kunisch 2002). It needs a few passes, however many inputs there are, but
//! may go round in circles. What it finds, and the bounds of states and rows, are for the searches with
//! held inputs to settle; where it finds nothing, the dual method begins as if nothing had been.

use crate::held_inputs::eliminate_held;
use crate::list::List;
use crate::model::Scalar;
use crate::ocp::Ocp;
use crate::riccati::{BadPivot, CostToGo, StageFactor};
use crate::rows;
use crate::small_matrix::{add_product, product, transposed_product};
use crate::solution::{Side, Solution, Status};
use crate::solver::{Solver, SolverSettings, WarmStart, trajectory};
use crate::working_set::{copy, first};
use nalgebra::SVector;

/// Guesses after the best one, before the searches with held inputs take over.
const PATIENCE: usize = 2;
/// Part of the changes that there may be, for the dual method has to have enough where this phase has
/// no answer: one in so many.
const SHARE: usize = 4;

/// Memory of the phase, beside the step that knows it: a solver without it has no machine code for it.
#[derive(Debug)]
#[cfg_attr(feature = "alloc", derive(Clone))]
pub(crate) struct PrimalDual<T: 'static, const NX: usize, const NU: usize> {
    /// The factors of the stages without held inputs, meanwhile.
    factors: List<StageFactor<T, NX, NU>>,
    /// The cost-to-go behind each stage.
    costs_to_go: List<CostToGo<T, NX>>,
    /// The last guess, and the best.
    guess: List<[Option<Side>; NU]>,
    best: List<[Option<Side>; NU]>,
    pub run: Run<T, NX, NU>,
}

/// Solves the problem whose trajectory without bounds is in the solution; counts changes of the active
/// set. `false`, and all as before but for the warm start, if that is for the dual method.
type Run<T, const NX: usize, const NU: usize> = fn(
    &mut PrimalDual<T, NX, NU>,
    &mut Solver<T, NX, NU>,
    &Ocp<T, NX, NU>,
    &SolverSettings<T>,
    &mut Solution<T, NX, NU>,
    &mut usize,
) -> bool;

impl<T: Scalar, const NX: usize, const NU: usize> PrimalDual<T, NX, NU> {
    pub fn new(
        factors: List<StageFactor<T, NX, NU>>,
        costs_to_go: List<CostToGo<T, NX>>,
        [guess, best]: [List<[Option<Side>; NU]>; 2],
    ) -> Self {
        Self {
            factors,
            costs_to_go,
            guess,
            best,
            run: Self::solve,
        }
    }

    fn solve(
        &mut self,
        solver: &mut Solver<T, NX, NU>,
        ocp: &Ocp<T, NX, NU>,
        settings: &SolverSettings<T>,
        solution: &mut Solution<T, NX, NU>,
        spent: &mut usize,
    ) -> bool {
        let fits = ocp.length() <= self.factors.len();
        if !fits || ocp.terminal.equality.is_some() || !inputs_are_most(ocp, solution) {
            return false;
        }
        let shift = match settings.warm_start {
            _ if !solution.status.is_solved() => None,
            WarmStart::Cold => None,
            WarmStart::Same => Some(0),
            WarmStart::Shifted => Some(1),
        };
        let known = shift.is_some_and(|shift| solver.held.hold_again(ocp, &solution.active, shift));
        if !known {
            hold_clipped(solver, ocp);
        }
        let cap = solver.dual.changes_left();
        solver.dual.reset(solver.dual.tolerance, cap / SHARE);
        core::mem::swap(&mut self.factors, &mut solver.factors);
        let solved = self.find(solver, ocp, solution, spent) && {
            let otherwise = Status::MaxChanges;
            let found = solver.exchange_held_inputs(ocp, settings, solution, otherwise, spent);
            found.is_ok()
        };
        core::mem::swap(&mut self.factors, &mut solver.factors);
        solver.held.release_all();
        if !solved {
            solution.active.clear();
            solver.dual.reset(solver.dual.tolerance, cap - *spent);
            // What it was made from was finite.
            solver.roll_out(ocp, solution).ok();
        }
        solved
    }

    /// Guesses until one is right as far as the inputs go, or the number of wrong inputs has not fallen
    /// for some passes; the factors are those of the last guess. Whether there is one.
    fn find(
        &mut self,
        solver: &mut Solver<T, NX, NU>,
        ocp: &Ocp<T, NX, NU>,
        solution: &mut Solution<T, NX, NU>,
        spent: &mut usize,
    ) -> bool {
        let mut from = ocp.length();
        let (mut fewest, mut patience) = (usize::MAX, PATIENCE);
        while self.factorize(solver, ocp, from).is_ok() {
            if patience == 0 {
                return true;
            }
            if solver.roll_out(ocp, solution).is_err() {
                return false;
            }
            copy(&mut self.guess, solver.held.sides());
            let (wrong, behind) = self.exchange(solver, ocp, solution);
            if wrong == 0 {
                return true;
            }
            // As much work as so many changes of the dual method.
            if !solver.dual.count_changes(NX + NU) {
                return false;
            }
            *spent += NX + NU;
            from = behind;
            if wrong < fewest {
                (fewest, patience) = (wrong, PATIENCE);
                core::mem::swap(&mut self.guess, &mut self.best);
            } else {
                patience -= 1;
            }
            if patience == 0 {
                solver.held.hold(&self.best);
                from = ocp.length();
            }
        }
        false
    }

    /// The factors of the stages below `from`, with the inputs held that are.
    fn factorize(
        &mut self,
        solver: &mut Solver<T, NX, NU>,
        ocp: &Ocp<T, NX, NU>,
        from: usize,
    ) -> Result<(), BadPivot<T>> {
        let above = self.costs_to_go.get(from.wrapping_sub(1)).copied();
        let mut cost_to_go = match above {
            Some(known) if from < ocp.length() => known,
            _ => CostToGo {
                quadratic: ocp.terminal.p,
                linear: ocp.terminal.linear_x,
            },
        };
        let places = solver.factors.iter_mut().zip(&mut *self.costs_to_go);
        let stages = ocp.stages.iter().zip(places).enumerate().take(from);
        for (i, (stage, (factor, place))) in stages.rev() {
            *place = cost_to_go;
            let weights = ocp.common_at(i);
            match solver.held.of(i) {
                Some(held) if *held != [None; NU] => {
                    eliminate_held(factor, stage, weights, held, &mut cost_to_go)?;
                }
                _ => factor.eliminate(stage, weights, &mut cost_to_go)?,
            }
        }
        Ok(())
    }

    /// Who is to be held from now on. Returns how many inputs that changes, and behind which
    /// stage none.
    fn exchange(
        &self,
        solver: &mut Solver<T, NX, NU>,
        ocp: &Ocp<T, NX, NU>,
        solution: &Solution<T, NX, NU>,
    ) -> (usize, usize) {
        let tolerance = solver.dual.tolerance;
        let (mut changes, mut behind) = (0, 0);
        let places = solution.u.iter().zip(&*solution.x);
        let stages = ocp.stages.iter().zip(places.zip(&*self.costs_to_go));
        for (i, (stage, ((u, next), cost_to_go))) in stages.enumerate().take(ocp.length()) {
            let weights = ocp.common_at(i);
            let pulled = || {
                let costate = product(&cost_to_go.quadratic, next) + cost_to_go.linear;
                let before = i.checked_sub(1).and_then(|before| solution.x.get(before));
                product(&weights.r, u)
                    + product(&weights.s, before.unwrap_or(&ocp.x0))
                    + stage.linear_u
                    + transposed_product(&stage.b, &costate)
            };
            let changed = solver.held.exchange(i, &weights.u, u, tolerance, pulled);
            if changed > 0 {
                changes += changed;
                behind = i + 1;
            }
        }
        (changes, behind)
    }
}

/// The first guess: the inputs that the regulator without bounds drives into them, when they are
/// bounded.
fn hold_clipped<T: Scalar, const NX: usize, const NU: usize>(
    solver: &mut Solver<T, NX, NU>,
    ocp: &Ocp<T, NX, NU>,
) {
    let at_rest = SVector::zeros();
    let mut x = ocp.x0;
    let stages = ocp.stages.iter().zip(solver.factors.iter());
    for (i, (stage, factor)) in stages.enumerate().take(ocp.length()) {
        let u = factor.policy(&x, &at_rest);
        let bounds = &ocp.common_at(i).u;
        solver
            .held
            .exchange(i, bounds, &u, T::zero(), SVector::zeros);
        let mut next = stage.c;
        add_product(&mut next, &stage.a, &x);
        add_product(&mut next, &stage.b, &bounds.project(&u));
        x = next;
    }
}

/// Whether so many inputs are beyond their bounds that a few factorisations cost less than a pass for
/// each of them, and more than states and rows: where these decide, a guess of the inputs is of no use.
fn inputs_are_most<T: Scalar, const NX: usize, const NU: usize>(
    ocp: &Ocp<T, NX, NU>,
    solution: &Solution<T, NX, NU>,
) -> bool {
    let factorisation = 4 * NX * NX * NX + 6 * NX * NX * NU;
    let pass = 4 * NX * NX + 4 * NX * NU;
    // The more inputs move a state, the more guesses it takes.
    let many = (1 + NU) * factorisation / pass;
    let mut inputs = 0;
    for (i, u) in first(&solution.u, ocp.length()).iter().enumerate() {
        let bounds = &ocp.common_at(i).u;
        if !bounds.hold_at(u) {
            let inside = bounds.project(u);
            let sides = u.iter().zip(&inside);
            inputs += sides.filter(|(u, inside)| u != inside).count();
        }
    }
    inputs >= many && {
        let mut all = 0;
        rows::violated_bounds(ocp, &trajectory(solution), &mut |_| all += 1);
        2 * inputs > all
    }
}
