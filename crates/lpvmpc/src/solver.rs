//! The quadratic program of one sample: Riccati factorisation, rollout, and, where a bound is
//! violated, the dual active-set method on the cached factor.

use crate::active_set::DualActiveSet;
use crate::cost::cost;
use crate::farkas::infeasibility_margin;
use crate::held_bounds::{HeldBounds, eliminate_held};
use crate::last_bounds::KnownStages;
use crate::list::List;
use crate::many_bounds::ManyBounds;
#[cfg(feature = "alloc")]
use crate::memory::Capacity;
use crate::memory::SolverMemory;
use crate::model::Scalar;
use crate::ocp::Ocp;
use crate::products::{are_in_vectors, in_vectors};
use crate::retries::Retries;
use crate::riccati::{CostToGo, StageFactor};
use crate::rows::Trajectory;
use crate::solution::{ActiveRow, ActiveSet, Quantity, Side, Solution, Status};
use crate::solver_settings::{SolverSettings, WarmStart, default_cap, default_tolerance};
use crate::working_set::{first, first_mut};
use nalgebra::SVector;

/// Up to one change in vain for so many known rows is few. After more of them the known rows are doubted
const FEW_WASTED: usize = 4;
/// for so many solves.
const DOUBT: u8 = 8;

/// What a search begins with.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Start {
    /// No active rows.
    Nothing,
    /// Those of the last answer, so many stages earlier.
    Last(usize),
    /// No rows beside the bounds that are held; whoever holds them judges the answer.
    Held,
}

/// The solver with its memory, for `NX` states and `NU` inputs. No answer depends on the solves
/// before, but how often many bounds are tried at once does; one solver serves any number of problems. Where a problem needs more places for active bounds than
/// there are, the answer says [`Status::WorkingSetFull`].
#[derive(Debug)]
#[cfg_attr(feature = "alloc", derive(Clone))]
pub struct Solver<T: 'static, const NX: usize, const NU: usize> {
    pub(crate) factors: List<StageFactor<T, NX, NU>>,
    pub(crate) dual: DualActiveSet<T, NU>,
    /// None but within [`Solver::search_with_held_inputs`] and [`Solver::solve_from_last`].
    pub(crate) held: HeldBounds<NU>,
    /// The phase for many bounds, if there is memory for it; no entry or one.
    pub(crate) many_bounds: List<ManyBounds<T, NX, NU>>,
    /// The longest horizon that there is memory for.
    stages: usize,
}

impl<T: Scalar, const NX: usize, const NU: usize> Solver<T, NX, NU> {
    /// A solver in this memory.
    pub fn new(memory: SolverMemory<T, NX, NU>) -> Self {
        let stages = memory.stages();
        Self {
            stages,
            factors: memory.factors,
            dual: DualActiveSet::new(memory.dual),
            held: HeldBounds::none(memory.held),
            many_bounds: memory.many_bounds,
        }
    }

    /// A solver with memory of its own.
    #[cfg(feature = "alloc")]
    pub fn allocate(capacity: Capacity) -> Self {
        Self::new(SolverMemory::allocate(capacity))
    }

    /// Solves `ocp`. `solution` is the answer and, on entry, the warm start.
    ///
    /// Always ends, after at most as many changes of the active set as `settings` say, and always
    /// leaves finite inputs within the input bounds; what they are worth is in
    /// `solution.status`.
    #[inline(never)]
    pub fn solve(
        &mut self,
        ocp: &Ocp<T, NX, NU>,
        settings: &SolverSettings<T>,
        solution: &mut Solution<T, NX, NU>,
    ) {
        let mut settings = *settings;
        let (mut spent, mut known) = (0, None);
        if NU == 1
            && let Some(shift) = shift_of_last(&settings, solution)
        {
            known = KnownStages::of_earlier(&solution.active, shift);
            (spent, settings.warm_start) =
                match self.solve_from_last(ocp, &settings, shift, solution) {
                    Ok(()) => return,
                    Err(tried) => tried,
                };
            let cap = settings.max_changes.unwrap_or(default_cap(ocp));
            settings.max_changes = Some(cap.saturating_sub(spent));
        }
        self.solve_for_factors(ocp, &settings, solution);
        solution.changes += spent;
        if cfg!(feature = "alloc")
            && let Some(known) = known
        {
            solution.active.lasting = known.are_lasting(&solution.active);
        }
    }

    /// The same for who needs the factors of the problem itself, too.
    #[inline(never)]
    pub(crate) fn solve_for_factors(
        &mut self,
        ocp: &Ocp<T, NX, NU>,
        settings: &SolverSettings<T>,
        solution: &mut Solution<T, NX, NU>,
    ) {
        let factorized = self.factorize(ocp);
        self.solve_factorized(factorized, ocp, settings, solution);
    }

