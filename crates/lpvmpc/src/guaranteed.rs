//! The loop that keeps its promise: LPV MPC with an artificial set point and a terminal set, in
//! which no plan is applied that the nonlinear model does not confirm.
//!
//! Every sample begins with a plan that is known to work: the rest of the last one, with feedback
//! towards its states, ended by the terminal law. Its states are those of the last plan, moved, where the plant is
//! as planned, and a rollout elsewhere. A quadratic program along it, with the set point as one more unknown,
//! proposes a better one. Only if the nonlinear rollout of the proposal keeps all bounds, ends in the
//! terminal set and costs no more, it takes the place of the candidate (suboptimal MPC: Scokaert,
//! Mayne and Rawlings 1999; Allan, Bates, Risbeck and Rawlings 2017; artificial set point: Limon,
//! Alvarado, Alamo and Camacho 2008). So once there is a plan, there is one at every later sample,
//! and its cost never grows while the set point stays, whatever the solver does. `docs/guarantees.md`
//! states the theorem and what it rests on.
//!
//! It takes no [`Preview`](crate::Preview): the certificate of its terminal set is a proof for one model,
//! fixed weights and fixed bounds.

mod aim;
#[cfg(all(test, feature = "alloc"))]
mod carriage;
mod least_cost;
mod memory;
mod plan;
mod program;
mod rest;
mod search;
mod settings;
mod slopes;
mod take_over;
mod tube;
mod workspace;

use crate::list::List;
use crate::model::{LpvModel, Scalar};
#[cfg(feature = "alloc")]
use crate::settings::LONGEST_HORIZON;
use crate::solution::{BoundId, Quantity, Side, Status};
use crate::solver_settings::WarmStart;
use aim::Aims;
pub use aim::SetPoints;
use core::fmt;
use core::mem::swap;
pub use memory::{
    GuaranteedArrays, GuaranteedMemory, GuaranteedWorkspaceArrays, GuaranteedWorkspaceMemory,
};
use nalgebra::{SVector, convert};
use plan::{Plan, PlannedStage};
use program::Slope;
pub use settings::{
    GuaranteedError, GuaranteedIterations, GuaranteedSettings, Rollout, TerminalSet,
    share_of_bounds,
};
pub use slopes::NEAR_SAMPLES;
use slopes::SampleSlopes;
pub use workspace::GuaranteedWorkspace;

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

/// What one sample of the guaranteed loop gives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GuaranteedStep<T, const NX: usize, const NU: usize> {
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

/// LPV MPC to set points with guaranteed bounds and convergence, for `NX` states, `NU` inputs and `NS`
/// scheduling parameters.
#[derive(Debug)]
#[cfg_attr(feature = "alloc", derive(Clone))]
pub struct GuaranteedController<P, T: 'static, const NX: usize, const NU: usize, const NS: usize> {
    planner: Planner<P, T, NX, NU, NS>,
    /// The last plan, feasible or not.
    last: Plan<T, NX, NU>,
    /// Whether it is one to go on from.
    has_plan: bool,
    /// The plan that programs are made along; at the end of a step, what is applied.
    along: Plan<T, NX, NU>,
    /// A plan that is compared with it.
    trial: Plan<T, NX, NU>,
    /// A plan that is kept meanwhile: the known one, or, without one, the first that is nearer to the
    /// bounds.
    nearer: Plan<T, NX, NU>,
}

/// What the last plan, once more, is good for.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Repeated {
    /// There is none, or it is no better than the known plan.
    No,
    /// It is a better plan.
    Plan,
    /// Without room for the integration error it is no plan, but still what to look along.
    ToLookAlong,
}

/// Rolls plans out, judges them and poses programs along them.
#[derive(Debug)]
#[cfg_attr(feature = "alloc", derive(Clone))]
struct Planner<P, T: 'static, const NX: usize, const NU: usize, const NS: usize> {
    model: P,
    settings: GuaranteedSettings<T, NX, NU>,
    /// What plans are aimed at in this sample.
    aims: Aims<T>,
    /// The last wanted set point that was a number.
    wanted: Option<T>,
    /// Weight of the inputs' distance from the plan that a program is made along, in units of R:
    /// far along, the linear model is that of another motion.
    damping: T,
    /// What the next program is linear by: what served last.
    slope: Slope,
    /// Whether programs keep no more room from the bounds than the known plan has: since one that did had no answer,
    /// until that plan has it.
    without_room: bool,
    /// How far the plant may be from the plans of the last program, at x_1 to x_N.
    drift: List<SVector<T, NX>>,
    /// The same at the end, in the norm of P.
    end_drift: T,
    /// Multiplier of the terminal set in the last program.
    pressure: T,
    /// Where the last program met the terminal set's edge, as y of the program.
    touch: Option<SVector<T, NX>>,
    /// The derivatives of the prediction at the samples of the last plan that needed them.
    slopes: List<SampleSlopes<T, NX, NU>>,
}

