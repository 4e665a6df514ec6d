//! The LPVMPC controller: Algorithm 2 of the paper for any LPV model.

use crate::by_stage::{CostByStage, PlantByStage};
use crate::changes::FixedRows;
#[cfg(all(feature = "alloc", not(target_arch = "wasm32")))]
use crate::elsewhere::Watch;
use crate::list::List;
use crate::memory::ControllerMemory;
use crate::model::{LpvModel, Scalar};
use crate::outputs;
use crate::plan::{Aim, Policy, at};
#[cfg(feature = "alloc")]
use crate::settings::LONGEST_HORIZON;
use crate::settings::{
    ControllerError, ControllerSettings, InputReference, Iterations, TerminalIngredient, Weights,
    check, check_period,
};
use crate::soft_bounds::SoftPrices;
use crate::solution::{Solution, Status};
use crate::solver_settings::{SolverSettings, WarmStart};
use crate::steady_state::{SteadyState, SteadyStateProblem};
use crate::two_parts::{Answered, Prepared};
use crate::workspace::Workspace;
use nalgebra::SVector;

/// The state reference along the horizon, in state units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reference<'a, T, const NX: usize> {
    /// x_ref at the stages from 0 on; from where it ends, `terminal`.
    pub stages: &'a [SVector<T, NX>],
    /// x_ref at the end of the horizon.
    pub terminal: SVector<T, NX>,
}

impl<T: Scalar, const NX: usize> Reference<'_, T, NX> {
    /// The same state at every stage.
    pub fn constant(x: SVector<T, NX>) -> Self {
        Self {
            stages: &[],
            terminal: x,
        }
    }

    /// x_ref at stage `i`.
    #[inline(always)]
    pub fn at(&self, i: usize) -> &SVector<T, NX> {
        self.stages.get(i).unwrap_or(&self.terminal)
    }
}

/// The LPVMPC controller of one plant.
///
/// `NX` states, `NU` inputs, `NS` scheduling parameters. It holds everything that lives from sample to sample; the
/// [`Workspace`] is handed in and may be shared between controllers.
#[derive(Debug)]
#[cfg_attr(feature = "alloc", derive(Clone))]
pub struct Controller<P, T: 'static, const NX: usize, const NU: usize, const NS: usize> {
    pub(crate) model: P,
    pub(crate) settings: ControllerSettings<T, NX, NU, NS>,
    /// The nonlinear model's states under the last plan, x_1 to x_N: where the next sample's
    /// stages 0 to N - 1 are expected to be.
    pub(crate) rollout: List<SVector<T, NX>>,
    /// How the last plan is followed: of a descent only.
    pub(crate) policy: Policy<T, NX, NU>,
    /// Whether another plan is to be looked for.
    #[cfg(all(feature = "alloc", not(target_arch = "wasm32")))]
    pub(crate) watch: Watch<T>,
    /// Rolled-out minus predicted state at the end of the horizon.
    pub(crate) gap: SVector<T, NX>,
    /// Of soft state bounds in the sample.
    pub(crate) soft: SoftPrices<T, NX>,
    pub(crate) initialised: bool,
    /// Quadratic programs that the last step solved.
    pub(crate) problems: u16,
    /// The end of the reference for which `target` was worked out.
    pub(crate) aimed_at: Option<SVector<T, NX>>,
    pub(crate) target: Option<SteadyState<T, NX, NU>>,
    /// The program that is ready for [`Controller::feedback`].
    pub(crate) prepared: Option<Prepared<T, NX>>,
    /// What the last feedback began with, while the rest of its step is to be made up for.
    pub(crate) answered: Option<Answered<T, NX>>,
    /// General rows of every sample.
    pub(crate) fixed: Option<FixedRows<P, T, NX, NU, NS>>,
    pub(crate) solution: Solution<T, NX, NU>,
}

