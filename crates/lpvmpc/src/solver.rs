//! The quadratic program of one sample: Riccati factorisation, rollout, and, where a bound is
//! violated, the dual active-set method on the cached factor.

use crate::active_set::DualActiveSet;
use crate::farkas::infeasibility_margin;
use crate::held_inputs::{HeldInputs, eliminate_held};
use crate::kernel::add_product;
use crate::model::Scalar;
use crate::ocp::{Bounds, Ocp, Penalty, Softness};
use crate::riccati::{CostToGo, StageFactor};
use crate::rows::Trajectory;
use crate::solution::{ActiveRow, ActiveSet, Quantity, Solution, Status};
use nalgebra::{SVector, convert};

/// Settings of the solver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolverSettings<T> {
    /// A bound may be violated by this much, relative to its own size. Default, also in place of
    /// what is no positive number: eps^(2/3) of the number type, 4e-11 for `f64` and 2e-5 for
    /// `f32`. Where bounds depend on each other
    /// so strongly that rounding decides, sqrt(eps) is let through (1.5e-8 and 3.5e-4); an
    /// input is within its bounds to the last bit all the same.
    pub tolerance: T,
    /// The search ends after this many changes of the active set. Default, `None`: ten for every
    /// state, input and general row of every stage in use, 10 n (`NX` + `NU` + `NG`).
    ///
    /// That is measured, not proved: of 2424 searches on random problems with horizons of 1 to 200 one
    /// was ended by it, and half need less than 3 % of it (`tests/it/changes.rs`).
    pub max_changes: Option<usize>,
    /// What the active set of the previous solution is used for. Default: shifted.
    pub warm_start: WarmStart,
}

/// Where the search for the active set begins. It changes the time, never the answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WarmStart {
    /// From nothing.
    Cold,
    /// From the previous active set, at the same stages.
    Same,
    /// From the previous active set, one stage earlier: the horizon has moved on.
    Shifted,
}

/// Changes of the active set for every state, input and general row of a stage, by default.
const CHANGES_PER_ROW: usize = 10;

#[inline(never)]
pub(crate) fn default_tolerance<T: Scalar>() -> T {
    T::default_epsilon().powf(convert(2.0 / 3.0))
}

impl<T: Scalar> Default for SolverSettings<T> {
    fn default() -> Self {
        Self {
            tolerance: default_tolerance(),
            max_changes: None,
            warm_start: WarmStart::Shifted,
        }
    }
}

/// The solver with its memory: `NX` states, `NU` inputs, at most `N` stages and `M`
/// simultaneously active bounds. Nothing in it outlives a solve; one solver serves any number of
/// problems.
///
/// `M = N * NU` rows fill the space of the inputs; without soft bounds more (`NX` with a terminal
/// equality) are needed only where rounding makes rows rest on each other. Where it is not enough,
/// the answer says [`Status::WorkingSetFull`].
#[derive(Clone, Debug)]
pub struct Solver<T, const NX: usize, const NU: usize, const N: usize, const M: usize> {
    factors: [StageFactor<T, NX, NU>; N],
    pub(crate) dual: DualActiveSet<T, NU, N, M>,
    /// None but within [`Solver::search_with_held_inputs`].
    pub(crate) held: HeldInputs<NU, N>,
}

