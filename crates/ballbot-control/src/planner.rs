//! What plans the torque of a plane.

use crate::handover::{Handover, Plan, PlanKind};
use lpvmpc::{BoundId, Bounds, Controller, LpvModel, Reference, Solution, Workspace};
use lpvmpc_sim::Decision;
use nalgebra::{SVector, Vector1, Vector4};
use std::time::Duration;

/// Plans the torque of a plane from a state.
pub(crate) trait Planner {
    /// Sampling time, s.
    fn t_s(&self) -> f64;

    /// Plans from `z`, the state in the model's coordinates at which the torque will act. The
    /// model's torque is the commanded one and the `disturbance` (N m), so the bounds of the
    /// commanded one, `allowed`, are shifted. `reference` is that of the stages from 0 on, `clock`
    /// a monotonic clock. Returns what is to be said about the plan, with torque, estimate and
    /// reference left zero, and the torque to be commanded (N m) unless that is a ramp.
    fn plan(
        &mut self,
        z: &Vector4<f64>,
        disturbance: f64,
        allowed: &Bounds<f64, 1>,
        reference: &dyn Fn(usize) -> Vector4<f64>,
        clock: &dyn Fn() -> Duration,
    ) -> (Decision<4, 1>, Option<f64>);

    /// The torque in the middle of the coming `period` s while it moves in a ramp, N m; `None`
    /// while it is held.
    fn next_of_ramp(&mut self, _period: f64) -> Option<f64> {
        None
    }

    /// The states that the model reaches under the last plan, one per sample of the horizon.
    fn prediction(&self) -> Vec<Vector4<f64>>;

    /// The bounds that are active in the last plan, as those of the robot; the rate of the torque
    /// counts as a second input.
    fn active_bounds(&self) -> Vec<BoundId>;

    /// Forgets the last plan: the next one is made without it.
    fn forget_plan(&mut self);

    /// The last plan, to be handed over.
    fn last_plan(&self) -> Option<PlanKind>;

    /// Where the torque is at the next sample while it moves in a ramp, N m; `None` while it is
    /// held.
    fn next_torque(&self) -> Option<f64> {
        None
    }

    /// Goes on from the plan and the torque of another planner.
    fn go_on_from(&mut self, handover: &Handover);

    /// Whether its bounds may change from sample to sample.
    fn can_share(&self) -> bool {
        false
    }

    /// The largest torque that the last plan commands beside the `disturbance`, N m; infinite from
    /// one that cannot share.
    fn largest_torque(&self, _disturbance: f64) -> f64 {
        f64::INFINITY
    }
}

/// The torque is held over a sample.
pub(crate) struct Held {
    pub(crate) controller: ballbot::Controller<f64>,
    pub(crate) workspace: ballbot::Workspace<f64>,
}

impl Planner for Held {
    fn t_s(&self) -> f64 {
        self.controller.settings().t_s
    }

    fn plan(
        &mut self,
        z: &Vector4<f64>,
        disturbance: f64,
        allowed: &Bounds<f64, 1>,
        reference: &dyn Fn(usize) -> Vector4<f64>,
        clock: &dyn Fn() -> Duration,
    ) -> (Decision<4, 1>, Option<f64>) {
        let Self {
            controller,
            workspace,
        } = self;
        let x = controller.settings().x;
        // Bounds that are not numbers are refused; the state is none either then, and the plan
        // says so.
        controller.set_bounds(x, shifted(allowed, disturbance)).ok();
        let (input, decision) = step(controller, workspace, z, reference, clock);
        (decision, Some(input - disturbance))
    }

    fn prediction(&self) -> Vec<Vector4<f64>> {
        self.controller.rollout().to_vec()
    }

    fn active_bounds(&self) -> Vec<BoundId> {
        let active = self.controller.solution().active.iter();
        active.map(|row| row.bound).collect()
    }

    fn forget_plan(&mut self) {
        self.controller.reset();
    }

    fn last_plan(&self) -> Option<PlanKind> {
        Plan::of(&self.controller).map(PlanKind::Held)
    }

    fn go_on_from(&mut self, handover: &Handover) {
        if let Some(PlanKind::Held(plan)) = &handover.plan {
            plan.hand_to(&mut self.controller);
        }
    }

    fn can_share(&self) -> bool {
        true
    }

    fn largest_torque(&self, disturbance: f64) -> f64 {
        let plan = self.controller.solution().u.iter();
        plan.fold(0.0, |most, u| most.max((u[0] - disturbance).abs()))
    }
}

/// The bounds of the commanded torque as those of the model's, which has the `disturbance` on top.
pub(crate) fn shifted(allowed: &Bounds<f64, 1>, disturbance: f64) -> Bounds<f64, 1> {
    Bounds {
        lower: allowed.lower.add_scalar(disturbance),
        upper: allowed.upper.add_scalar(disturbance),
    }
}

/// One step of `controller` from `x`: its first input, and what is to be said about the plan. What
/// of the state lies beyond the robot's four is to be zero.
pub(crate) fn step<P, const NX: usize>(
    controller: &mut Controller<P, f64, NX, 1, 3>,
    workspace: &mut Workspace<f64, NX, 1>,
    x: &SVector<f64, NX>,
    reference: &dyn Fn(usize) -> Vector4<f64>,
    clock: &dyn Fn() -> Duration,
) -> (f64, Decision<4, 1>)
where
    P: LpvModel<f64, NX, 1, 3>,
{
    let horizon = controller.settings().horizon;
    let at = |i: usize| {
        let robot = reference(i);
        SVector::<f64, NX>::from_fn(|j, _| robot.get(j).copied().unwrap_or(0.0))
    };
    let stages: Vec<SVector<f64, NX>> = (0..horizon).map(at).collect();
    let window = Reference {
        stages: &stages,
        terminal: at(horizon),
    };
    let before = clock();
    let plan: &Solution<f64, NX, 1> = controller.step(x, &window, workspace);
    let step_time = clock().saturating_sub(before);
    let (input, status, active_bounds) = (plan.u[0][0], plan.status, plan.active.len());
    let decision = Decision {
        u: Vector1::zeros(),
        estimate: Vector4::zeros(),
        x_ref: Vector4::zeros(),
        cost: controller.tracking_cost(x, &window),
        status,
        active_bounds,
        step_time,
        gap: Vector4::zeros(),
        guard: None,
    };
    (input, decision)
}
