//! Regulators of one plane of a robot.

use crate::handover::{Handover, Plan, PlanKind};
use ballbot::{Ballbot, Controller, GuardedController};
use lpvmpc::ActiveSet;
use lpvmpc_sim::{GuardedFeedback, Regulator, StateFeedback};
use std::rc::Rc;

/// A regulator of one plane, which may share the motors with that of another, and can take the
/// place of one with other settings. The sensors are those of (phi, theta, phi_dot, theta_dot).
pub trait PlaneRegulator: Regulator<4, 1, 4> {
    /// The largest torque of the last plan, N m; infinite for one that keeps to an equal share.
    fn largest_torque(&self) -> f64 {
        f64::INFINITY
    }

    /// Plans within this torque from now on, N m.
    fn set_share(&mut self, _torque: f64) {}

    /// What the regulator that takes its place has to know.
    fn hand_over(&self) -> Handover;

    /// Takes the place of the regulator that left this. With the same settings it goes on as that
    /// one would have, to the last bit.
    fn take_over(&mut self, handover: &Handover);
}

impl<R: PlaneRegulator + ?Sized> PlaneRegulator for Box<R> {
    fn largest_torque(&self) -> f64 {
        (**self).largest_torque()
    }

    fn set_share(&mut self, torque: f64) {
        (**self).set_share(torque);
    }

    fn hand_over(&self) -> Handover {
        (**self).hand_over()
    }

    fn take_over(&mut self, handover: &Handover) {
        (**self).take_over(handover);
    }
}

/// The guarantee is for bounds that stay: it keeps to an equal share.
impl PlaneRegulator for GuardedFeedback<Ballbot<f64>, 4, 1, 3, 5> {
    fn hand_over(&self) -> Handover {
        let plan = PlanKind::Guarded(Rc::new((
            self.controller.clone(),
            self.workspace.warm_start().clone(),
        )));
        Handover::of_state(self.measured, self.input[0], Some(plan))
    }

    fn take_over(&mut self, handover: &Handover) {
        self.measured = handover.measured;
        self.input[0] = handover.torque;
        let Some(PlanKind::Guarded(previous)) = &handover.plan else {
            return;
        };
        // With other settings its plan is backed by nothing.
        if let Some((previous, active)) = previous.downcast_ref::<Guarded>()
            && previous.settings() == self.controller.settings()
            && previous.model() == self.controller.model()
        {
            self.controller = previous.clone();
            self.workspace.set_warm_start(active);
        }
    }
}

/// A guarded controller and the warm start of its next program.
type Guarded = (GuardedController<f64>, ActiveSet<f64>);

impl PlaneRegulator for StateFeedback<Box<Controller<f64>>, 4, 1> {
    fn hand_over(&self) -> Handover {
        let controller = self.controller();
        let torque = controller.solution().u[0][0];
        let plan = Plan::of(controller).map(PlanKind::Held);
        Handover::of_state(*self.measured(), torque, plan)
    }

    fn take_over(&mut self, handover: &Handover) {
        self.set_measured(handover.measured);
        if let Some(PlanKind::Held(plan)) = &handover.plan {
            plan.hand_to(self.controller_mut());
        }
    }
}
