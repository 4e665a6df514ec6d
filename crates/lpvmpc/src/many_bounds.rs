//! A first phase for many active bounds, of any kind.
//!
//! The dual method takes one bound after the other, each at the price of a pass along the horizon and of
//! all rows before it. Here all of them are guessed at once. A guess comes from the last sample, or from an
//! interior-point method that goes on until it can be told which bounds will be active. The program in
//! which these hold says which of them should not, and which are missing; that takes a few factorisations,
//! however many bounds there are. Where it finds nothing the dual method begins as it would have without it, or,
//! where rounding has ended it, with what it foretells.
//! Where few bounds are expected, or it cannot be told, the dual method begins; the interior-point method has a later turn
//! when the changes that the dual method is given for it have not led to the end: many bounds are active after all, or few
//! contradict each other.

mod answer;
mod complete;
mod exchange;
mod expected;
#[cfg(all(test, feature = "alloc"))]
mod fixture;
mod guess;
mod interior_point;
mod last_answer;
mod memory;
mod newton;
mod residual;
mod roles;
mod search;
mod side;
mod span;
mod start;
mod turns;
mod weighted;

pub use memory::ManyBoundsArrays;
pub(crate) use turns::cap_with_later_turn;

use crate::list::List;
use crate::model::Scalar;
use crate::ocp::Ocp;
use crate::retries::Retries;
use crate::riccati::StageFactor;
use crate::solution::{Solution, Status};
use crate::solver::{Solver, trajectory};
use crate::transposed::Transposed;
use crate::working_set::{copy, first_mut};
use answer::{list, report};
use core::cell::Cell;
use exchange::{Patience, Program, Tolerances, exchange};
use expected::{Expected, FEWEST_REPEATED, Violated};
use interior_point::{AllUnknowns, BoundUnknowns};
use last_answer::{Kind, LastAnswer};
use nalgebra::SVector;
use search::search;
use side::{BoundSide, Role};
use span::Span;
use turns::{AtOnce, Turn};

/// So many factorisations for each guess of the interior-point method that is tried.
const TRIAL: usize = 5;
/// Factorisations, each as much work as a change of the active set for every state and input.
const MOST_FACTORISATIONS: usize = 24;
/// Where many more bounds are expected than these are for, one for so many, since the dual method would need longer
/// than in proportion,
const BOUNDS: usize = 2;
/// up to so many; and so many where bounds are soft, of which any number can be active, whatever is expected.
const MOST_FOR_MANY: usize = 60;
/// So many stages for each of them that there may be at least: over a long horizon more bounds are active than the trajectory
/// without bounds violates, and a change takes longer beside so many rows.
const STAGES: usize = 16;
/// Part of the changes that there may be, for the dual method has to have enough where this phase has
/// no answer: one in so many.
const SHARE: usize = 4;

/// Memory of the phase, beside the step that knows it: a solver without it has no machine code for it.
#[derive(Debug)]
#[cfg_attr(feature = "alloc", derive(Clone))]
pub(crate) struct ManyBounds<T: 'static, const NX: usize, const NU: usize> {
    /// Where a Newton step is kept while a guess is tried, and where the guess is.
    places: [ManyBoundsPlace<T, NX, NU>; 2],
    sides: List<BoundSide<T>>,
    unknowns: List<BoundUnknowns<T>>,
    /// A' and B' of the stages, where products are in vectors.
    transposed: List<Transposed<T, NX, NU>>,
    retries: AllRetries,
    /// Whether its turn in this solve was put off.
    put_off: bool,
    /// The solver with it.
    pub in_turns: InTurns<T, NX, NU>,
}

/// What has come to nothing in the solves before.
#[derive(Clone, Copy, Debug, Default)]
struct AllRetries {
    /// The last answer's bounds, once more.
    repeats: Retries,
    /// The same, without a solution of the end of the horizon by itself.
    without_end: Retries,
    /// The inputs that the regulator saturates.
    saturations: Retries,
    /// The phase as a whole.
    turns: Retries,
}

/// With so many states and inputs a factorisation takes many times as long as a row of the dual method: between 8x2, where that
/// is not so yet, and 12x4.
const LARGE: usize = 12;

const fn is_large<const NX: usize, const NU: usize>() -> bool {
    NX + NU >= LARGE
}

