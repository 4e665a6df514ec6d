//! The input is held over a sample.

use super::planner::{Planned, Planner, shifted};
use crate::controller::{Controller, Reference};
use crate::model::{LpvModel, Scalar};
use crate::ocp::Bounds;
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
        let controller = &mut self.controller;
        let (x, u) = (controller.settings().x, shifted(allowed, disturbance));
        if u != controller.settings().u {
            // Bounds that are NaN are refused; the state is none either then, and the
            // plan says so.
            controller.set_bounds(x, u).ok();
        }
        let plan = controller.step(z, reference, workspace);
        let (status, active_bounds) = (plan.status, plan.active.len());
        self.input = plan.first_input() - disturbance;
        Planned {
            status,
            active_bounds,
            gap: controller.gap(),
            guarantee: None,
        }
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
        self.input = *commanded;
        self.controller.take_over(&previous.controller);
    }

    fn largest_inputs(&self, disturbance: &SVector<T, NU>) -> Option<SVector<T, NU>> {
        let plan = self.controller.solution().u.iter();
        Some(plan.fold(SVector::zeros(), |most, u| {
            most.sup(&(u - disturbance).abs())
        }))
    }
}
