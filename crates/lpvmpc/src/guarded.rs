//! The loop that keeps its promise: LPV MPC with an artificial set point and a terminal set, in
//! which no plan is applied that the nonlinear model does not confirm.
//!
//! Every sample begins with a plan that is known to work: the rest of the last one, with feedback
//! towards its states, ended by the terminal law. A quadratic program along it, with the set point as
//! one more unknown, proposes a better one. Only if the nonlinear rollout of the proposal keeps all bounds, ends in the
//! terminal set and costs no more, it takes the place of the candidate (suboptimal MPC: Scokaert,
//! Mayne and Rawlings 1999; Allan, Bates, Risbeck and Rawlings 2017; artificial set point: Limon,
//! Alvarado, Alamo and Camacho 2008). So once there is a plan, there is one at every later sample,
//! and its cost never grows while the set point stays, whatever the solver does. `docs/guarantees.md`
//! states the theorem and what it rests on.

mod aim;
mod plan;
mod program;
mod search;
mod settings;
mod tube;

use crate::model::{LpvModel, Scalar};
use crate::ocp::Ocp;
use crate::solution::{ActiveSet, BoundId, Quantity, Side, Solution, Status};
use crate::solver::Solver;
pub use aim::SetPoints;
use core::fmt;
use nalgebra::{SVector, convert};
use plan::Plan;
use program::Slope;
pub use settings::{
    GuardedError, GuardedIterations, GuardedSettings, Rollout, TerminalSet, share_of_bounds,
};

