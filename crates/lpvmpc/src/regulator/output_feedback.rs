//! The controller on a real robot: estimate, predict to the moment when the input acts, decide.

use super::belief::Belief;
use super::planner::{Planned, Planner};
use super::window::Window;
use super::{Command, Measurement};
use crate::delay::DelayLine;
use crate::estimator::Observation;
use crate::list::List;
use crate::model::{LpvModel, Scalar};
use crate::ocp::Bounds;
use crate::solution::{BoundId, Status};
use nalgebra::{SVector, convert, try_convert};

/// What stands around a planner, besides what knows the state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FeedbackSettings<T, const NU: usize> {
    /// Time from a measurement to the input that answers it, s; less than zero, or NaN, counts as zero.
    pub delay: T,
    /// Time from one measurement to the next, s.
    pub period: T,
    /// Whether the planner sees the reference before its time, over its horizon.
    pub preview: bool,
    /// Bounds of the commanded input.
    pub u: Bounds<T, NU>,
}

/// Memory of an [`OutputFeedback`] besides its planner's and its filter's.
#[derive(Debug)]
pub struct FeedbackMemory<T: 'static, const NX: usize, const NU: usize> {
    /// Inputs on their way: see [`DelayLine`].
    pub commands: List<(T, SVector<T, NU>)>,
    /// The reference at each stage of the horizon; none is needed without preview.
    pub window: List<SVector<T, NX>>,
}

#[cfg(feature = "alloc")]
impl<T: Scalar, const NX: usize, const NU: usize> FeedbackMemory<T, NX, NU> {
    /// For so many `commands` on their way and this `horizon`, on the heap.
    pub fn allocate(commands: usize, horizon: usize) -> Self {
        Self {
            commands: List::repeat((T::zero(), SVector::zeros()), commands),
            window: List::repeat(SVector::zeros(), horizon),
        }
    }
}

/// The same as arrays: a horizon of up to `N` samples, `C` inputs on their way.
#[derive(Clone, Copy, Debug)]
pub struct FeedbackArrays<T, const NX: usize, const NU: usize, const N: usize, const C: usize> {
    commands: [(T, SVector<T, NU>); C],
    window: [SVector<T, NX>; N],
}

impl<T: Scalar, const NX: usize, const NU: usize, const N: usize, const C: usize>
    FeedbackArrays<T, NX, NU, N, C>
{
    /// The arrays as memory of an output feedback.
    pub fn lend(&'static mut self) -> FeedbackMemory<T, NX, NU> {
        FeedbackMemory {
            commands: List::Static(&mut self.commands),
            window: List::Static(&mut self.window),
        }
    }
}

impl<T: Scalar, const NX: usize, const NU: usize, const N: usize, const C: usize> Default
    for FeedbackArrays<T, NX, NU, N, C>
{
    fn default() -> Self {
        Self {
            commands: [(T::zero(), SVector::zeros()); C],
            window: [SVector::zeros(); N],
        }
    }
}

/// A planner with all that stands around it on a real robot: `NX` states, `NU` inputs, `NS`
/// scheduling parameters, `NY` sensors and `ND` disturbances that the filter finds.
///
/// The planner's workspace is handed in: regulators that run one after the other may share it. One
/// that has its own is a [`Standalone`](super::Standalone).
#[derive(Debug)]
#[cfg_attr(feature = "alloc", derive(Clone))]
pub struct OutputFeedback<
    P,
    K,
    T: 'static,
    const NX: usize,
    const NU: usize,
    const NS: usize,
    const NY: usize,
    const ND: usize,
> {
    pub(super) belief: Belief<P, T, NX, NU, NS, NY, ND>,
    pub(super) planner: K,
    pub(super) settings: FeedbackSettings<T, NU>,
    /// Largest magnitude of each input that others leave, such as another plane on the same motors.
    share: SVector<T, NU>,
    pub(super) commands: DelayLine<T, NU>,
    /// The input that was commanded last.
    commanded: SVector<T, NU>,
    window: Window<T, NX>,
    /// The state that the last plan begins with, in the model's coordinates; NaN before the first.
    pub(super) start: SVector<T, NX>,
}

