//! The input moves in ramps: it is a state, and its rate is planned.

use super::planner::{Planned, Planner, shifted};
use super::window::Window;
use crate::controller::{Controller, Reference};
use crate::list::List;
use crate::model::{LpvModel, Scalar};
use crate::ocp::Bounds;
use crate::ramp::RampedInput;
use crate::settings::ControllerSettings;
use crate::solution::{BoundId, Quantity, Status};
use crate::workspace::Workspace;
use nalgebra::{SVector, convert};

/// Plans with a [`Controller`] of the plant whose inputs are states; `NXU` is `NX` + `NU`.
#[derive(Debug)]
#[cfg_attr(feature = "alloc", derive(Clone))]
pub struct Ramped<
    P,
    T: 'static,
    const NX: usize,
    const NU: usize,
    const NS: usize,
    const NXU: usize,
> {
    controller: Controller<RampedInput<P, NX>, T, NXU, NU, NS>,
    /// The reference over the horizon; the inputs have none but the controller's own.
    window: Window<T, NXU>,
    /// State and inputs that the last plan begins with; NaN before the first.
    start: SVector<T, NXU>,
    /// The commanded input.
    input: SVector<T, NU>,
    /// Its rate, in input units per second.
    rate: SVector<T, NU>,
    /// What the input may be; the rate of a program without a solution does not see to it.
    allowed: Bounds<T, NU>,
}

impl<P, T, const NX: usize, const NU: usize, const NS: usize, const NXU: usize>
    Ramped<P, T, NX, NU, NS, NXU>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
{
    /// A planner with this controller, and memory for the reference at each stage of its horizon.
    pub fn new(
        controller: Controller<RampedInput<P, NX>, T, NXU, NU, NS>,
        window: List<SVector<T, NXU>>,
    ) -> Self {
        Self {
            controller,
            window: Window::new(window),
            start: SVector::repeat(convert(f64::NAN)),
            input: SVector::zeros(),
            rate: SVector::zeros(),
            allowed: Bounds::none(),
        }
    }

    /// The same with memory of its own.
    #[cfg(feature = "alloc")]
    pub fn allocate(controller: Controller<RampedInput<P, NX>, T, NXU, NU, NS>) -> Self {
        let window = List::repeat(SVector::zeros(), controller.settings().horizon);
        Self::new(controller, window)
    }

    fn state_of(joint: &SVector<T, NXU>) -> SVector<T, NX> {
        RampedInput::<P, NX>::split::<T, NU, NXU>(joint).0
    }

    /// A bound of the plant whose inputs are states, as one of the plant: an input, or a rate, which
    /// counts as another input.
    fn of_the_plant(bound: BoundId) -> BoundId {
        let quantity = match bound.quantity {
            Quantity::State(index) if index >= NX => Quantity::Input(index - NX),
            Quantity::Input(index) => Quantity::Input(index + NU),
            plant => plant,
        };
        BoundId { quantity, ..bound }
    }
}

impl<P, T, const NX: usize, const NU: usize, const NS: usize, const NXU: usize> Planner<T, NX, NU>
    for Ramped<P, T, NX, NU, NS, NXU>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
{
    type Workspace = Workspace<T, NXU, NU>;

    fn t_s(&self) -> T {
        self.controller.settings().t_s
    }

    fn horizon(&self) -> usize {
        self.controller.settings().horizon
    }

    fn plan(
        &mut self,
        z: &SVector<T, NX>,
        disturbance: &SVector<T, NU>,
        allowed: &Bounds<T, NU>,
        reference: &Reference<'_, T, NX>,
        workspace: &mut Self::Workspace,
    ) -> Planned<T, NX> {
        let join = RampedInput::<P, NX>::join::<T, NU, NXU>;
        let controller = &mut self.controller;
        let ControllerSettings { x, u, .. } = *controller.settings();
        self.allowed = *allowed;
        let allowed = shifted(allowed, disturbance);
        let x = Bounds {
            lower: join(&Self::state_of(&x.lower), &allowed.lower),
            upper: join(&Self::state_of(&x.upper), &allowed.upper),
        };
        if x != controller.settings().x {
            // Bounds that are NaN are refused; the state is none either then, and the
            // plan says so.
            controller.set_bounds(x, u).ok();
        }
        let without_input = |x_ref: &SVector<T, NX>| join(x_ref, &SVector::zeros());
        let horizon = controller.settings().horizon;
        if reference.stages.is_empty() {
            self.window.hold(without_input(&reference.terminal));
        } else {
            self.window
                .look(horizon, |i| without_input(reference.at(i)));
        }
        self.start = join(z, &(self.input + disturbance));
        let plan = controller.step(&self.start, &self.window.reference(), workspace);
        let active_bounds = plan.active.len();
        let status = match plan.status {
            Status::Infeasible(bound) => Status::Infeasible(Self::of_the_plant(bound)),
            status => status,
        };
        self.rate = plan.first_input();
        Planned {
            status,
            active_bounds,
            gap: Self::state_of(&controller.gap()),
            guarantee: None,
        }
    }

    fn input(&mut self, period: T) -> SVector<T, NU> {
        let before = self.input;
        self.input = self.allowed.project(&(before + self.rate * period));
        // The mean over the period.
        self.input - (self.input - before) * convert::<f64, T>(0.5)
    }

    fn next_of_ramp(&mut self, period: T) -> Option<SVector<T, NU>> {
        Some(self.input(period))
    }

    fn next_input(&self) -> Option<SVector<T, NU>> {
        Some(self.input)
    }

    fn cost(&self, _z: &SVector<T, NX>, _reference: &Reference<'_, T, NX>) -> T {
        let reference = self.window.reference();
        self.controller.tracking_cost(&self.start, &reference)
    }

    fn predicted(&self, i: usize) -> Option<SVector<T, NX>> {
        self.controller.rollout().get(i).map(Self::state_of)
    }

    fn active_bound(&self, i: usize) -> Option<BoundId> {
        let active = &self.controller.solution().active;
        active
            .iter()
            .nth(i)
            .map(|row| Self::of_the_plant(row.bound))
    }

    fn forget_plan(&mut self) {
        self.controller.reset();
    }

    fn rest_at(&mut self, commanded: &SVector<T, NU>) {
        (self.input, self.rate) = (*commanded, SVector::zeros());
    }

    fn take_over(&mut self, previous: &Self, commanded: &SVector<T, NU>) {
        (self.input, self.rate) = (*commanded, previous.rate);
        self.allowed = previous.allowed;
        self.start = previous.start;
        self.window.copy_from(&previous.window);
        self.controller.take_over(&previous.controller);
    }
}