/// What the applied input is backed by, from the strongest to the weakest.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Decision {
    /// A new plan, confirmed by the nonlinear rollout, that costs no more than the candidate.
    NewPlan,
    /// The rest of the last plan, ended by the terminal law: no proposal was better.
    Candidate,
    /// The terminal law, under which the bounds hold and the terminal set is reached: there was no
    /// plan.
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
    /// How much the integration error of the coming sample may add to the next plan's cost: while what
    /// is wanted stays and the step is guaranteed, that is at most this one's less the first stage
    /// cost, plus this. In the unit of the cost; of first order in the deviations from the plan, with
    /// their squares.
    pub epsilon: T,
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

    /// The rows that are active in the last quadratic program: the warm start of the next one.
    pub fn warm_start(&self) -> &ActiveSet<T, M> {
        &self.solution.active
    }

    /// Takes another warm start for the next quadratic program.
    pub fn set_warm_start(&mut self, active: ActiveSet<T, M>) {
        self.solution.active = active;
    }

    /// Bounds that are active in the last quadratic program, edges of terminal set and trust
    /// region included.
    pub fn active_bounds(&self) -> usize {
        self.solution.active.len()
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
    /// The last wanted set point that was a number.
    wanted: Option<T>,
    /// Weight of the inputs' distance from the plan that a program is made along, in units of R:
    /// far along, the linear model is that of another motion.
    damping: T,
    /// What the next program is linear by: what served last.
    slope: Slope,
    /// How far the plant may be from the plans of the last program, at x_1 to x_N.
    drift: [SVector<T, NX>; N],
    /// The same at the end, in the norm of P.
    end_drift: T,
    /// Multiplier of the terminal set in the last program.
    pressure: T,
    /// Where the last program met the terminal set's edge, as y of the program.
    touch: Option<SVector<T, NX>>,
}

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
            wanted: None,
            damping: T::zero(),
            slope: Slope::Jacobian,
            drift: [SVector::zeros(); N],
            end_drift: T::zero(),
            pressure: T::zero(),
            touch: None,
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
        self.step_with_preview(x, &SetPoints::constant(wanted), workspace)
    }

    /// One sample where it is known what will be wanted along the horizon. Wanted set points that
    /// are not admissible count as the nearest ones that are; NaN repeats the one before.
    pub fn step_with_preview<const M: usize>(
        &mut self,
        x: &SVector<T, NX>,
        wanted: &SetPoints<T, N>,
        workspace: &mut GuardedWorkspace<T, NU, NA, NP, M>,
    ) -> GuardedStep<T, NX, NU> {
        let aims = &self.admissible(x, wanted);
        let rest = self.plan.as_ref().map(|last| self.rest(x, last, aims));
        let guaranteed = self.guaranteed(x, aims, rest.as_ref());
        let along = guaranteed.map(|(plan, _)| plan).or(rest);
        let along = along.unwrap_or_else(|| self.under_terminal_law(x, aims));

        let again = self.cheaper(x, aims, guaranteed.as_ref());
        let along = again.unwrap_or(along);
        // Without room for the integration error it is no plan, but still what to look along.
        let again = again.filter(|plan| self.is_robust(plan));
        let known = guaranteed.map(|(plan, decision)| (decision, again.unwrap_or(plan).cost));
        let improved = self.improve(x, aims, &along, known, workspace);
        let improved = improved.or(again.map(|plan| (plan, SVector::zeros())));
        let status = workspace.solution.status;
        let (mut plan, decision, gap) = match (improved, guaranteed) {
            (Some((plan, gap)), _) => (plan, Decision::NewPlan, gap),
            (None, Some((plan, decision))) => (plan, decision, SVector::zeros()),
            (None, None) => self.last_resort(x, aims, &along, workspace),
        };
        if decision != Decision::NewPlan {
            (plan.drift, plan.end_drift) = self.tube(&plan);
        }
        let step = GuardedStep {
            u: self.settings.u.project(&plan.u[0]),
            decision,
            set_point: plan.set_point,
            cost: plan.cost,
            epsilon: self.epsilon(&plan, aims),
            gap,
            status,
        };
        let usable = plan.cost.is_finite() && decision != Decision::SaturatedLqr;
        self.plan = usable.then_some(plan);
        step
    }

    /// What is wanted, as admissible numbers.
    fn admissible(&mut self, x: &SVector<T, NX>, wanted: &SetPoints<T, N>) -> SetPoints<T, N> {
        let GuardedSettings {
            direction,
            set_points: [lower, upper],
            terminal,
            ..
        } = &self.settings;
        let farthest = aim::farthest(terminal.extent(direction));
        let lower = if lower.is_finite() { *lower } else { -farthest };
        let upper = if upper.is_finite() { *upper } else { farthest };
        // Before anything was wanted, the plant may stay where it is.
        let here = x.dot(direction) / direction.norm_squared();
        let here = if here.is_finite() { here } else { T::zero() };
        let last = self.wanted.unwrap_or(here.max(lower).min(upper));
        let aims = wanted.clamped(last, [lower, upper]);
        self.wanted = aims.stages.first().copied();
        aims
    }

    /// Forgets the past: the next step starts as the first one did.
    pub fn reset(&mut self) {
        self.plan = None;
        self.wanted = None;
        self.damping = T::zero();
        self.slope = Slope::Jacobian;
        (self.drift, self.end_drift) = ([SVector::zeros(); N], T::zero());
        self.pressure = T::zero();
        self.touch = None;
    }

    /// The model.
    pub fn model(&self) -> &P {
        &self.model
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

    /// The bounds that the last plan meets: those of an input to rounding, those of a state to the
    /// margin that plans keep away from them.
    pub fn active_bounds(&self) -> impl Iterator<Item = BoundId> {
        let GuardedSettings { x, u, margin, .. } = &self.settings;
        // A tenth more than the margin, for what rounding leaves.
        let room_x = plan::width(x) * (*margin * convert(1.1));
        let room_u = plan::width(u) * T::default_epsilon().sqrt();
        let horizon = self.settings.horizon;
        self.plan.iter().flat_map(move |plan| {
            let states = plan.x.iter().take(horizon).enumerate();
            let inputs = plan.u.iter().take(horizon).enumerate();
            let at_state = move |(i, state): (usize, &SVector<T, NX>)| {
                let state = *state;
                (0..NX).filter_map(move |j| {
                    let sides = (x.lower[j] + room_x[j], x.upper[j] - room_x[j]);
                    met(i + 1, Quantity::State(j), state[j], sides)
                })
            };
            let at_input = move |(i, input): (usize, &SVector<T, NU>)| {
                let input = *input;
                (0..NU).filter_map(move |j| {
                    let sides = (u.lower[j] + room_u[j], u.upper[j] - room_u[j]);
                    met(i, Quantity::Input(j), input[j], sides)
                })
            };
            inputs.flat_map(at_input).chain(states.flat_map(at_state))
        })
    }

    /// What is known to work: the rest of the last plan, else the terminal law.
    fn guaranteed(
        &self,
        x: &SVector<T, NX>,
        aims: &SetPoints<T, N>,
        rest: Option<&Plan<T, NX, NU, N>>,
    ) -> Option<(Plan<T, NX, NU, N>, Decision)> {
        let candidate = rest
            .filter(|plan| self.is_feasible(plan))
            .map(|plan| (*plan, Decision::Candidate));
        if candidate.is_some() {
            return candidate;
        }
        let plan = self.under_terminal_law(x, aims);
        self.is_feasible(&plan)
            .then_some((plan, Decision::TerminalLaw))
    }

    /// The last plan once more, where that is feasible and cheaper than what is known to work.
    fn cheaper(
        &self,
        x: &SVector<T, NX>,
        aims: &SetPoints<T, N>,
        guaranteed: Option<&(Plan<T, NX, NU, N>, Decision)>,
    ) -> Option<Plan<T, NX, NU, N>> {
        let ((known, _), last) = (guaranteed?, self.plan.as_ref()?);
        let plan = self.repeated(x, last, aims);
        let cheaper = plan.cost < known.cost && self.is_feasible(&plan);
        cheaper.then_some(plan)
    }
}

/// The bound of the `quantity` at `stage` that its `value` meets, if it meets one.
fn met<T: Scalar>(
    stage: usize,
    quantity: Quantity,
    value: T,
    (lower, upper): (T, T),
) -> Option<BoundId> {
    let side = match (value <= lower, value >= upper) {
        (true, _) => Side::Lower,
        (_, true) => Side::Upper,
        _ => return None,
    };
    Some(BoundId {
        stage,
        quantity,
        side,
    })
}
