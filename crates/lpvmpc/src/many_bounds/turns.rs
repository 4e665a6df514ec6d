//! The phase for many bounds and the dual method in turns.

use super::expected::Violated;
use super::last_answer::shortest_with_soft;
use super::{MOST_FACTORISATIONS, ManyBounds, SHARE};
use crate::list::List;
use crate::model::Scalar;
use crate::ocp::Ocp;
use crate::solution::{Part, Solution, Status};
use crate::solver::Solver;

/// When it has its turn.
#[derive(Clone, Copy, Debug)]
pub(super) enum Turn {
    /// Before the dual method, if there are many bounds, where the trajectory without bounds violates these.
    First(Violated),
    /// After it has come to no end in as many changes as it was given, or at all.
    Later,
}

/// What comes of it.
#[derive(Clone, Copy, Debug)]
pub(super) enum AtOnce<T> {
    /// It was not tried, and nothing has changed.
    Untried,
    /// The solution, or the proof that there is none.
    Done(Result<(), Status<T>>),
    /// Neither: the trajectory without bounds is in the solution, and the active rows are those to begin with: what is foretold,
    /// or those of the last solution at their new stages, if they are to be begun with. It has a later turn after so many
    /// changes, if any.
    InVain(Option<usize>),
}

/// The least cap with which a problem with so many `entries` of state and input has a later turn.
pub(crate) fn cap_with_later_turn(entries: usize) -> usize {
    SHARE * MOST_FACTORISATIONS * entries
}

/// Changes of the active set, out of a `cap` for all, that are kept back until a problem with so many `entries` of state
/// and input has had its later turn: all but those of the phase; none where it has no such turn, since the dual method
/// would lack them.
pub(super) fn kept_for_later_turn(cap: usize, entries: usize) -> usize {
    if cap < cap_with_later_turn(entries) {
        return 0;
    }
    cap - MOST_FACTORISATIONS * entries
}

impl<T: Scalar, const NX: usize, const NU: usize> Solver<T, NX, NU> {
    /// Solves the factorised problem, or proves that it is infeasible; counts changes of the active set. With a `shift` the
    /// active rows of the last answer are those to begin with, so many stages later.
    pub(super) fn solve_in_turns(
        &mut self,
        ocp: &Ocp<T, NX, NU>,
        shift: Option<usize>,
        solution: &mut Solution<T, NX, NU>,
        spent: &mut usize,
    ) -> Result<(), Status<T>> {
        if let Some(phase) = self.many_bounds.first_mut() {
            phase.begin(shift.map(|_| &*solution));
        }
        self.roll_out(ocp, solution)?;
        // With a terminal equality a trajectory that keeps all bounds may still be no answer.
        let free = ocp.terminal.equality.is_none();
        let violated = free.then(|| Violated::new(ocp, solution));
        if violated.is_some_and(|violated| violated.bounds == 0) {
            // Where no bound is violated, a cold cache has to fetch no machine code beyond this.
            return self.accept(ocp, 0, solution);
        }
        self.take_turns(ocp, violated, shift, solution, spent)
    }

    /// The same, from the trajectory without bounds and without a terminal equality, which is in the solution. It has
    /// `violated` these bounds; `None` where there is an equality, with which all at once have no turn.
    #[inline(never)]
    fn take_turns(
        &mut self,
        ocp: &Ocp<T, NX, NU>,
        violated: Option<Violated>,
        mut shift: Option<usize>,
        solution: &mut Solution<T, NX, NU>,
        spent: &mut usize,
    ) -> Result<(), Status<T>> {
        // Where all bounds at once were not tried, or not yet, they are when the search gets long, or rounding has ended it.
        let phase = self.many_bounds.first();
        let mut kept_back = match phase.is_some_and(|phase| phase.has_room(ocp)) {
            true => kept_for_later_turn(self.dual.changes_left(), NX + NU),
            false => 0,
        };
        // Soft bounds of the sample before are of no use over a short horizon.
        if ocp.length() < shortest_with_soft::<NU>()
            && violated.is_some_and(|violated| violated.soft)
            && solution.active.iter().any(|row| row.part != Part::Hard)
        {
            shift = shift.filter(|&shift| shift == 0);
        }
        let at_once = violated.map_or(AtOnce::Untried, |violated| {
            self.solve_at_once(ocp, shift, solution, (Turn::First(violated), spent))
        });
        match at_once {
            AtOnce::Done(outcome) => return outcome,
            AtOnce::InVain(changes) => {
                shift = Some(0);
                if let Some(changes) = changes {
                    kept_back = self.dual.changes_left().saturating_sub(changes);
                } else if *spent > 0 {
                    kept_back = 0;
                }
            }
            AtOnce::Untried => {}
        }
        loop {
            self.dual.keep_back(kept_back);
            let one_by_one = self.solve_one_by_one(ocp, shift, solution, spent);
            let long = matches!(one_by_one, Err(Status::MaxChanges));
            let ended = !(long || matches!(one_by_one, Err(Status::Inaccurate(_))));
            if kept_back == 0 || ended {
                return one_by_one;
            }
            self.dual.give_back(core::mem::take(&mut kept_back));
            self.dual.begin_again();
            shift = None;
            // Held inputs may have left factors of their own.
            self.factorize(ocp)?;
            self.roll_out(ocp, solution)?;
            let later = (Turn::Later, &mut *spent);
            match self.solve_at_once(ocp, shift, solution, later) {
                AtOnce::Done(outcome) => return outcome,
                // Of a search that was long; one that rounding has ended is not begun again.
                AtOnce::InVain(_) => shift = Some(0),
                AtOnce::Untried => {}
            }
            if !long {
                return one_by_one;
            }
        }
    }

    /// What the phase makes of the problem. In its first turn the trajectory without bounds is in the solution.
    #[inline(never)]
    fn solve_at_once(
        &mut self,
        ocp: &Ocp<T, NX, NU>,
        shift: Option<usize>,
        solution: &mut Solution<T, NX, NU>,
        turn: (Turn, &mut usize),
    ) -> AtOnce<T> {
        let mut phase = core::mem::replace(&mut self.many_bounds, List::empty());
        let outcome = phase
            .first_mut()
            .map_or(AtOnce::Untried, |phase: &mut ManyBounds<T, NX, NU>| {
                phase.solve(self, ocp, shift, solution, turn)
            });
        self.many_bounds = phase;
        outcome
    }
}