    /// [`Solver::solve`] with the factor that [`Solver::factorize`] left: of all of `ocp`, only `x0`
    /// may have changed since.
    #[inline(never)]
    pub(crate) fn solve_factorized(
        &mut self,
        factorized: Result<(), Status<T>>,
        ocp: &Ocp<T, NX, NU>,
        settings: &SolverSettings<T>,
        solution: &mut Solution<T, NX, NU>,
    ) {
        self.begin(ocp, settings);
        let mut spent = 0;
        let factorized = match self.has_room(ocp, solution) {
            true => factorized,
            false => Err(Status::HorizonTooLong),
        };
        let shift = shift_of_last(settings, solution);
        if shift.is_none() {
            // Nothing is known that could be doubted.
            solution.active.doubted = 0;
            if cfg!(feature = "alloc") {
                (solution.active.trusted, solution.active.lasting) = (false, false);
            }
            solution.active.holds = Retries::default();
        }
        let in_turns = self.many_bounds.first().map(|phase| phase.in_turns);
        let outcome = factorized.and_then(|()| match in_turns {
            Some(in_turns) => in_turns(self, ocp, shift, solution, &mut spent),
            None => {
                self.roll_out(ocp, solution)?;
                self.solve_one_by_one(ocp, shift, solution, &mut spent)
            }
        });
        solution.changes = spent;
        solution.status = match outcome {
            Ok(()) => Status::Solved,
            Err(status) => {
                if !matches!(status, Status::Infeasible(_)) {
                    solution.active.clear();
                }
                fall_back(ocp, solution);
                status
            }
        };
    }

    /// Whether there is memory for the horizon of `ocp`.
    pub(crate) fn has_room(&self, ocp: &Ocp<T, NX, NU>, solution: &Solution<T, NX, NU>) -> bool {
        let room = self.stages.min(solution.u.len()).min(solution.x.len());
        ocp.horizon.max(1) <= room.min(ocp.stages.len())
    }

    /// Back to no active bounds.
    pub(crate) fn begin(&mut self, ocp: &Ocp<T, NX, NU>, settings: &SolverSettings<T>) {
        let tolerance = Some(settings.tolerance).filter(|t| *t > T::zero() && t.is_finite());
        let cap = settings.max_changes.unwrap_or(default_cap(ocp));
        self.dual
            .reset(tolerance.unwrap_or_else(default_tolerance), cap);
    }

    /// The dual method, from the trajectory without bounds; with held inputs where rounding ends it, and with another order
    /// of its changes.
    #[inline(always)]
    pub(crate) fn solve_one_by_one(
        &mut self,
        ocp: &Ocp<T, NX, NU>,
        shift: Option<usize>,
        solution: &mut Solution<T, NX, NU>,
        spent: &mut usize,
    ) -> Result<(), Status<T>> {
        let warm = shift.is_some() && !solution.active.is_empty();
        let mut start = shift.map_or(Start::Nothing, Start::Last);
        loop {
            let mut outcome = self.search(ocp, start, solution);
            *spent += self.dual.changes;
            // A microcontroller has no flash for more than one beginning from nothing.
            let last = self.dual.one_at_a_time || !(warm || cfg!(feature = "alloc"));
            if let Err(Status::Inaccurate(bound)) = outcome
                && (last || !warm)
            {
                outcome = match self.prove(ocp, &mut solution.active) {
                    Some(infeasible) => Err(infeasible),
                    None => self.search_with_held_inputs(ocp, solution, bound, spent),
                };
            }
            if last || !matches!(outcome, Err(Status::Inaccurate(_))) {
                return outcome;
            }
            // Neither the start nor the order of the changes must decide whether there is an answer.
            start = Start::Nothing;
            solution.active.clear();
            self.dual.begin_again();
            self.dual.one_at_a_time = true;
            self.roll_out(ocp, solution)?;
        }
    }

    /// The verdict that the problem is infeasible, and its `proof`, if the search ended in a conflict
    /// that is one.
    #[cold]
    #[inline(never)]
    pub(crate) fn prove(
        &self,
        ocp: &Ocp<T, NX, NU>,
        proof: &mut ActiveSet<T>,
    ) -> Option<Status<T>> {
        let verdict = if self.dual.report_conflict(proof) {
            infeasible(ocp, proof)
        } else {
            None
        };
        if verdict.is_none() {
            proof.clear();
        }
        verdict
    }

