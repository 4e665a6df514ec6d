//! The input is held over a sample.

use super::planner::{Planned, Planner, shifted};
use crate::controller::{Controller, Reference};
use crate::model::{LpvModel, Scalar};
use crate::ocp::Bounds;
use crate::preview::Preview;
use crate::settings::ControllerSettings;
use crate::solution::BoundId;
use crate::workspace::Workspace;
use nalgebra::SVector;

/// Plans with a [`Controller`] of the plant itself.
#[derive(Debug)]
#[cfg_attr(feature = "alloc", derive(Clone))]
pub struct Held<P, T: 'static, const NX: usize, const NU: usize, const NS: usize> {
    controller: Controller<P, T, NX, NU, NS>,
    /// The input to be commanded.
    input: SVector<T, NU>,
    /// What the inputs of the controller's plan have beside the commanded ones.
    beside: SVector<T, NU>,
}

impl<P, T, const NX: usize, const NU: usize, const NS: usize> Held<P, T, NX, NU, NS>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
{
    /// A planner with this controller.
    pub fn new(controller: Controller<P, T, NX, NU, NS>) -> Self {
        Self {
            controller,
            input: SVector::zeros(),
            beside: SVector::zeros(),
        }
    }

    /// [`plan`](Planner::plan) with all that may be known ahead. Wherever the preview speaks of the
    /// input, it is the commanded one; `allowed` holds whatever the bounds of the preview are.
    pub fn plan_with(
        &mut self,
        z: &SVector<T, NX>,
        disturbance: &SVector<T, NU>,
        allowed: &Bounds<T, NU>,
        preview: &Preview<'_, P, T, NX, NU, NS>,
        workspace: &mut Workspace<T, NX, NU>,
    ) -> Planned<T, NX> {
        self.bound(*allowed);
        self.beside = SVector::zeros();
        let beside = Some(disturbance);
        self.controller.step_beside(z, beside, preview, workspace);
        self.planned()
    }

    /// The input to be commanded after a plan.
    pub(super) fn command(&self) -> SVector<T, NU> {
        self.input
    }

    /// The cost J of the last plan, made from `z` with this preview.
    pub fn cost_with(&self, z: &SVector<T, NX>, preview: &Preview<'_, P, T, NX, NU, NS>) -> T {
        self.controller.tracking_cost_with(z, preview)
    }

    /// Plans within these bounds of the controller's input.
    fn bound(&mut self, u: Bounds<T, NU>) {
        let ControllerSettings { x, u: before, .. } = *self.controller.settings();
        if u != before {
            // Bounds that are NaN are refused; the state is none either then, and the
            // plan says so.
            self.controller.set_bounds(x, u).ok();
        }
    }

    /// What is to be said about the controller's plan, whose first input is to be commanded.
    fn planned(&mut self) -> Planned<T, NX> {
        let plan = self.controller.solution();
        let (status, active_bounds) = (plan.status, plan.active.len());
        self.input = plan.first_input() - self.beside;
        Planned {
            status,
            active_bounds,
            gap: self.controller.gap(),
            guarantee: None,
        }
    }

    /// The controller.
    pub fn controller(&self) -> &Controller<P, T, NX, NU, NS> {
        &self.controller
    }
}

impl<P, T, const NX: usize, const NU: usize, const NS: usize> Planner<T, NX, NU>
    for Held<P, T, NX, NU, NS>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
{
    type Workspace = Workspace<T, NX, NU>;

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
        self.bound(shifted(allowed, disturbance));
        self.beside = *disturbance;
        self.controller.step(z, reference, workspace);
        self.planned()
    }

    fn input(&mut self, _period: T) -> SVector<T, NU> {
        self.input
    }

    fn cost(&self, z: &SVector<T, NX>, reference: &Reference<'_, T, NX>) -> T {
        self.controller.tracking_cost(z, reference)
    }

    fn predicted(&self, i: usize) -> Option<SVector<T, NX>> {
        self.controller.rollout().get(i).copied()
    }

    fn active_bound(&self, i: usize) -> Option<BoundId> {
        let active = &self.controller.solution().active;
        active.iter().nth(i).map(|row| row.bound)
    }

    fn forget_plan(&mut self) {
        self.controller.reset();
    }

    fn take_over(&mut self, previous: &Self, commanded: &SVector<T, NU>) {
        (self.input, self.beside) = (*commanded, previous.beside);
        self.controller.take_over(&previous.controller);
    }

    fn largest_inputs(&self) -> Option<SVector<T, NU>> {
        let plan = self.controller.solution().u.iter();
        Some(plan.fold(SVector::zeros(), |most, u| {
            most.sup(&(u - self.beside).abs())
        }))
    }
}
