//! The torque as a fifth state, its rate as the input.

use crate::feedback::Feedback;
use crate::handover::{Handover, Plan, PlanKind};
use crate::plane_regulator::PlaneRegulator;
use crate::planner::{Planner, shifted, step};
use crate::regulators::{RegulatorError, with_planner};
use ballbot::Ballbot;
use lpvmpc::{
    BoundId, Bounds, Controller, ControllerSettings, Quantity, RampedInput, Status, Workspace,
};
use lpvmpc_sim::Decision;
use nalgebra::{SVector, Vector1, Vector4};
use std::time::Duration;

/// Output feedback whose torque moves in ramps. `settings` are those of the plant with the torque
/// as fifth state, `torque` the bounds of the commanded torque (N m); `period` is that of the
/// sensors, s.
///
/// # Errors
/// Estimator or controller refuses its settings.
pub fn ramped_feedback(
    ballbot: &Ballbot<f64>,
    settings: &ControllerSettings<f64, 5, 1, 3>,
    torque: &Bounds<f64, 1>,
    feedback: &Feedback,
    period: f64,
) -> Result<Box<dyn PlaneRegulator>, RegulatorError> {
    let controller = Controller::allocate(RampedInput(*ballbot), *settings)?;
    let planner = Ramped {
        workspace: controller.workspace(),
        controller,
        torque: 0.0,
        rate: 0.0,
    };
    with_planner(Box::new(planner), ballbot, torque, feedback, period)
}

struct Ramped {
    controller: Controller<RampedInput<Ballbot<f64>, 4>, f64, 5, 1, 3>,
    workspace: Workspace<f64, 5, 1>,
    /// The commanded torque, N m.
    torque: f64,
    /// Its rate, N m/s.
    rate: f64,
}

impl Planner for Ramped {
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
            ..
        } = self;
        let allowed = shifted(allowed, disturbance);
        let ControllerSettings { mut x, u, .. } = *controller.settings();
        (x.lower[4], x.upper[4]) = (allowed.lower[0], allowed.upper[0]);
        // Bounds that are not numbers are refused; the state is none either then, and the plan
        // says so.
        controller.set_bounds(x, u).ok();
        let torque = Vector1::new(self.torque + disturbance);
        let joint = RampedInput::<Ballbot<f64>, 4>::join(z, &torque);
        let (rate, mut decision) = step(controller, workspace, &joint, reference, clock);
        self.rate = rate;
        if let Status::Infeasible(bound) = &mut decision.status {
            *bound = of_the_robot(*bound);
        }
        (decision, None)
    }

    fn next_of_ramp(&mut self, period: f64) -> Option<f64> {
        let step = self.rate * period;
        self.torque += step;
        Some(self.torque - 0.5 * step)
    }

    fn forget_plan(&mut self) {
        self.controller.reset();
    }

    fn last_plan(&self) -> Option<PlanKind> {
        Plan::of(&self.controller).map(PlanKind::Ramped)
    }

    fn next_torque(&self) -> Option<f64> {
        Some(self.torque)
    }

    fn go_on_from(&mut self, handover: &Handover) {
        self.torque = handover.next_torque;
        if let Some(PlanKind::Ramped(plan)) = &handover.plan {
            plan.hand_to(&mut self.controller);
        }
    }

    fn prediction(&self) -> Vec<Vector4<f64>> {
        let robot = |joint: &SVector<f64, 5>| joint.fixed_rows::<4>(0).into_owned();
        self.controller.rollout().iter().map(robot).collect()
    }

    fn active_bounds(&self) -> Vec<BoundId> {
        let active = self.controller.solution().active.iter();
        active.map(|row| of_the_robot(row.bound)).collect()
    }
}

/// A bound of the plant with the torque as fifth state, as one of the robot: the torque is its
/// input 0, and the torque's rate counts as input 1.
fn of_the_robot(bound: BoundId) -> BoundId {
    let quantity = match bound.quantity {
        Quantity::State(4) => Quantity::Input(0),
        Quantity::Input(index) => Quantity::Input(index + 1),
        robot => robot,
    };
    BoundId { quantity, ..bound }
}