/// Places for the factors of the problem with the sides' costs, and for a trajectory.
#[derive(Debug)]
#[cfg_attr(feature = "alloc", derive(Clone))]
pub(crate) struct ManyBoundsPlace<T: 'static, const NX: usize, const NU: usize> {
    pub factors: List<StageFactor<T, NX, NU>>,
    pub u: List<SVector<T, NU>>,
    pub x: List<SVector<T, NX>>,
}

impl<T, const NX: usize, const NU: usize> ManyBoundsPlace<T, NX, NU> {
    pub fn empty() -> Self {
        Self {
            factors: List::empty(),
            u: List::empty(),
            x: List::empty(),
        }
    }

    /// The longest horizon that there is room for.
    fn stages(&self) -> usize {
        self.factors.len().min(self.u.len()).min(self.x.len())
    }
}

/// Solves the factorised problem, or proves that it is infeasible; counts changes of the active set.
type InTurns<T, const NX: usize, const NU: usize> = fn(
    &mut Solver<T, NX, NU>,
    &Ocp<T, NX, NU>,
    Option<usize>,
    &mut Solution<T, NX, NU>,
    &mut usize,
) -> Result<(), Status<T>>;

impl<T: Scalar, const NX: usize, const NU: usize> ManyBounds<T, NX, NU> {
    pub fn new(
        places: [ManyBoundsPlace<T, NX, NU>; 2],
        sides: List<BoundSide<T>>,
        unknowns: List<BoundUnknowns<T>>,
        transposed: List<Transposed<T, NX, NU>>,
    ) -> Self {
        Self {
            places,
            sides,
            unknowns,
            transposed,
            retries: AllRetries::default(),
            put_off: false,
            in_turns: Solver::solve_in_turns,
        }
    }

    /// Whether it can have a turn: there is no terminal equality, and there are places for all stages.
    pub fn has_room(&self, ocp: &Ocp<T, NX, NU>) -> bool {
        let fits = |place: &ManyBoundsPlace<T, NX, NU>| ocp.length() <= place.stages();
        ocp.terminal.equality.is_none() && self.places.iter().all(fits)
    }

    /// Takes down what a solve overwrites: the states of the last answer, if its bounds may be tried again, as long as nothing
    /// else needs the place. Without an answer to go on from, nothing is known of the solves before.
    pub fn begin(&mut self, last: Option<&Solution<T, NX, NU>>) {
        match last {
            None => self.retries = AllRetries::default(),
            Some(last) if last.active.len() < FEWEST_REPEATED => {}
            Some(last) => {
                let [place, _] = &mut self.places;
                copy(&mut place.x, &last.x);
            }
        }
    }

    /// Puts back what was taken down, after a guess in vain.
    pub fn restore(&self, solution: &mut Solution<T, NX, NU>) {
        if solution.active.len() >= FEWEST_REPEATED {
            let [place, _] = &self.places;
            copy(&mut solution.x, &place.x);
        }
    }