    /// The dual method, from the trajectory of the deviations as they are.
    pub(crate) fn search(
        &mut self,
        ocp: &Ocp<T, NX, NU>,
        start: Start,
        solution: &mut Solution<T, NX, NU>,
    ) -> Result<(), Status<T>> {
        if ocp.terminal.equality.is_some() {
            let x_n = terminal_state(ocp, solution);
            self.dual
                .impose_terminal_equality(ocp, &self.factors, &x_n)?;
            self.roll_out(ocp, solution)?;
        }
        let known = match start {
            Start::Last(shift) => self.warm_start(ocp, shift, solution)?,
            _ => 0,
        };

        loop {
            let trajectory = trajectory(solution);
            match self.dual.most_violated(ocp, &trajectory) {
                [Some(violated), earlier] => {
                    self.dual.satisfy(ocp, &self.factors, &violated, earlier)?;
                }
                _ if start == Start::Held => break,
                _ if self.dual.refine(ocp, &self.factors, &trajectory)? => {}
                _ => break,
            }
            self.roll_out(ocp, solution)?;
            #[cfg(feature = "alloc")]
            self.check_rounding(ocp)?;
        }
        let accepted = self.accept(ocp, known, solution);
        if cfg!(feature = "alloc") && !matches!(start, Start::Held | Start::Last(0)) {
            solution.active.trusted = self.dual.changes > solution.active.len();
        }
        accepted
    }

    /// Takes the trajectory as the answer, with its inputs moved into their bounds; hands over its cost and the active rows, and
    /// judges the `known` ones, so many, that the search began with.
    #[inline(never)]
    pub(crate) fn accept(
        &self,
        ocp: &Ocp<T, NX, NU>,
        known: usize,
        solution: &mut Solution<T, NX, NU>,
    ) -> Result<(), Status<T>> {
        // What the tolerance or rounding lets through is no input for an actuator.
        clip_inputs(ocp, solution);
        solution.cost = cost(ocp, solution);
        if !solution.cost.is_finite() {
            return Err(Status::NotFinite);
        }
        if !self.dual.report(&mut solution.active) {
            return Err(Status::WorkingSetFull);
        }
        // A row that had to go again counts twice.
        let wasted = self.dual.changes.saturating_sub(solution.active.len());
        let doubted = &mut solution.active.doubted;
        *doubted = match known > 0 && FEW_WASTED * wasted > known {
            true => DOUBT,
            false => doubted.saturating_sub(1),
        };
        Ok(())
    }

    /// The factors of the stages of the last problem.
    pub(crate) fn factors(&self) -> &[StageFactor<T, NX, NU>] {
        &self.factors
    }

    /// Backward: the factor of every stage. It does not depend on `x0`.
    pub(crate) fn factorize(&mut self, ocp: &Ocp<T, NX, NU>) -> Result<(), Status<T>> {
        let mut cost_to_go = CostToGo {
            quadratic: ocp.terminal.p,
            linear: ocp.terminal.linear_x,
        };
        let n = ocp.length();
        let stages = first(&ocp.stages, n)
            .iter()
            .zip(first_mut(&mut self.factors, n));
        for (stage, (data, factor)) in stages.enumerate().rev() {
            let weights = ocp.common_at(stage);
            match self.held.at(stage) {
                None => factor.eliminate(data, weights, &mut cost_to_go),
                Some(held) => eliminate_held(factor, (ocp, stage), held, &mut cost_to_go),
            }
            .map_err(|bad| failed_pivot(stage, bad.0))?;
        }
        Ok(())
    }

    /// Forward: the trajectory of the current normalised deviations.
    pub(crate) fn roll_out(
        &self,
        ocp: &Ocp<T, NX, NU>,
        solution: &mut Solution<T, NX, NU>,
    ) -> Result<(), Status<T>> {
        let mut x = ocp.x0;
        let n = ocp.length();
        in_vectors(
            are_in_vectors(NX),
            #[inline(always)]
            || {
                let policy = first(&self.factors, n).iter().zip(first(&self.dual.v, n));
                let places = solution.u.iter_mut().zip(solution.x.iter_mut());
                for ((stage, (factor, v)), (u, x_next)) in ocp.stages.iter().zip(policy).zip(places)
                {
                    *u = factor.policy(&x, v);
                    x = stage.next(&x, u);
                    *x_next = x;
                }
            },
        );
        // A number that is not finite anywhere spreads to the last state or its input.
        let finite = first(&solution.u, n).iter().all(is_finite) && is_finite(&x);
        if finite {
            Ok(())
        } else {
            Err(Status::NotFinite)
        }
    }