impl<P, K, T, const NX: usize, const NU: usize, const NS: usize, const NY: usize, const ND: usize>
    OutputFeedback<P, K, T, NX, NU, NS, NY, ND>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
    K: Planner<T, NX, NU>,
{
    /// The feedback at rest: nothing was measured, no input commanded.
    pub fn new(
        belief: Belief<P, T, NX, NU, NS, NY, ND>,
        planner: K,
        settings: FeedbackSettings<T, NU>,
        memory: FeedbackMemory<T, NX, NU>,
    ) -> Self {
        let delays = settings.delay > T::zero();
        let delay = if delays { settings.delay } else { T::zero() };
        Self {
            belief,
            planner,
            settings: FeedbackSettings { delay, ..settings },
            share: SVector::repeat(convert(f64::INFINITY)),
            commands: DelayLine::new(memory.commands),
            commanded: SVector::zeros(),
            window: Window::new(memory.window),
            start: SVector::repeat(convert(f64::NAN)),
        }
    }

    /// Time from one decision to the next, s.
    pub fn t_s(&self) -> T {
        self.planner.t_s()
    }

    /// The planner.
    pub fn planner(&self) -> &K {
        &self.planner
    }

    /// The input that was commanded last.
    pub fn commanded(&self) -> &SVector<T, NU> {
        &self.commanded
    }

    /// Takes in what the sensors deliver: see [`Regulator::observe`](super::Regulator::observe).
    pub fn observe(&mut self, measurement: &Measurement<T, NY>) -> Observation<NY> {
        let observation = self.belief.observe(measurement, &mut self.commands);
        if observation.restart.is_some() {
            // The plan belongs to the state before.
            self.planner.forget_plan();
        }
        observation
    }

    /// The command from the last measurement on: see
    /// [`Regulator::decide`](super::Regulator::decide).
    pub fn decide(
        &mut self,
        reference: &dyn Fn(f64) -> SVector<T, NX>,
        workspace: &mut K::Workspace,
    ) -> Command<T, NX, NU> {
        let now = self.belief.time().unwrap_or(0.0);
        let x_ref = reference(now);
        if self.belief.is_lost() {
            return self.without_state(x_ref);
        }
        let FeedbackSettings {
            delay,
            period,
            preview,
            ..
        } = self.settings;
        if preview {
            let (t_s, delay) = (to_f64(self.t_s()), to_f64(delay));
            let at = |i: usize| reference(now + i as f64 * t_s + delay);
            self.window.look(self.planner.horizon(), at);
        } else {
            self.window.hold(x_ref);
        }
        self.start = self.belief.ahead(&self.commands, delay);
        let plan = self.planner.plan(
            &self.start,
            &self.belief.disturbance(),
            &self.allowed(),
            &self.window.reference(),
            workspace,
        );
        let input = self.planner.input(period);
        self.command(input, x_ref, plan)
    }

    /// The command at a sample of the sensors between two decisions: see
    /// [`Regulator::between`](super::Regulator::between).
    pub fn between(&mut self) -> Option<SVector<T, NU>> {
        let input = self.planner.next_of_ramp(self.settings.period)?;
        Some(self.send(input))
    }

    /// Goes on from where `previous` stands: see
    /// [`Regulator::take_over`](super::Regulator::take_over).
    pub fn take_over(&mut self, previous: &Self) {
        self.belief.take_over(&previous.belief);
        self.commands.copy_from(&previous.commands);
        self.commanded = previous.commanded;
        self.set_share(previous.share);
        self.start = previous.start;
        self.window.copy_from(&previous.window);
        let ramped = previous.planner.next_input();
        let next = ramped.unwrap_or(previous.commanded);
        self.planner.take_over(&previous.planner, &next);
    }

    /// Plans within this magnitude of each input from now on; infinite for all that its bounds
    /// allow. A planner whose bounds must not change keeps to them.
    pub fn set_share(&mut self, share: SVector<T, NU>) {
        if self.largest_inputs().is_some() {
            self.share = share;
        }
    }

    /// The largest magnitude of each input that the last plan commands; `None` from a planner whose
    /// bounds must not change.
    pub fn largest_inputs(&self) -> Option<SVector<T, NU>> {
        self.planner.largest_inputs()
    }

    /// The cost J of the last plan, constant terms included.
    pub fn cost(&self) -> T {
        self.planner.cost(&self.start, &self.window.reference())
    }

    /// The state that the model reaches under the last plan `i` + 1 samples later.
    pub fn predicted(&self, i: usize) -> Option<SVector<T, NX>> {
        self.planner.predicted(i)
    }

    /// The bound `i` of those that are active in the last plan.
    pub fn active_bound(&self, i: usize) -> Option<BoundId> {
        self.planner.active_bound(i)
    }

    /// The bounds of the input that is commanded.
    pub(super) fn allowed(&self) -> Bounds<T, NU> {
        let within = |bound: &SVector<T, NU>| bound.sup(&-self.share).inf(&self.share);
        Bounds {
            lower: within(&self.settings.u.lower),
            upper: within(&self.settings.u.upper),
        }
    }

    /// Sends an input, within its bounds to rounding.
    fn send(&mut self, input: SVector<T, NU>) -> SVector<T, NU> {
        self.commanded = self.allowed().project(&input);
        self.commands.command(self.commanded, self.settings.delay);
        self.commanded
    }

    /// While there is no state to decide for, there is no input.
    pub(super) fn without_state(&mut self, x_ref: SVector<T, NX>) -> Command<T, NX, NU> {
        let nothing = Planned {
            status: Status::NotFinite,
            active_bounds: 0,
            gap: SVector::zeros(),
            guarantee: None,
        };
        let command = self.command(SVector::zeros(), x_ref, nothing);
        self.planner.rest_at(&command.u);
        command
    }

    pub(super) fn command(
        &mut self,
        input: SVector<T, NU>,
        x_ref: SVector<T, NX>,
        plan: Planned<T, NX>,
    ) -> Command<T, NX, NU> {
        Command {
            u: self.send(input),
            estimate: self.belief.state(),
            x_ref,
            status: plan.status,
            active_bounds: plan.active_bounds,
            gap: plan.gap,
            guarantee: plan.guarantee,
        }
    }
}

/// A number of the controller as a time on the clock of the stamps.
fn to_f64<T: Scalar>(seconds: T) -> f64 {
    try_convert(seconds).unwrap_or(0.0)
}