impl<T: Scalar, const NX: usize, const NU: usize, const N: usize, const M: usize>
    Solver<T, NX, NU, N, M>
{
    /// A solver that has solved nothing yet.
    #[inline(always)]
    pub fn new() -> Self {
        const { assert!(N > 0, "a horizon has at least one stage") };
        Self {
            factors: [StageFactor::zeros(); N],
            dual: DualActiveSet::new(),
            held: HeldInputs::none(),
        }
    }

    /// Solves `ocp`. `solution` is the answer and, on entry, the warm start.
    ///
    /// Always ends, after at most as many changes of the active set as `settings` say, and always
    /// leaves finite inputs within the input bounds; what they are worth is in
    /// `solution.status`.
    #[inline(never)]
    pub fn solve<const NG: usize>(
        &mut self,
        ocp: &Ocp<T, NX, NU, N, NG>,
        settings: &SolverSettings<T>,
        solution: &mut Solution<T, NX, NU, N, M>,
    ) {
        let factorized = self.factorize(ocp);
        self.solve_factorized(factorized, ocp, settings, solution);
    }

    /// [`Solver::solve`] with the factor that [`Solver::factorize`] left: of all of `ocp`, only `x0`
    /// may have changed since.
    #[inline(never)]
    pub(crate) fn solve_factorized<const NG: usize>(
        &mut self,
        factorized: Result<(), Status<T>>,
        ocp: &Ocp<T, NX, NU, N, NG>,
        settings: &SolverSettings<T>,
        solution: &mut Solution<T, NX, NU, N, M>,
    ) {
        let tolerance = Some(settings.tolerance).filter(|t| *t > T::zero() && t.is_finite());
        self.dual.reset(
            tolerance.unwrap_or_else(default_tolerance),
            settings
                .max_changes
                .unwrap_or(CHANGES_PER_ROW * ocp.length() * (NX + NU + NG)),
        );
        let mut spent = 0;
        let outcome = loop {
            let warm = settings.warm_start != WarmStart::Cold && !solution.active.is_empty();
            let outcome = factorized.and_then(|()| self.search(ocp, settings, solution));
            spent += self.dual.changes;
            if !(warm && matches!(outcome, Err(Status::Inaccurate(_)))) {
                break outcome;
            }
            // A start must not decide whether there is an answer.
            solution.active.clear();
            let left = self.dual.changes_left();
            self.dual.reset(self.dual.tolerance, left);
        };
        let outcome = match outcome {
            Err(Status::Inaccurate(bound)) => match self.prove(ocp, &mut solution.active) {
                Some(infeasible) => Err(infeasible),
                None => self.search_with_held_inputs(ocp, settings, solution, bound, &mut spent),
            },
            known => known,
        };
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

    /// The verdict that the problem is infeasible, and its `proof`, if the search ended in a conflict
    /// that is one.
    #[cold]
    #[inline(never)]
    pub(crate) fn prove<const NG: usize>(
        &self,
        ocp: &Ocp<T, NX, NU, N, NG>,
        proof: &mut ActiveSet<T, M>,
    ) -> Option<Status<T>> {
        if !(self.dual.report_conflict(proof) && infeasibility_margin(ocp, proof) > T::zero()) {
            proof.clear();
            return None;
        }
        // The bounds of inputs can be met by themselves: the earliest other bound is the cause.
        let mut cause = proof.iter().next()?;
        for row in proof.iter() {
            let of_input = |row: &ActiveRow<T>| matches!(row.bound.quantity, Quantity::Input(_));
            let earlier = of_input(&cause) || row.bound.stage < cause.bound.stage;
            if !of_input(&row) && earlier {
                cause = row;
            }
        }
        Some(Status::Infeasible(cause.bound))
    }

    pub(crate) fn search<const NG: usize>(
        &mut self,
        ocp: &Ocp<T, NX, NU, N, NG>,
        settings: &SolverSettings<T>,
        solution: &mut Solution<T, NX, NU, N, M>,
    ) -> Result<(), Status<T>> {
        self.roll_out(ocp, solution)?;
        if ocp.terminal.equality.is_some() {
            let x_n = terminal_state(ocp, solution);
            self.dual
                .impose_terminal_equality(ocp, &self.factors, &x_n)?;
            self.roll_out(ocp, solution)?;
        }
        self.warm_start(ocp, settings, solution)?;

        loop {
            let trajectory = trajectory(solution);
            match self.dual.most_violated(ocp, &trajectory) {
                Some(violated) => self.dual.satisfy(ocp, &self.factors, &violated)?,
                None if self.dual.refine(ocp, &self.factors, &trajectory)? => {}
                None => break,
            }
            self.roll_out(ocp, solution)?;
        }
        // What the tolerance or rounding lets through is no input for an actuator.
        clip_inputs(ocp, solution);
        solution.cost = cost(ocp, solution);
        if !solution.cost.is_finite() {
            return Err(Status::NotFinite);
        }
        if !self.dual.report(&mut solution.active) {
            return Err(Status::WorkingSetFull);
        }
        Ok(())
    }

    /// The factors of the stages of the last problem.
    pub(crate) fn factors(&self) -> &[StageFactor<T, NX, NU>; N] {
        &self.factors
    }

    /// Backward: the factor of every stage. It does not depend on `x0`.
    pub(crate) fn factorize<const NG: usize>(
        &mut self,
        ocp: &Ocp<T, NX, NU, N, NG>,
    ) -> Result<(), Status<T>> {
        let mut cost_to_go = CostToGo {
            quadratic: ocp.terminal.p,
            linear: ocp.terminal.linear_x,
        };
        let stages = ocp.stages.iter().zip(self.factors.iter_mut());
        for (stage, (data, factor)) in stages.enumerate().take(ocp.length()).rev() {
            match self.held.of(stage) {
                None => factor.eliminate(data, &mut cost_to_go),
                Some(held) => eliminate_held(factor, data, held, &mut cost_to_go),
            }
            .map_err(|bad| failed_pivot(stage, bad.0))?;
        }
        Ok(())
    }

    /// Forward: the trajectory of the current normalised deviations.
    fn roll_out<const NG: usize>(
        &self,
        ocp: &Ocp<T, NX, NU, N, NG>,
        solution: &mut Solution<T, NX, NU, N, M>,
    ) -> Result<(), Status<T>> {
        let mut x = ocp.x0;
        let policy = self.factors.iter().zip(self.dual.v.iter());
        let places = solution.u.iter_mut().zip(solution.x.iter_mut());
        for ((factor, v), (u, x_next)) in policy.zip(places).take(ocp.length()) {
            *u = factor.policy(&x, v);
            x = factor.next(&x, v);
            *x_next = x;
        }
        // A number that is not finite anywhere spreads to the last state or its input.
        let finite = solution.u.iter().take(ocp.length()).all(is_finite) && is_finite(&x);
        if finite {
            Ok(())
        } else {
            Err(Status::NotFinite)
        }
    }

    fn warm_start<const NG: usize>(
        &mut self,
        ocp: &Ocp<T, NX, NU, N, NG>,
        settings: &SolverSettings<T>,
        solution: &mut Solution<T, NX, NU, N, M>,
    ) -> Result<(), Status<T>> {
        let shift = match settings.warm_start {
            WarmStart::Cold => return Ok(()),
            WarmStart::Same => 0,
            WarmStart::Shifted => 1,
        };
        // After a failure the active rows are none, or a proof.
        let needed = solution.status.is_solved()
            && !solution.active.is_empty()
            && self
                .dual
                .most_violated(ocp, &trajectory(solution))
                .is_some();
        if needed {
            let trajectory = trajectory(solution);
            self.dual
                .warm_start(ocp, &self.factors, &trajectory, &solution.active, shift)?;
            self.roll_out(ocp, solution)?;
        }
        Ok(())
    }
}

impl<T: Scalar, const NX: usize, const NU: usize, const N: usize, const M: usize> Default
    for Solver<T, NX, NU, N, M>
{
    fn default() -> Self {
        Self::new()
    }
}

fn trajectory<T, const NX: usize, const NU: usize, const N: usize, const M: usize>(
    solution: &Solution<T, NX, NU, N, M>,
) -> Trajectory<'_, T, NX, NU, N> {
    Trajectory {
        x: &solution.x,
        u: &solution.u,
    }
}