impl<P, T, const NX: usize, const NU: usize, const NS: usize> Controller<P, T, NX, NU, NS>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
{
    /// A controller for `model`.
    ///
    /// # Errors
    /// A [`ControllerError`] names the first setting that makes no sense.
    pub fn new(
        model: P,
        settings: ControllerSettings<T, NX, NU, NS>,
        memory: ControllerMemory<T, NX, NU>,
    ) -> Result<Self, ControllerError> {
        let ControllerMemory {
            x,
            u,
            feedback,
            active,
        } = memory;
        let places = x.iter().map(|list| list.len());
        let places = places.chain(u.iter().map(|list| list.len()));
        check(&settings, places.fold(feedback.len(), usize::min))?;
        if let Some(period) = model.period() {
            check_period(period, settings.t_s)?;
        }
        let horizon = settings.horizon;
        let [rollout, x] = x.map(|list| list.shortened(horizon));
        let [planned, u] = u.map(|list| list.shortened(horizon));
        let feedback = feedback.shortened(horizon);
        Ok(Self {
            model,
            settings,
            rollout,
            policy: Policy::new(planned, feedback),
            #[cfg(all(feature = "alloc", not(target_arch = "wasm32")))]
            watch: Watch::new(),
            gap: SVector::zeros(),
            soft: SoftPrices::given(&settings.soft_x),
            initialised: false,
            problems: 0,
            aimed_at: None,
            target: None,
            prepared: None,
            answered: None,
            fixed: None,
            solution: Solution::new(u, x, active),
        })
    }

    /// A controller with memory of its own, for the horizon of its settings.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    #[cfg(feature = "alloc")]
    pub fn allocate(
        model: P,
        settings: ControllerSettings<T, NX, NU, NS>,
    ) -> Result<Self, ControllerError> {
        // What is refused is not worth its memory.
        check(&settings, LONGEST_HORIZON)?;
        let memory = ControllerMemory::allocate(settings.capacity());
        Self::new(model, settings, memory)
    }

    /// A workspace for this controller, with memory of its own.
    #[cfg(feature = "alloc")]
    pub fn workspace(&self) -> Workspace<T, NX, NU> {
        Workspace::allocate(self.settings.capacity())
    }

    /// One sample of Algorithm 2: from the measured state `x` and the reference along the
    /// horizon to the plan, whose first input is to be applied until the next sample.
    ///
    /// The inputs are finite and within the input bounds, whatever the status says. With a workspace for
    /// shorter horizons only it is [`Status::HorizonTooLong`].
    pub fn step(
        &mut self,
        x: &SVector<T, NX>,
        reference: &Reference<'_, T, NX>,
        workspace: &mut Workspace<T, NX, NU>,
    ) -> &Solution<T, NX, NU> {
        match self.fixed.take() {
            None => self.sample(x, reference, (), workspace),
            Some(fixed) => (fixed.run)(self, Some(x), reference, fixed, workspace),
        }
        &self.solution
    }

    /// The sample's plan, with what the stages have of their own.
    #[inline(always)]
    pub(crate) fn sample<D: PlantByStage<P, T, NX, NU, NS>>(
        &mut self,
        x: &SVector<T, NX>,
        reference: &Reference<'_, T, NX>,
        own: D,
        workspace: &mut Workspace<T, NX, NU>,
    ) {
        if !workspace.holds(self.settings.horizon) {
            return self.give_up(Status::HorizonTooLong);
        }
        self.make_up(own);
        let aim = &self.aim(reference, own);
        self.pose(x, aim, workspace);
        if let Iterations::Descent { tolerance, .. } = self.settings.iterations {
            return self.descend(x, aim, tolerance, workspace);
        }
        self.solve_scheduled(x, aim, workspace);
        self.roll_out(x, own);
        self.iterate(x, aim, workspace);
    }