impl<P, T, const NX: usize, const NU: usize, const NS: usize> GuaranteedController<P, T, NX, NU, NS>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
{
    /// A guaranteed controller for `model`.
    ///
    /// # Errors
    /// A [`GuaranteedError`] names the first setting that makes no sense, or that there is too little memory
    /// for.
    pub fn new(
        model: P,
        settings: GuaranteedSettings<T, NX, NU>,
        memory: GuaranteedMemory<T, NX, NU>,
    ) -> Result<Self, GuaranteedError> {
        const {
            assert!(NU > 0, "the set point enters through the first input");
        }
        let GuaranteedMemory {
            plans,
            drift,
            slopes,
            aims,
        } = memory;
        let places = plans.iter().map(|list| list.len());
        let places = places.chain([drift.len(), slopes.len()]);
        let largest = places.fold(aims.len(), usize::min);
        settings.check(&model, largest)?;
        let horizon = settings.horizon;
        let [last, along, trial, nearer] = plans.map(|list| Plan::new(list.shortened(horizon)));
        let planner = Planner {
            model,
            settings,
            aims: Aims::new(aims.shortened(horizon)),
            wanted: None,
            damping: T::zero(),
            slope: Slope::Jacobian,
            without_room: false,
            drift: drift.shortened(horizon),
            end_drift: T::zero(),
            pressure: T::zero(),
            touch: None,
            slopes: slopes.shortened(horizon),
        };
        let mut controller = Self {
            planner,
            last,
            has_plan: false,
            along,
            trial,
            nearer,
        };
        controller.reset();
        Ok(controller)
    }

    /// A guaranteed controller with memory of its own.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    #[cfg(feature = "alloc")]
    pub fn allocate(
        model: P,
        settings: GuaranteedSettings<T, NX, NU>,
    ) -> Result<Self, GuaranteedError> {
        // What is refused is not worth its memory.
        settings.check(&model, LONGEST_HORIZON)?;
        let memory = GuaranteedMemory::allocate(settings.horizon);
        Self::new(model, settings, memory)
    }

    /// A workspace for this controller, with memory of its own; `NA` is `NX` + 1.
    #[cfg(feature = "alloc")]
    pub fn workspace<const NA: usize>(&self) -> GuaranteedWorkspace<T, NU, NA> {
        GuaranteedWorkspace::allocate(self.planner.settings.capacity())
    }

    /// One sample: from the measured state `x` and the wanted set point (any number, reachable
    /// or not) to the input. `NA` is `NX` + 1.
    pub fn step<const NA: usize>(
        &mut self,
        x: &SVector<T, NX>,
        wanted: T,
        workspace: &mut GuaranteedWorkspace<T, NU, NA>,
    ) -> GuaranteedStep<T, NX, NU> {
        self.step_with_preview(x, &SetPoints::constant(wanted), workspace)
    }

    /// One sample where it is known what will be wanted along the horizon. Wanted set points that
    /// are not admissible count as the nearest ones that are; NaN repeats the one before.
    pub fn step_with_preview<const NA: usize>(
        &mut self,
        x: &SVector<T, NX>,
        wanted: &SetPoints<'_, T>,
        workspace: &mut GuaranteedWorkspace<T, NU, NA>,
    ) -> GuaranteedStep<T, NX, NU> {
        const {
            assert!(NA == NX + 1, "NA must be NX + 1");
        }
        self.planner.take_aim(x, wanted);
        let known = self.find_known(x);
        let repeated = match known {
            Some(_) => self.repeat_cheaper(x),
            None => Repeated::No,
        };
        let least = match repeated {
            Repeated::ToLookAlong => self.nearer.cost,
            Repeated::No | Repeated::Plan => self.along.cost,
        };
        // The rest of a plan begins a sample later than the last program did; the plan once more does not.
        let warm_start = match repeated {
            Repeated::No => WarmStart::Shifted,
            Repeated::Plan | Repeated::ToLookAlong => WarmStart::Same,
        };
        let known_cost = known.map(|decision| (decision, least));
        let improved = self.improve(known_cost, warm_start, workspace);
        let status = workspace.solution.status;
        let (decision, gap) = match (improved, known) {
            (Some(gap), _) => (Decision::NewPlan, gap),
            (None, Some(_)) if repeated == Repeated::Plan => (Decision::NewPlan, SVector::zeros()),
            (None, Some(decision)) => {
                if repeated == Repeated::ToLookAlong {
                    swap(&mut self.along, &mut self.nearer);
                }
                (decision, SVector::zeros())
            }
            (None, None) => self.last_resort(workspace),
        };
        let Self { planner, along, .. } = self;
        if decision != Decision::NewPlan {
            planner.find_drift(along);
        }
        self.has_plan = along.cost.is_finite() && decision != Decision::SaturatedLqr;
        self.last.copy_from(along);
        let u = along
            .stages
            .first()
            .map_or_else(SVector::zeros, |stage| stage.u);
        GuaranteedStep {
            u: planner.settings.u.project(&u),
            decision,
            set_point: along.set_point,
            cost: along.cost,
            gap,
            status,
        }
    }

