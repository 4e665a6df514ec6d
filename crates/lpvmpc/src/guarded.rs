//! The loop that keeps its promise: LPV MPC with an artificial set point and a terminal set, in
//! which no plan is applied that the nonlinear model does not confirm.
//!
//! Every sample begins with a plan that is known to work: the rest of the last one, ended by the
//! terminal law. A quadratic program along it, with the set point as one more unknown, proposes
//! a better one. Only if the nonlinear rollout of the proposal keeps all bounds, ends in the
//! terminal set and costs no more, it takes the place of the candidate (suboptimal MPC: Scokaert,
//! Mayne and Rawlings 1999; Allan, Bates, Risbeck and Rawlings 2017; artificial set point: Limon,
//! Alvarado, Alamo and Camacho 2008). So once there is a plan, there is one at every later sample,
//! and its cost never grows while the set point stays, whatever the solver does. `docs/guarantees.md`
//! states the theorem and what it rests on.

mod plan;
mod program;
mod settings;

use crate::model::{LpvModel, Scalar};
use crate::ocp::Ocp;
use crate::solution::{BoundId, Solution, Status};
use crate::solver::{Solver, SolverSettings, WarmStart};
use core::fmt;
use nalgebra::{SVector, convert};
use plan::Plan;
pub use settings::{GuardedError, GuardedIterations, GuardedSettings, TerminalSet};

/// What the applied input is backed by, from the strongest to the weakest.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Decision {
    /// A new plan, confirmed by the nonlinear rollout, that costs no more than the candidate.
    NewPlan,
    /// The rest of the last plan, ended by the terminal law: no proposal was better.
    Candidate,
    /// The terminal law, whose set the state lies in: there was no plan.
    TerminalLaw,
    /// No plan keeps the bounds: the quadratic program with soft state bounds and terminal set.
    SoftBounds,
    /// The terminal law, cut off at the input bounds: nothing else had an answer.
    SaturatedLqr,
}

impl Decision {
    /// Whether bounds and convergence are guaranteed from here on, for the plant as modelled.
    pub fn is_guaranteed(self) -> bool {
        self <= Self::TerminalLaw
    }
}

impl fmt::Display for Decision {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NewPlan => "new plan",
            Self::Candidate => "candidate",
            Self::TerminalLaw => "terminal law",
            Self::SoftBounds => "soft bounds",
            Self::SaturatedLqr => "saturated LQR",
        })
    }
}

/// What one sample of the guarded loop gives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GuardedStep<T, const NX: usize, const NU: usize> {
    /// The input to apply until the next sample, finite and within its bounds.
    pub u: SVector<T, NU>,
    /// What it is backed by.
    pub decision: Decision,
    /// The artificial set point z of the plan: it ends at z times the direction.
    pub set_point: T,
    /// Cost of the plan on the nonlinear model: sum ||x - z d||_Q^2 + ||u||_R^2, terminal cost
    /// ||x_N - z d||_P^2 and offset cost.
    pub cost: T,
    /// Rolled-out minus predicted state at the end of the horizon, in state units; zero where
    /// the plan is not the quadratic program's.
    pub gap: SVector<T, NX>,
    /// What the last quadratic program said.
    pub status: Status<T>,
}

/// Scratch memory of a guarded step; may be shared between controllers that run one after the
/// other. Sizes as in [`GuardedController`].
#[derive(Clone, Debug)]
pub struct GuardedWorkspace<T, const NU: usize, const NA: usize, const NP: usize, const M: usize> {
    ocp: Ocp<T, NA, NU, NP>,
    solver: Solver<T, NA, NU, NP, M>,
    solution: Solution<T, NA, NU, NP, M>,
}

impl<T: Scalar, const NU: usize, const NA: usize, const NP: usize, const M: usize>
    GuardedWorkspace<T, NU, NA, NP, M>
{
    /// An empty workspace.
    #[inline(always)]
    pub fn new() -> Self {
        Self {
            ocp: Ocp::default(),
            solver: Solver::new(),
            solution: Solution::default(),
        }
    }

    /// Bounds that are active in the last quadratic program, edges of terminal set and trust
    /// region included.
    pub fn active_bounds(&self) -> usize {
        self.solution.active.len()
    }

    /// Those of them that are the plant's own, with the plant's stages: 0 is now.
    pub fn plant_bounds(&self) -> impl Iterator<Item = BoundId> {
        let active = self.solution.active.iter();
        active.filter_map(|row| program::of_the_plant(row.bound, self.ocp.horizon))
    }
}

impl<T: Scalar, const NU: usize, const NA: usize, const NP: usize, const M: usize> Default
    for GuardedWorkspace<T, NU, NA, NP, M>
{
    fn default() -> Self {
        Self::new()
    }
}