    /// Algorithm 2 from the state to the answer of the sample's first program.
    pub(crate) fn solve_scheduled<D: PlantByStage<P, T, NX, NU, NS>>(
        &mut self,
        x: &SVector<T, NX>,
        aim: &Aim<'_, T, NX, NU, D>,
        workspace: &mut Workspace<T, NX, NU>,
    ) {
        let Workspace { ocp, solver, .. } = workspace;
        self.initialise_scheduling(x);
        self.predict(x, aim.own, ocp);
        self.track(aim, ocp);
        if D::SOME {
            self.pose_outputs((x, &self.solution.u), 1, (aim, T::zero()), ocp);
        }
        solver.solve(ocp, &self.settings.solver, &mut self.solution);
        self.problems = 1;
    }

    /// The steady state that the last step headed for: the end of its reference, or, where the plant
    /// cannot stand there, the nearest place where it can (`reached` tells which). `None` with a given
    /// input reference, and where no steady state was found; the reference is then taken as it is.
    pub fn target(&self) -> Option<&SteadyState<T, NX, NU>> {
        self.target.as_ref()
    }

    /// What to follow: the target where the reference is at rest, the reference where it moves.
    pub(crate) fn aim<'a, D: PlantByStage<P, T, NX, NU, NS>>(
        &mut self,
        reference: &'a Reference<'a, T, NX>,
        own: D,
    ) -> Aim<'a, T, NX, NU, D> {
        if !(D::SOME && self.find_own_target(&reference.terminal, own)) {
            self.find_target(&reference.terminal);
        }
        let mut stages = reference.stages.iter().take(self.settings.horizon);
        let rests = stages.all(|x_ref| *x_ref == reference.terminal);
        Aim {
            reference,
            rest: self.target.filter(|_| rests).map(|target| target.x),
            u_ref: self.u_ref(),
            own,
        }
    }

    /// The input that costs nothing.
    fn u_ref(&self) -> SVector<T, NU> {
        match (&self.settings.input_reference, &self.target) {
            (InputReference::Given(u), _) | (_, Some(SteadyState { u, .. })) => *u,
            (InputReference::SteadyState, None) => SVector::zeros(),
        }
    }

    fn find_target(&mut self, x_ref: &SVector<T, NX>) {
        let known = self.aimed_at == Some(*x_ref);
        if known || self.settings.input_reference != InputReference::SteadyState {
            return;
        }
        let Weights { q, r } = &self.settings.weights;
        self.aimed_at = Some(*x_ref);
        self.target = self.model.steady_state(&SteadyStateProblem {
            x_ref: *x_ref,
            q: q.diagonal(),
            r: r.diagonal(),
            x: self.settings.x,
            u: self.settings.u,
        });
    }

    /// Forgets the past: the next step starts as the first one did.
    pub fn reset(&mut self) {
        self.initialised = false;
        (self.prepared, self.answered) = (None, None);
        self.solution.clear();
    }

    /// The plan of the last step.
    pub fn solution(&self) -> &Solution<T, NX, NU> {
        &self.solution
    }

    /// How many quadratic programs the last step solved.
    pub fn problems(&self) -> usize {
        usize::from(self.problems)
    }

    /// Rolled-out minus predicted state at the end of the last plan's horizon, in state units:
    /// how far the nonlinear model ends from where the last quadratic program expects it.
    pub fn gap(&self) -> SVector<T, NX> {
        self.gap
    }

    /// The model.
    pub fn model(&self) -> &P {
        &self.model
    }

    /// The settings.
    pub fn settings(&self) -> &ControllerSettings<T, NX, NU, NS> {
        &self.settings
    }

    /// The states x_1 to x_N that the nonlinear model reaches under the last plan.
    pub fn rollout(&self) -> &[SVector<T, NX>] {
        &self.rollout
    }

    /// The paper's cost J of the last plan (Algorithm 1), constant terms included, on the
    /// states predicted from `x`, for the arguments of the last step.
    pub fn tracking_cost(&self, x: &SVector<T, NX>, reference: &Reference<'_, T, NX>) -> T {
        self.own_cost(x, reference, ())
    }

    /// The same with what the stages have of their own.
    #[inline(always)]
    pub(crate) fn own_cost<D: CostByStage<T, NX, NU>>(
        &self,
        x: &SVector<T, NX>,
        reference: &Reference<'_, T, NX>,
        own: D,
    ) -> T {
        let aim = Aim {
            reference,
            rest: None,
            u_ref: self.u_ref(),
            own,
        };
        let mut total = T::zero();
        let mut x = x;
        let steps = self.solution.u.iter().zip(self.solution.x.iter());
        for (i, (u, x_next)) in steps.enumerate().take(self.settings.horizon) {
            total += aim.cost(i, (x, u), &self.settings.weights);
            if D::SOME
                && let Some(outputs) = aim.own.outputs()
            {
                total += outputs::cost(outputs, i, (x, u));
            }
            x = x_next;
        }
        total += aim.linear_cost(self.settings.horizon, x, None);
        match aim.own.terminal().unwrap_or(&self.settings.terminal) {
            TerminalIngredient::Cost(p) => {
                let error = x - reference.terminal;
                total + (p * error).dot(&error)
            }
            TerminalIngredient::Equality => total,
        }
    }

    /// The further quadratic programs of the sample, each along the plan of the one before.
    #[inline(never)]
    fn iterate<D: PlantByStage<P, T, NX, NU, NS>>(
        &mut self,
        x: &SVector<T, NX>,
        aim: &Aim<'_, T, NX, NU, D>,
        workspace: &mut Workspace<T, NX, NU>,
    ) {
        let own = aim.own;
        let Workspace { ocp, solver, .. } = workspace;
        let settings = SolverSettings {
            warm_start: WarmStart::Same,
            ..self.settings.solver
        };
        while self.problems() < self.settings.iterations.most()
            && self.initialised
            && self.solution.status.is_solved()
        {
            self.linearize(x, &self.solution.u, 0, own, ocp);
            if D::SOME {
                self.pose_outputs((x, &self.solution.u), 0, (aim, T::zero()), ocp);
            }
            solver.solve(ocp, &settings, &mut self.solution);
            self.roll_out(x, own);
            self.problems += 1;
        }
    }

    /// The last stage of the horizon.
    #[inline(always)]
    pub(crate) fn last_stage(&self) -> usize {
        self.settings.horizon.saturating_sub(1)
    }

    /// Algorithm 2, step 4: the nonlinear model under the plan.
    #[inline(never)]
    pub(crate) fn roll_out<D: PlantByStage<P, T, NX, NU, NS>>(
        &mut self,
        x: &SVector<T, NX>,
        own: D,
    ) {
        let mut state = *x;
        let places = self.rollout.iter_mut().zip(self.solution.u.iter());
        for (i, (place, u)) in places.enumerate().take(self.settings.horizon) {
            state = own.next_state(i, &self.model, &self.settings, &state, u);
            *place = state;
        }
        self.gap = state - at(&self.solution.x, self.last_stage());
        // A rollout that has become non-finite is no past to build on.
        self.initialised = state.iter().all(|entry| entry.is_finite());
    }
}

/// The nonlinear model's state one sample after `x` under the input `u`.
// Once in the machine code of a microcontroller, for its flash; elsewhere in every loop, for speed.
#[cfg_attr(target_arch = "arm", inline(never))]
#[cfg_attr(not(target_arch = "arm"), inline(always))]
pub(crate) fn next_state<P, T, const NX: usize, const NU: usize, const NS: usize>(
    model: &P,
    settings: &ControllerSettings<T, NX, NU, NS>,
    x: &SVector<T, NX>,
    u: &SVector<T, NU>,
) -> SVector<T, NX>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
{
    settings.predictor.rk4().advance(model, x, u, settings.t_s)
}
