//! The guaranteed loop as a planner.

use super::Guarantee;
use super::planner::{Planned, Planner};
use crate::controller::Reference;
use crate::guaranteed::{GuaranteedController, GuaranteedSettings, GuaranteedWorkspace, SetPoints};
use crate::list::List;
use crate::model::{LpvModel, Scalar};
use crate::ocp::Bounds;
use crate::solution::{ActiveSet, BoundId, PackedRow};
use nalgebra::SVector;

/// Plans with a [`GuaranteedController`]; `NA` is `NX` + 1.
///
/// The wanted set points are the reference's coordinates along the direction of the set points. The
/// bounds are those of its certificate, whatever is allowed otherwise.
#[derive(Debug)]
#[cfg_attr(feature = "alloc", derive(Clone))]
pub struct Guaranteed<
    P,
    T: 'static,
    const NX: usize,
    const NU: usize,
    const NS: usize,
    const NA: usize,
> {
    controller: GuaranteedController<P, T, NX, NU, NS>,
    /// Wanted set points at the stages.
    wanted: List<T>,
    /// The warm start of the next program: the workspace may serve another controller until then.
    warm_start: ActiveSet<T>,
    /// The input to be commanded.
    input: SVector<T, NU>,
    /// Cost of the last plan.
    cost: T,
}

/// Memory of a [`Guaranteed`] planner besides its controller's.
#[derive(Debug)]
pub struct GuaranteedPlannerMemory<T: 'static> {
    /// A wanted set point for each stage of the horizon.
    pub wanted: List<T>,
    /// Rows of the next warm start, as many as may be active.
    pub warm_start: List<PackedRow<T>>,
}

impl<P, T, const NX: usize, const NU: usize, const NS: usize, const NA: usize>
    Guaranteed<P, T, NX, NU, NS, NA>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
{
    /// A planner with this controller.
    pub fn new(
        controller: GuaranteedController<P, T, NX, NU, NS>,
        memory: GuaranteedPlannerMemory<T>,
    ) -> Self {
        Self {
            controller,
            wanted: memory.wanted,
            warm_start: ActiveSet::new(memory.warm_start),
            input: SVector::zeros(),
            cost: T::zero() / T::zero(),
        }
    }

    /// The same with memory of its own.
    #[cfg(feature = "alloc")]
    pub fn allocate(controller: GuaranteedController<P, T, NX, NU, NS>) -> Self {
        let settings = controller.settings();
        let memory = GuaranteedPlannerMemory {
            wanted: List::repeat(T::zero(), settings.horizon),
            warm_start: List::repeat(PackedRow::empty(), settings.capacity().active),
        };
        Self::new(controller, memory)
    }

    /// The controller.
    pub fn controller(&self) -> &GuaranteedController<P, T, NX, NU, NS> {
        &self.controller
    }
}

impl<P, T, const NX: usize, const NU: usize, const NS: usize, const NA: usize> Planner<T, NX, NU>
    for Guaranteed<P, T, NX, NU, NS, NA>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS> + PartialEq,
{
    type Workspace = GuaranteedWorkspace<T, NU, NA>;

    fn t_s(&self) -> T {
        self.controller.settings().t_s
    }

    fn horizon(&self) -> usize {
        self.controller.settings().horizon
    }

    fn plan(
        &mut self,
        z: &SVector<T, NX>,
        _disturbance: &SVector<T, NU>,
        _allowed: &Bounds<T, NU>,
        reference: &Reference<'_, T, NX>,
        workspace: &mut Self::Workspace,
    ) -> Planned<T, NX> {
        let GuaranteedSettings { direction, .. } = *self.controller.settings();
        let coordinate = |x: &SVector<T, NX>| x.dot(&direction) / direction.norm_squared();
        let seen = reference.stages.len().min(self.wanted.len());
        for (place, x_ref) in self.wanted.iter_mut().zip(reference.stages) {
            *place = coordinate(x_ref);
        }
        let wanted = SetPoints {
            stages: self.wanted.get(..seen).unwrap_or_default(),
            end: coordinate(&reference.terminal),
        };
        workspace.set_warm_start(&self.warm_start);
        let step = self.controller.step_with_preview(z, &wanted, workspace);
        self.warm_start.copy_from(workspace.warm_start());
        (self.input, self.cost) = (step.u, step.cost);
        Planned {
            status: step.status,
            active_bounds: workspace.active_bounds(),
            gap: step.gap,
            guarantee: Some(Guarantee {
                decision: step.decision,
                set_point: step.set_point,
            }),
        }
    }

    fn input(&mut self, _period: T) -> SVector<T, NU> {
        self.input
    }

    fn cost(&self, _z: &SVector<T, NX>, _reference: &Reference<'_, T, NX>) -> T {
        self.cost
    }

    fn predicted(&self, i: usize) -> Option<SVector<T, NX>> {
        self.controller.rollout().nth(i).copied()
    }

    fn active_bound(&self, i: usize) -> Option<BoundId> {
        self.controller.active_bounds().nth(i)
    }

    /// Whether its plan still holds for the state, it finds out by itself.
    fn forget_plan(&mut self) {}

    /// With another model or other settings the plan is backed by nothing, and is left behind.
    fn take_over(&mut self, previous: &Self, commanded: &SVector<T, NU>) {
        self.input = *commanded;
        if self.controller.take_over(&previous.controller) {
            self.warm_start.copy_from(&previous.warm_start);
        }
    }
}
