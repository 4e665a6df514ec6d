//! The LPVMPC controller: Algorithm 2 of the paper for any LPV model.

use crate::by_stage::{CostByStage, PlantByStage};
use crate::changes::FixedRows;
#[cfg(all(feature = "alloc", not(target_arch = "wasm32")))]
use crate::elsewhere::Watch;
use crate::list::List;
use crate::memory::ControllerMemory;
use crate::model::{LpvModel, Scalar};
use crate::ocp::{Ocp, Stage};
use crate::outputs;
use crate::plan::{Aim, Policy, at};
#[cfg(feature = "alloc")]
use crate::settings::LONGEST_HORIZON;
use crate::settings::{
    ControllerError, ControllerSettings, InputReference, Iterations, TerminalIngredient, Weights,
    check, check_period,
};
use crate::small_matrix::product;
use crate::soft_bounds::SoftPrices;
use crate::solution::{Solution, Status};
use crate::solver::{SolverSettings, WarmStart};
use crate::steady_state::{SteadyState, SteadyStateProblem};

use crate::two_parts::Answered;
use crate::workspace::Workspace;
use core::array::from_fn;
use nalgebra::{SMatrix, SVector, convert};

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

/// So many stages are linearised together where that takes less time.
const GROUP: usize = 4;

/// States and inputs of such a group.
type Group<'a, T, const NX: usize, const NU: usize> =
    (&'a [SVector<T, NX>; GROUP], &'a [SVector<T, NU>; GROUP]);

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
    /// What came of factorising the program that is ready for [`Controller::feedback`].
    pub(crate) prepared: Option<Result<(), Status<T>>>,
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

    /// Weights, bounds and rows of the program, and the prices of soft bounds from `x` on.
    #[inline(always)]
    pub(crate) fn pose<D: CostByStage<T, NX, NU>>(
        &mut self,
        x: &SVector<T, NX>,
        aim: &Aim<'_, T, NX, NU, D>,
        workspace: &mut Workspace<T, NX, NU>,
    ) {
        let (settings, own) = (&self.settings, &aim.own);
        let terminal = own.terminal().unwrap_or(&settings.terminal);
        self.soft = SoftPrices::new(settings, terminal, &(x - aim.end()));
        workspace.pose(settings, &self.soft);
        if own.any() {
            workspace.pose_own(settings, &self.soft, own);
        }
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

    /// Algorithm 2, step 1: without a past, the plant is expected to stay at `x`.
    fn initialise_scheduling(&mut self, x: &SVector<T, NX>) {
        if !self.initialised {
            self.rollout.fill(*x);
            self.solution.u.fill(SVector::zeros());
        }
    }

    /// Algorithm 1, lines 1 to 8: the predictor's matrices along the scheduling window, which
    /// is that of the last rollout (Algorithm 2, steps 5 and 9).
    pub(crate) fn predict<D: PlantByStage<P, T, NX, NU, NS>>(
        &self,
        x: &SVector<T, NX>,
        own: D,
        ocp: &mut Ocp<T, NX, NU>,
    ) {
        ocp.horizon = self.settings.horizon;
        ocp.x0 = *x;
        self.linearize(x, &self.solution.u, 1, own, ocp);
    }

    /// The predictor's matrices along the last rollout, which began at `x` and had these
    /// `inputs`, from its sample `first` (0 or 1) on; the last input is repeated.
    // Not inlined, so that each loop has the registers for itself: a tenth of the step's time.
    #[inline(never)]
    fn linearize<D: PlantByStage<P, T, NX, NU, NS>>(
        &self,
        x: &SVector<T, NX>,
        inputs: &[SVector<T, NU>],
        first: usize,
        own: D,
        ocp: &mut Ocp<T, NX, NU>,
    ) {
        let horizon = self.settings.horizon;
        if P::TOGETHER {
            let done = self.in_groups(x, inputs, first, &mut ocp.stages, |motion, stages| {
                let Some(made) = own.predict_each(&self.model, &self.settings, motion) else {
                    return false;
                };
                for ((c, a, b), stage) in made.iter().zip(stages) {
                    (stage.a, stage.b, stage.c) = (*a, *b, *c);
                }
                true
            });
            let rest = ocp.stages.iter_mut().enumerate().take(horizon);
            for (i, stage) in rest.skip(done) {
                let (x, u) = self.expected(x, inputs, first + i);
                (stage.a, stage.b, stage.c) = own.predict(i, &self.model, &self.settings, &x, &u);
            }
            return;
        }
        let states = core::iter::once(x).chain(self.rollout.iter()).skip(first);
        let inputs = inputs.iter().take(horizon);
        let window = states.zip(inputs.clone().skip(first).chain(inputs.last()));
        let samples = ocp.stages.iter_mut().zip(window).take(horizon);
        if D::SOME {
            for (i, (stage, (x, u))) in samples.enumerate() {
                (stage.a, stage.b, stage.c) = own.predict(i, &self.model, &self.settings, x, u);
            }
            return;
        }
        // The same again, for its registers: 2 % of the step's instructions.
        let ControllerSettings { t_s, predictor, .. } = &self.settings;
        let held = self.settings.scheduling.held();
        for (stage, (x, u)) in samples {
            let pair = predictor.linearize_along(&self.model, held, x, u, *t_s);
            let c = predictor.offset_along(&self.model, held, (x, u), *t_s, &pair);
            stage.c = c.unwrap_or_else(SVector::zeros);
            (stage.a, stage.b) = pair;
        }
    }

    /// State and input that are expected `i` samples from `x` on, along the last rollout and these `inputs`; beyond the
    /// last, the last.
    fn expected(
        &self,
        x: &SVector<T, NX>,
        inputs: &[SVector<T, NU>],
        i: usize,
    ) -> (SVector<T, NX>, SVector<T, NU>) {
        let state = i
            .checked_sub(1)
            .map_or(*x, |before| at(&self.rollout, before));
        (state, at(inputs, i))
    }

    /// Has the `stages` written from states and inputs, in groups, until there is no whole group left or `write` makes
    /// nothing of them. The states are those of the rollout from `x`, the `first` of them for the first stage.
    /// Returns how many stages were written.
    pub(crate) fn in_groups(
        &self,
        x: &SVector<T, NX>,
        inputs: &[SVector<T, NU>],
        first: usize,
        stages: &mut [Stage<T, NX, NU>],
        write: impl Fn(Group<'_, T, NX, NU>, &mut [Stage<T, NX, NU>; GROUP]) -> bool,
    ) -> usize {
        let mut done = 0;
        let (groups, _) = stages.as_chunks_mut();
        for stages in groups.iter_mut().take(self.settings.horizon / GROUP) {
            let expected: [_; GROUP] = from_fn(|k| self.expected(x, inputs, first + done + k));
            let (states, inputs) = (expected.map(|(x, _)| x), expected.map(|(_, u)| u));
            if !write((&states, &inputs), stages) {
                break;
            }
            done += GROUP;
        }
        done
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

    /// Algorithm 1, cost: the reference enters the linear terms.
    #[inline(never)]
    pub(crate) fn track<D: CostByStage<T, NX, NU>>(
        &self,
        aim: &Aim<'_, T, NX, NU, D>,
        ocp: &mut Ocp<T, NX, NU>,
    ) {
        let q = -self.settings.weights.q;
        let linear_u = -product(&self.settings.weights.r, &aim.u_ref);
        let stages = ocp.stages.iter_mut().enumerate();
        for (i, stage) in stages.take(self.settings.horizon) {
            stage.linear_x = product(&q, aim.at(i));
            stage.linear_u = linear_u;
            if aim.own.any() {
                (stage.linear_x, stage.linear_u) = aim.linear_terms(i, &self.settings.weights);
            }
        }
        let x_ref = *aim.end();
        let (p, equality) = match aim.own.terminal().unwrap_or(&self.settings.terminal) {
            TerminalIngredient::Cost(p) => (*p, None),
            TerminalIngredient::Equality => (SMatrix::zeros(), Some(x_ref)),
        };
        ocp.terminal.p = p;
        ocp.terminal.linear_x = -product(&p, &x_ref);
        if D::SOME
            && let Some(price) = aim.own.linear_x(self.settings.horizon)
        {
            ocp.terminal.linear_x += price * convert::<f64, T>(0.5);
        }
        ocp.terminal.equality = equality;
    }

    /// The outputs of the program, where there are any, linear about the last rollout from its sample `first`
    /// (0 or 1) on, which began at `x` and had these `inputs`. What changes of the inputs costs extra by the
    /// `damping`.
    #[inline(never)]
    pub(crate) fn pose_outputs<D: CostByStage<T, NX, NU>>(
        &self,
        (x, inputs): (&SVector<T, NX>, &[SVector<T, NU>]),
        first: usize,
        (aim, damping): (&Aim<'_, T, NX, NU, D>, T),
        ocp: &mut Ocp<T, NX, NU>,
    ) {
        let Some(outputs) = aim.own.outputs() else {
            return;
        };
        let horizon = self.settings.horizon;
        let bounded = outputs::rows(&aim.own);
        let per_stage = ocp.rows_per_stage;
        let states = core::iter::once(x).chain(self.rollout.iter()).skip(first);
        let inputs = inputs.iter().take(horizon);
        let window = states.zip(inputs.clone().skip(first).chain(inputs.last()));
        let samples = ocp.stages.iter_mut().zip(ocp.own.iter_mut()).zip(window);
        for (i, ((stage, common), (x, u))) in samples.enumerate().take(horizon) {
            let Weights { q, r } = *aim.own.weights(i).unwrap_or(&self.settings.weights);
            (common.q, common.r) = (q, r + SMatrix::identity() * damping);
            common.s = aim.own.cross(i).copied().unwrap_or_else(SMatrix::zeros);
            (stage.linear_x, stage.linear_u) = aim.linear_terms(i, &self.settings.weights);
            stage.linear_u -= u * damping;
            let linear = (&mut stage.linear_x, &mut stage.linear_u);
            outputs::add_costs(outputs, i, (x, u), common, linear);
            let rows = ocp.rows.get_mut(i * per_stage..i * per_stage + bounded);
            outputs::write_rows(outputs, i, (x, u), false, rows.unwrap_or_default());
        }
        let end = at(&self.rollout, self.last_stage());
        let rows = ocp
            .rows
            .get_mut(horizon * per_stage..horizon * per_stage + bounded);
        let still = SVector::zeros();
        outputs::write_rows(
            outputs,
            horizon,
            (&end, &still),
            true,
            rows.unwrap_or_default(),
        );
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