fn terminal_state<
    T: Scalar,
    const NX: usize,
    const NU: usize,
    const N: usize,
    const M: usize,
    const NG: usize,
>(
    ocp: &Ocp<T, NX, NU, N, NG>,
    solution: &Solution<T, NX, NU, N, M>,
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
fn fall_back<
    T: Scalar,
    const NX: usize,
    const NU: usize,
    const N: usize,
    const M: usize,
    const NG: usize,
>(
    ocp: &Ocp<T, NX, NU, N, NG>,
    solution: &mut Solution<T, NX, NU, N, M>,
) {
    clip_inputs(ocp, solution);
    let mut x = ocp.x0;
    let places = solution.u.iter().zip(solution.x.iter_mut());
    for (stage, (u, x_next)) in ocp.stages.iter().zip(places).take(ocp.length()) {
        let mut next = stage.c;
        add_product(&mut next, &stage.a, &x);
        add_product(&mut next, &stage.b, u);
        x = next;
        *x_next = x;
    }
    solution.cost = cost(ocp, solution);
}

/// Moves the inputs into their bounds.
fn clip_inputs<
    T: Scalar,
    const NX: usize,
    const NU: usize,
    const N: usize,
    const M: usize,
    const NG: usize,
>(
    ocp: &Ocp<T, NX, NU, N, NG>,
    solution: &mut Solution<T, NX, NU, N, M>,
) {
    // Slices of unknown length are not unrolled, for the flash of a microcontroller.
    let inputs = solution.u.get_mut(..ocp.length()).unwrap_or_default();
    for (u, stage) in inputs.iter_mut().zip(&ocp.stages) {
        *u = stage.u.project(u);
    }
}

/// The problem's cost at the solution's inputs and states (with the factor 1/2 of [`Ocp`]'s
/// stages), including the price of exceeded soft bounds.
pub fn cost<
    T: Scalar,
    const NX: usize,
    const NU: usize,
    const N: usize,
    const M: usize,
    const NG: usize,
>(
    ocp: &Ocp<T, NX, NU, N, NG>,
    solution: &Solution<T, NX, NU, N, M>,
) -> T {
    let half: T = convert(0.5);
    let mut total = T::zero();
    let mut x = &ocp.x0;
    let steps = solution.u.iter().zip(solution.x.iter());
    for (i, (stage, (u, x_next))) in ocp.stages.iter().zip(steps).enumerate().take(ocp.length()) {
        total += (stage.q * x * half + stage.linear_x).dot(x);
        total += (stage.s * x + stage.r * u * half + stage.linear_u).dot(u);
        if i > 0 {
            total += price(&ocp.soft_x, x, &stage.x);
        }
        if NG > 0 {
            let value = stage.row_x * x + stage.row_u * u;
            total += price(&stage.soft_rows, &value, &stage.rows);
        }
        x = x_next;
    }
    let end = &ocp.terminal;
    total += (end.p * x * half + end.linear_x).dot(x) + price(&end.soft_x, x, &end.x);
    if NG > 0 {
        total += price(&end.soft_rows, &(end.row_x * x), &end.rows);
    }
    total
}

/// The price of the soft bounds that `value` exceeds.
pub(crate) fn price<T: Scalar, const K: usize>(
    soft: &Softness<T, K>,
    value: &SVector<T, K>,
    bounds: &Bounds<T, K>,
) -> T {
    let sides = bounds.lower.iter().zip(bounds.upper.iter());
    let mut total = T::zero();
    for ((soft, v), (lower, upper)) in soft.iter().zip(value.iter()).zip(sides) {
        if let Some(Penalty { linear, quadratic }) = soft {
            let excess = excess(*v, *lower, *upper);
            total += (*linear + *quadratic * excess * convert(0.5)) * excess;
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