/// LPV MPC to set points with guaranteed bounds and convergence.
///
/// `NX` states, `NU` inputs, `NS` scheduling parameters, horizons up to `N`. The quadratic program
/// has the set point as a further state and two further stages: `NA` = `NX` + 1, `NP` = `N` + 2.
/// At most `M` bounds are active at once; `N * NU + NX + 1` suffice while bounds are hard.
#[derive(Clone, Debug)]
pub struct GuardedController<
    P,
    T,
    const NX: usize,
    const NU: usize,
    const NS: usize,
    const N: usize,
    const NA: usize,
    const NP: usize,
> {
    model: P,
    settings: GuardedSettings<T, NX, NU>,
    /// The last plan, if there is one to go on from; feasible or not.
    plan: Option<Plan<T, NX, NU, N>>,
    /// How far a program may move the set point: a trust region. Far along, the linear model is
    /// that of another motion.
    reach: T,
}

/// Fractions of the way to the quadratic program's answer that are tried.
const FRACTIONS: [f64; 4] = [1.0, 0.5, 0.25, 0.125];

impl<
    P,
    T,
    const NX: usize,
    const NU: usize,
    const NS: usize,
    const N: usize,
    const NA: usize,
    const NP: usize,
> GuardedController<P, T, NX, NU, NS, N, NA, NP>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
{
    /// A guarded controller for `model`.
    ///
    /// # Errors
    /// A [`GuardedError`] names the first setting that makes no sense.
    pub fn new(model: P, settings: GuardedSettings<T, NX, NU>) -> Result<Self, GuardedError> {
        const {
            assert!(NU > 0, "the set point enters through the first input");
            assert!(NA == NX + 1, "NA must be NX + 1");
            assert!(NP == N + 2, "NP must be N + 2");
        }
        settings.check(&model, N)?;
        Ok(Self {
            model,
            settings,
            plan: None,
            reach: settings.terminal.extent(&settings.direction),
        })
    }

    /// One sample: from the measured state `x` and the wanted set point (any number, reachable
    /// or not) to the input.
    pub fn step<const M: usize>(
        &mut self,
        x: &SVector<T, NX>,
        wanted: T,
        workspace: &mut GuardedWorkspace<T, NU, NA, NP, M>,
    ) -> GuardedStep<T, NX, NU> {
        let wanted = if wanted.is_finite() {
            wanted
        } else {
            self.plan.as_ref().map_or(T::zero(), |plan| plan.set_point)
        };
        let shifted = self.shifted(x, wanted);
        let guaranteed = self.guaranteed(x, wanted, shifted.as_ref());
        let along = guaranteed.map(|(plan, _)| plan).or(shifted);
        let along = along.unwrap_or_else(|| self.under_terminal_law(x, wanted));

        let improved = self.improve(
            x,
            wanted,
            &along,
            guaranteed.map(|(plan, _)| plan),
            workspace,
        );
        let status = workspace.solution.status;
        let (plan, decision) = match (improved, guaranteed) {
            (Some(plan), _) => (plan, Decision::NewPlan),
            (None, Some(known)) => known,
            (None, None) => self.last_resort(x, wanted, &along, workspace),
        };
        let step = GuardedStep {
            u: self.settings.u.project(&plan.u[0]),
            decision,
            set_point: plan.set_point,
            cost: plan.cost,
            gap: self.gap(&plan, decision, workspace),
            status,
        };
        let usable = plan.cost.is_finite() && decision != Decision::SaturatedLqr;
        self.plan = usable.then_some(plan);
        step
    }

    /// Forgets the past: the next step starts as the first one did.
    pub fn reset(&mut self) {
        self.plan = None;
        self.reach = self.settings.terminal.extent(&self.settings.direction);
    }

    /// The settings.
    pub fn settings(&self) -> &GuardedSettings<T, NX, NU> {
        &self.settings
    }

    /// The plan's states x_1 to x_N on the nonlinear model, as many as the horizon; none if there
    /// is no plan.
    pub fn rollout(&self) -> &[SVector<T, NX>] {
        let plan = self.plan.as_ref();
        plan.and_then(|plan| plan.x.get(..self.settings.horizon))
            .unwrap_or_default()
    }

    /// The rest of the last plan, ended by the terminal law, from the measured state.
    fn shifted(&self, x: &SVector<T, NX>, wanted: T) -> Option<Plan<T, NX, NU, N>> {
        let last = self.plan.as_ref()?;
        let mut u = last.u;
        let planned = u.get_mut(..self.settings.horizon)?;
        planned.rotate_left(1);
        *planned.last_mut()? = self.terminal_law(&last.end, last.set_point);
        Some(self.roll_out(x, u, last.set_point, wanted))
    }

    /// The cheaper one of what is known to work: the shifted plan or the terminal law.
    fn guaranteed(
        &self,
        x: &SVector<T, NX>,
        wanted: T,
        shifted: Option<&Plan<T, NX, NU, N>>,
    ) -> Option<(Plan<T, NX, NU, N>, Decision)> {
        let candidate = shifted
            .filter(|plan| self.is_feasible(plan, T::zero()))
            .map(|plan| (*plan, Decision::Candidate));
        if candidate.is_some() {
            return candidate;
        }
        let plan = self.under_terminal_law(x, wanted);
        let inside = self.terminal_value(x, plan.set_point) <= self.settings.terminal.level;
        (inside && self.is_feasible(&plan, T::zero())).then_some((plan, Decision::TerminalLaw))
    }

    /// Quadratic programs along `along`, each answer confirmed by the rollout. Returns the best
    /// confirmed plan that costs no more than the guaranteed one.
    fn improve<const M: usize>(
        &mut self,
        x: &SVector<T, NX>,
        wanted: T,
        along: &Plan<T, NX, NU, N>,
        guaranteed: Option<Plan<T, NX, NU, N>>,
        workspace: &mut GuardedWorkspace<T, NU, NA, NP, M>,
    ) -> Option<Plan<T, NX, NU, N>> {
        let GuardedSettings { iterations, .. } = self.settings;
        let most = if guaranteed.is_some() {
            iterations.known
        } else {
            iterations.unknown
        };
        let margin: T = self.settings.margin * convert::<f64, T>(0.5);
        let mut along = *along;
        let mut best = guaranteed;
        let mut improved = None;
        for _ in 0..most {
            self.pose(x, wanted, &along, &mut workspace.ocp);
            self.solve(workspace, WarmStart::Shifted);
            if !workspace.solution.status.is_solved() {
                self.scale_reach(0.5);
                break;
            }
            let (u, set_point) = program::answer(&workspace.solution);
            let found = FRACTIONS.iter().find_map(|fraction| {
                let part = convert(*fraction);
                let plan = self.between(x, wanted, &along, &u, set_point, part);
                let cheaper = best.as_ref().is_none_or(|best| plan.cost <= best.cost);
                (cheaper && self.is_feasible(&plan, margin)).then_some((plan, *fraction))
            });
            // The trust region grows when its edge was reached and the whole step held.
            let half: T = convert(0.5);
            let at_edge = (set_point - along.set_point).abs() > self.reach * half;
            self.scale_reach(match found {
                Some((_, fraction)) if fraction == 1.0 && at_edge => 2.0,
                Some(_) => 1.0,
                None => 0.5,
            });
            match found {
                Some((plan, _)) => {
                    along = plan;
                    best = Some(plan);
                    improved = Some(plan);
                    if guaranteed.is_none() {
                        break;
                    }
                }
                // Without a plan that works, half steps lead to one; with one, it is kept.
                None if guaranteed.is_none() => {
                    along = self.between(x, wanted, &along, &u, set_point, half);
                    if !along.cost.is_finite() {
                        break;
                    }
                }
                None => break,
            }
        }
        improved
    }

    /// Not below a thousandth of the terminal set: a smaller trust region would never be seen to
    /// hold, and so never grow again.
    fn scale_reach(&mut self, factor: f64) {
        let extent = self.settings.terminal.extent(&self.settings.direction);
        let least = extent * convert(1e-3);
        self.reach = (self.reach * convert(factor)).max(least);
    }

    /// Outside of what is guaranteed: soft bounds, then the saturated terminal law.
    fn last_resort<const M: usize>(
        &self,
        x: &SVector<T, NX>,
        wanted: T,
        along: &Plan<T, NX, NU, N>,
        workspace: &mut GuardedWorkspace<T, NU, NA, NP, M>,
    ) -> (Plan<T, NX, NU, N>, Decision) {
        if along.cost.is_finite() {
            self.pose(x, wanted, along, &mut workspace.ocp);
            self.soften(&mut workspace.ocp);
            self.solve(workspace, WarmStart::Cold);
            if workspace.solution.status.is_solved() {
                let (u, set_point) = program::answer(&workspace.solution);
                let plan = self.between(x, wanted, along, &u, set_point, T::one());
                if plan.cost.is_finite() {
                    return (plan, Decision::SoftBounds);
                }
            }
        }
        (self.under_terminal_law(x, wanted), Decision::SaturatedLqr)
    }

    fn solve<const M: usize>(
        &self,
        workspace: &mut GuardedWorkspace<T, NU, NA, NP, M>,
        warm_start: WarmStart,
    ) {
        let settings = SolverSettings {
            warm_start,
            ..self.settings.solver
        };
        workspace
            .solver
            .solve(&workspace.ocp, &settings, &mut workspace.solution);
    }

    fn gap<const M: usize>(
        &self,
        plan: &Plan<T, NX, NU, N>,
        decision: Decision,
        workspace: &GuardedWorkspace<T, NU, NA, NP, M>,
    ) -> SVector<T, NX> {
        match decision {
            Decision::NewPlan | Decision::SoftBounds => {
                plan.end - program::predicted_end(&workspace.solution, self.settings.horizon)
            }
            _ => SVector::zeros(),
        }
    }
}
