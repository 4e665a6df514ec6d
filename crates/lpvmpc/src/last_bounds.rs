//! The bounds of the last answer, a sample or a program later, as the first guess of what is active.
//!
//! Most of them are active again. Held by the factorisation they take no rows: with a single input, which is all that is
//! tried here, a factorisation and a pass along the horizon, however many they are. What is active besides is found as
//! ever, and the multipliers tell which of the guess were wrong. The answer is the same as from nothing, or none.

use crate::held_bounds::Verdict;
use crate::model::Scalar;
use crate::ocp::Ocp;
use crate::rows::{self, Trajectory};
use crate::solution::{ActiveRow, ActiveSet, Part, Side, Solution, Status};
use crate::solver::{Solver, Start, trajectory};
use crate::solver_settings::{SolverSettings, WarmStart};
use nalgebra::convert;

/// Fewer bounds are as well rows.
const FEWEST: usize = 3;
/// Of an earlier sample fewer than these, or no more than half of the stages, are found from nothing in as little time as two
/// guesses take, unless those before them were active again.
const FEWEST_OF_EARLIER: usize = 9;
/// All guesses together may take so many changes, and so many active bounds may be rows beside what is held.
const MOST_CHANGES: usize = 4;
/// If more bounds than these turn out wrong for each change that is left, the next guess is seldom right.
const MOST_WRONG_PER_CHANGE: usize = 2;
/// A microcontroller has no flash for what saves time where bounds change all the time, or horizons are long.
const THRIFTY: bool = cfg!(not(feature = "alloc"));
/// So many guesses, each from the answer to the one before.
const MOST_GUESSES: usize = if THRIFTY { 2 } else { 3 };
/// A bound whose multiplier is less than this part of the largest may be gone, and is found at less cost than let go.
const FADING: f64 = 1e-3;
/// So many times the rounding of a number are the rounding of a pass along the horizon.
const ROUNDINGS: f64 = 1e3;

impl<T: Scalar, const NX: usize, const NU: usize> Solver<T, NX, NU> {
    /// Solves `ocp` with the bounds of the last answer, `shift` stages earlier, held. The factors are not those of the
    /// problem itself.
    ///
    /// # Errors
    /// It has no answer, after so many changes of the active set; and with what the search for one is begun best.
    #[inline(never)]
    pub(crate) fn solve_from_last(
        &mut self,
        ocp: &Ocp<T, NX, NU>,
        settings: &SolverSettings<T>,
        shift: usize,
        solution: &mut Solution<T, NX, NU>,
    ) -> Result<(), (usize, WarmStart)> {
        let active = &mut solution.active;
        let doubted = active.doubted;
        let fewest = match THRIFTY || shift == 0 || active.lasting {
            true => FEWEST,
            false => (ocp.length() / 2 + 1).clamp(FEWEST, FEWEST_OF_EARLIER),
        };
        if !(active.holds.are_due()
            && self.has_room(ocp, solution)
            && self.hold_last(ocp, (shift, fewest), solution))
        {
            return Err((0, settings.warm_start));
        }
        if !THRIFTY && let Some(phase) = self.many_bounds.first_mut() {
            phase.begin(Some(solution));
        }
        self.begin(ocp, settings);
        self.dual.allow_at_most(MOST_CHANGES);
        let (mut spent, mut begin_with) = (0, settings.warm_start);
        let (mut guesses, mut answered) = (0, false);
        let (mut solved, mut rounded) = (false, false);
        while guesses < MOST_GUESSES {
            guesses += 1;
            let searched = self
                .factorize(ocp)
                .and_then(|()| self.roll_out(ocp, solution))
                .and_then(|()| self.search(ocp, Start::Held, solution));
            spent += self.dual.changes;
            if let Err(status) = searched {
                rounded = matches!(status, Status::NumericalFailure { .. } | Status::NotFinite);
                break;
            }
            (answered, begin_with) = (true, WarmStart::Same);
            let Solution { x, u, active, .. } = solution;
            let point = Trajectory { x, u };
            let tolerance = self.dual.tolerance;
            let verdict = self.held.release(ocp, Some(&point), active, tolerance);
            if verdict.released == 0 {
                solved = self.is_answer(ocp, &verdict, solution);
                rounded = !(THRIFTY || solved);
                break;
            }
            let most_wrong = MOST_WRONG_PER_CHANGE * self.dual.changes_left();
            if !THRIFTY && verdict.released > most_wrong {
                break;
            }
            self.dual.begin_again();
            if !self.hold_last(ocp, (0, FEWEST), solution) {
                break;
            }
        }
        self.held.release_all();
        solution.changes = spent;
        solution.status = Status::Solved;
        let holds = &mut solution.active.holds;
        if rounded || THRIFTY && !solved {
            // What grows along so many held states does so in the next samples, too.
            holds.give_up();
        } else if !THRIFTY {
            holds.learn_costly(solved);
        }
        if solved {
            if !THRIFTY && shift > 0 {
                solution.active.lasting = guesses == 1;
            }
            return Ok(());
        }
        if !THRIFTY {
            // What was found on the way is no reason to doubt less.
            solution.active.doubted = doubted;
            if !answered && let Some(phase) = self.many_bounds.first() {
                phase.restore(solution);
            }
        }
        Err((spent, begin_with))
    }