    /// Solves the problem, or proves that it is infeasible; counts changes of the active set. A turn begins with the
    /// trajectory without bounds in the solution; where the active rows of the last one are to be begun with, they are so many
    /// stages later.
    fn solve(
        &mut self,
        solver: &mut Solver<T, NX, NU>,
        ocp: &Ocp<T, NX, NU>,
        shift: Option<usize>,
        solution: &mut Solution<T, NX, NU>,
        (turn, spent): (Turn, &mut usize),
    ) -> AtOnce<T> {
        let n = ocp.length();
        if !self.has_room(ocp) {
            return AtOnce::Untried;
        }
        let was_put_off = core::mem::take(&mut self.put_off);
        let (later, violated) = match turn {
            Turn::First(violated) => (false, violated),
            Turn::Later => (true, Violated::new(ocp, solution)),
        };
        let known = shift.map_or(0, |_| solution.active.len());
        let mut expected = Expected::new(ocp, &violated, &solution.active, known);
        if later || solver.dual.changes_left() < cap_with_later_turn(NX + NU) {
            expected.changes_first = None;
        }
        if later {
            (expected.many, expected.saturated) = (true, false);
        } else if !expected.is_due(&mut self.retries) {
            return AtOnce::Untried;
        }
        let Some(count) = side::collect(ocp, &mut self.sides) else {
            return AtOnce::Untried;
        };
        let sides = first_mut(&mut self.sides, count);
        for (transposed, stage) in self.transposed.iter_mut().zip(ocp.stages.iter()).take(n) {
            *transposed = Transposed::of(stage);
        }
        let whole = Span::whole(ocp, &self.transposed);
        newton::measure(&whole, sides, &trajectory(solution));
        let tolerances = Tolerances::new(ocp, &trajectory(solution), solver.dual.tolerance);
        let least = match side::any_soft(sides) {
            true => MOST_FOR_MANY,
            false => MOST_FACTORISATIONS,
        };
        let spent = Cell::from_mut(spent);
        let (left, before) = (solver.dual.changes_left(), spent.get());
        let (factorisations, most) = match turn {
            Turn::First(_) => {
                let many = (expected.bounds / BOUNDS).max(n / STAGES);
                (many.clamp(least, MOST_FOR_MANY), left / SHARE)
            }
            Turn::Later => (least, left - left / SHARE),
        };
        let trials = factorisations.div_ceil(TRIAL);
        let cap = before + (factorisations * (NX + NU)).min(most);
        let mut factorised = 0;
        let mut count = |stages: usize| {
            let changes = |stages: usize| ((NX + NU) * stages).div_ceil(n);
            let with_these = spent.get() + changes(factorised + stages) - changes(factorised);
            let allowed = with_these <= cap;
            if allowed {
                factorised += stages;
                spent.set(with_these);
            }
            allowed
        };
        let [place, spare] = &mut self.places;
        let mut program = Program {
            span: whole,
            dual: &mut solver.dual,
            spent,
            most_spent: before + left,
            factors: &mut place.factors,
            u: &mut place.u,
            x: &mut place.x,
            spare: (&mut spare.factors, &mut spare.u, &mut spare.x),
            unknowns: AllUnknowns::new(&mut self.unknowns),
        };
        let mut found = false;
        let known_at = shift.filter(|_| known > 0);
        let repeated =
            known_at.filter(|_| expected.worth_repeating && self.retries.repeats.are_due());
        if let Some(shift) = repeated {
            guess::again(sides, &solution.active, shift);
            let last = LastAnswer {
                kind: Kind::new::<T, NU>(sides, expected.rows),
                shift,
                trials,
            };
            let found_by = (&*solver.factors, &mut solution.active);
            let without_end = &mut self.retries.without_end;
            found = last.repeat(
                &mut program,
                sides,
                &tolerances,
                found_by,
                without_end,
                &mut count,
            );
            match is_large::<NX, NU>() {
                true => self.retries.repeats.learn_costly(found),
                false => self.retries.repeats.learn(found),
            }
        }
        if !found && expected.saturated {
            sides.iter_mut().for_each(|side| side.role = Role::Free);
            guess::saturated(ocp, &solver.factors, sides, (0, ocp.x0));
            found = exchange(&mut program, sides, &tolerances, Patience::FAR, || count(n));
            self.retries.saturations.learn(found);
        }
        if !found
            && repeated.is_none()
            && let Some(shift) = known_at
        {
            guess::again(sides, &solution.active, shift);
        }
        let guessed = spent.get();
        let outcome = if found {
            Some(Ok(()))
        } else if !expected.search_is_due() {
            None
        } else {
            newton::measure(&whole, sides, &trajectory(solution));
            let proof = &mut solution.active;
            search(&mut program, sides, &tolerances, trials, proof, || count(n))
        };
        let outcome = match outcome {
            Some(Ok(())) => report(&program, sides, solution).then_some(Ok(())),
            other => other,
        };
        self.put_off = outcome.is_none() && expected.many && expected.changes_first.is_some();
        let learns = match turn {
            Turn::First(_) => !(expected.saturated || self.put_off),
            Turn::Later => was_put_off,
        };
        if learns {
            let most = expected.worth::<NU>(side::any_soft(sides));
            self.retries
                .turns
                .learn(outcome.is_some() && spent.get() - guessed <= most);
        }
        solver.dual.v.fill(SVector::zeros());
        if let Some(outcome) = outcome {
            return AtOnce::Done(outcome);
        }
        let left = left.saturating_sub(spent.get() - before);
        solver.dual.reset(solver.dual.tolerance, left);
        // What it was made from was finite.
        solver.roll_out(ocp, solution).ok();
        guess::known(sides);
        list(sides, &mut solution.active);
        AtOnce::InVain(expected.changes_first.filter(|_| self.put_off))
    }
}