    /// Moves to the minimiser over the known rows, if there is any reason to; how many are known then, else none.
    fn warm_start(
        &mut self,
        ocp: &Ocp<T, NX, NU>,
        shift: usize,
        solution: &mut Solution<T, NX, NU>,
    ) -> Result<usize, Status<T>> {
        let before = (&solution.active, shift);
        let begun = self
            .dual
            .warm_start(ocp, &self.factors, &trajectory(solution), before)?;
        if !begun {
            return Ok(0);
        }
        self.roll_out(ocp, solution)?;
        Ok(solution.active.len())
    }
}

/// How many stages earlier the active rows of the last solution are expected, if they are to be begun with.
fn shift_of_last<T: Scalar, const NX: usize, const NU: usize>(
    settings: &SolverSettings<T>,
    last: &Solution<T, NX, NU>,
) -> Option<usize> {
    match settings.warm_start {
        // After a failure the active rows are none, or a proof.
        _ if !last.status.is_solved() => None,
        _ if last.active.is_terminal_equality() => None,
        WarmStart::Cold => None,
        WarmStart::Same => Some(0),
        WarmStart::Shifted => Some(1),
    }
}

/// The verdict that the problem is infeasible, if the rows are a proof.
pub(crate) fn infeasible<T: Scalar, const NX: usize, const NU: usize>(
    ocp: &Ocp<T, NX, NU>,
    proof: &ActiveSet<T>,
) -> Option<Status<T>> {
    if !(infeasibility_margin(ocp, proof) > T::zero()) {
        return None;
    }
    // The bounds of inputs can be met by themselves, and the others without a terminal equality as a rule: else the earliest
    // of them is the cause.
    let (mut cause, mut least) = (proof.iter().next()?.bound, usize::MAX);
    for ActiveRow { bound, .. } in proof.iter() {
        let order = match (bound.side, bound.quantity) {
            // A microcontroller has no flash for the better name.
            (Side::Equality, _) if cfg!(feature = "alloc") => 0,
            (_, Quantity::Input(_)) => usize::MAX,
            _ => bound.stage,
        };
        if order < least {
            (cause, least) = (bound, order);
        }
    }
    Some(Status::Infeasible(cause))
}

pub(crate) fn trajectory<T, const NX: usize, const NU: usize>(
    solution: &Solution<T, NX, NU>,
) -> Trajectory<'_, T, NX, NU> {
    Trajectory {
        x: &solution.x,
        u: &solution.u,
    }
}

fn terminal_state<T: Scalar, const NX: usize, const NU: usize>(
    ocp: &Ocp<T, NX, NU>,
    solution: &Solution<T, NX, NU>,
) -> SVector<T, NX> {
    let last = solution.x.get(ocp.length() - 1);
    last.copied().unwrap_or(ocp.x0)
}

fn is_finite<T: Scalar, const K: usize>(v: &SVector<T, K>) -> bool {
    v.iter().all(|entry| entry.is_finite())
}

fn failed_pivot<T: Scalar>(stage: usize, pivot: T) -> Status<T> {
    if pivot.is_finite() {
        Status::NumericalFailure { stage, pivot }
    } else {
        Status::NotFinite
    }
}

/// After a failure: the last inputs moved into their bounds, and the states they lead to.
fn fall_back<T: Scalar, const NX: usize, const NU: usize>(
    ocp: &Ocp<T, NX, NU>,
    solution: &mut Solution<T, NX, NU>,
) {
    clip_inputs(ocp, solution);
    roll_forward(ocp, solution);
    solution.cost = cost(ocp, solution);
}

/// The states that the solution's inputs lead to.
pub(crate) fn roll_forward<T: Scalar, const NX: usize, const NU: usize>(
    ocp: &Ocp<T, NX, NU>,
    solution: &mut Solution<T, NX, NU>,
) {
    let mut x = ocp.x0;
    let places = solution.u.iter().zip(solution.x.iter_mut());
    for (stage, (u, x_next)) in ocp.stages.iter().zip(places).take(ocp.length()) {
        x = stage.next(&x, u);
        *x_next = x;
    }
}

/// Moves the inputs into their bounds.
pub(crate) fn clip_inputs<T: Scalar, const NX: usize, const NU: usize>(
    ocp: &Ocp<T, NX, NU>,
    solution: &mut Solution<T, NX, NU>,
) {
    // Slices of unknown length are not unrolled, for the flash of a microcontroller.
    let length = ocp.horizon.max(1).min(solution.u.len());
    let inputs = solution.u.get_mut(..length).unwrap_or_default();
    for (i, u) in inputs.iter_mut().enumerate() {
        let bounds = &ocp.common_at(i).u;
        if !(bounds.hold_at(u) && is_finite(u)) {
            *u = bounds.project(u);
        }
    }
}