    /// Holds what was active `shift` stages earlier and is not fading, if these are so many or more; whether that is worth it.
    fn hold_last(
        &mut self,
        ocp: &Ocp<T, NX, NU>,
        (shift, fewest): (usize, usize),
        solution: &Solution<T, NX, NU>,
    ) -> bool {
        let active = &solution.active;
        if active.len() < fewest {
            return false;
        }
        self.held.release_all();
        let larger = |most: T, row: ActiveRow<T>| most.max(row.multiplier);
        let least = active.iter().fold(T::zero(), larger) * convert(FADING);
        let (mut held, mut other) = (0, 0);
        for mut row in active.iter() {
            // Soft bounds have multipliers that end, and equalities are rows as ever.
            if row.part != Part::Hard || row.bound.side == Side::Equality {
                other = usize::MAX;
                break;
            }
            let Some(stage) = row.bound.stage.checked_sub(shift) else {
                continue;
            };
            row.bound.stage = stage;
            let firm = row.multiplier > least && rows::soft_price(ocp, &row.bound).is_none();
            if firm && self.held.hold(row.bound) {
                held += 1;
            } else {
                other += 1;
            }
        }
        let worth = held >= fewest && other <= MOST_CHANGES;
        if !worth {
            self.held.release_all();
        }
        worth
    }

    /// Whether all that is active holds, and nothing else pulls at an input.
    fn is_answer(
        &self,
        ocp: &Ocp<T, NX, NU>,
        verdict: &Verdict<T>,
        solution: &Solution<T, NX, NU>,
    ) -> bool {
        let point = trajectory(solution);
        let rounding = T::default_epsilon() * convert(ROUNDINGS);
        let tolerance = self.dual.tolerance.min(rounding);
        verdict.listed
            && verdict.rest <= rounding
            && solution.active.iter().all(|row| {
                row.part == Part::Hard
                    && rows::slack(ocp, &point, &row.bound).abs()
                        <= tolerance * rows::size(ocp, &row.bound)
            })
    }
}

/// The stages of a few bounds of an earlier sample, as bits.
#[derive(Clone, Copy)]
pub(crate) struct KnownStages(u64);

impl KnownStages {
    /// Of those `shift` stages earlier; none within a sample.
    #[inline(always)]
    pub fn of_earlier<T: Scalar>(active: &ActiveSet<T>, shift: usize) -> Option<Self> {
        match active.len() < FEWEST_OF_EARLIER {
            _ if THRIFTY || shift == 0 => None,
            true => Some(Self::of(active, shift)),
            false => Some(Self(0)),
        }
    }

    /// Two stages that lie 64 apart count as the same.
    fn of<T: Scalar>(active: &ActiveSet<T>, shift: usize) -> Self {
        let stages = active.stages().filter_map(|stage| stage.checked_sub(shift));
        Self(stages.fold(0, |bits, stage| bits | 1 << (stage % 64)))
    }

    /// Whether bounds are active at these stages again; of fewer than are worth a guess, or of many, whether nothing speaks
    /// against it.
    pub fn are_lasting<T: Scalar>(self, active: &ActiveSet<T>) -> bool {
        match (self.0.count_ones() as usize) < FEWEST {
            true => active.holds.no_failure_is_left(),
            false => self.0 & Self::of(active, 0).0 == self.0,
        }
    }
}