    /// The plan `along` becomes what is known to work: the rest of the last plan, else the terminal law.
    /// Where neither works, it is the former, as far as there is one, and the answer is none.
    fn find_known(&mut self, x: &SVector<T, NX>) -> Option<Decision> {
        let Self {
            planner,
            last,
            has_plan,
            along,
            trial,
            ..
        } = self;
        if *has_plan {
            planner.rest(x, last, along);
            if planner.is_feasible(along) {
                return Some(Decision::Candidate);
            }
        }
        planner.follow_terminal_law(x, trial);
        let works = planner.is_feasible(trial);
        if works || !*has_plan {
            swap(along, trial);
        }
        works.then_some(Decision::TerminalLaw)
    }

    /// The plan `along` becomes the last plan once more, where that keeps the bounds and is cheaper than
    /// the known plan, which is then kept in `nearer`.
    fn repeat_cheaper(&mut self, x: &SVector<T, NX>) -> Repeated {
        let Self {
            planner,
            last,
            along,
            trial,
            nearer,
            ..
        } = self;
        if !self.has_plan || !planner.is_under_way(last) {
            return Repeated::No;
        }
        planner.repeat(x, last, along.cost, trial);
        if !(trial.cost < along.cost && planner.is_feasible(trial)) {
            return Repeated::No;
        }
        swap(along, nearer);
        swap(along, trial);
        if planner.is_robust(along) {
            Repeated::Plan
        } else {
            Repeated::ToLookAlong
        }
    }

    /// Forgets the past: the next step starts as the first one did.
    pub fn reset(&mut self) {
        self.has_plan = false;
        self.planner.reset();
    }

    /// The model.
    pub fn model(&self) -> &P {
        &self.planner.model
    }

    /// The settings.
    pub fn settings(&self) -> &GuaranteedSettings<T, NX, NU> {
        &self.planner.settings
    }

    /// How much the integration error of the coming sample may add to the next plan's cost: while what
    /// is wanted stays and the last step is guaranteed, that is at most the last one's less the first
    /// stage cost, plus this. In the unit of the cost; of first order in the deviations from the plan,
    /// with their squares. No input depends on it, and it takes a linearisation along the horizon: it is
    /// worked out for who asks.
    pub fn epsilon(&self) -> T {
        self.planner.epsilon(&self.last)
    }

    /// The plan's states x_1 to x_N on the nonlinear model, as many as the horizon; none if there
    /// is no plan. Of a [`Decision::Candidate`] they may be those of the plan before, moved by its
    /// derivatives: right to first order in the integration error of a sample.
    pub fn rollout(&self) -> impl Iterator<Item = &SVector<T, NX>> {
        self.plan().map(|stage| &stage.x)
    }

    /// The samples of the last plan, none if there is no plan.
    fn plan(&self) -> impl Iterator<Item = &PlannedStage<T, NX, NU>> {
        let count = if self.has_plan { usize::MAX } else { 0 };
        self.last.stages.iter().take(count)
    }

    /// The bounds that the last plan meets: those of an input to rounding, those of a state to the
    /// margin that plans keep away from them.
    pub fn active_bounds(&self) -> impl Iterator<Item = BoundId> {
        let GuaranteedSettings { x, u, margin, .. } = &self.planner.settings;
        // A tenth more than the margin, for what rounding leaves.
        let room_x = plan::width(x) * (*margin * convert(1.1));
        let room_u = plan::width(u) * T::default_epsilon().sqrt();
        self.plan().enumerate().flat_map(move |(i, stage)| {
            let at_input = (0..NU).filter_map(move |j| {
                let sides = (u.lower[j] + room_u[j], u.upper[j] - room_u[j]);
                met(i, Quantity::Input(j), stage.u[j], sides)
            });
            let at_state = (0..NX).filter_map(move |j| {
                let sides = (x.lower[j] + room_x[j], x.upper[j] - room_x[j]);
                met(i + 1, Quantity::State(j), stage.x[j], sides)
            });
            at_input.chain(at_state)
        })
    }
}

impl<P, T, const NX: usize, const NU: usize, const NS: usize> Planner<P, T, NX, NU, NS>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
{
    /// Takes over what is wanted, as admissible numbers.
    fn take_aim(&mut self, x: &SVector<T, NX>, wanted: &SetPoints<'_, T>) {
        let GuaranteedSettings {
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
        self.aims.take(wanted, last, [lower, upper]);
        self.wanted = self.aims.stages.first().copied();
    }

    fn reset(&mut self) {
        self.wanted = None;
        self.damping = T::zero();
        self.slope = Slope::Jacobian;
        self.without_room = false;
        self.drift.fill(SVector::zeros());
        self.end_drift = T::zero();
        self.pressure = T::zero();
        self.touch = None;
        self.slopes.fill(SampleSlopes::unknown());
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
