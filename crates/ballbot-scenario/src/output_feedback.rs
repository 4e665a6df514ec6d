//! The controller on a real robot: estimate, predict to the moment when the torque acts, decide.

use crate::three_motors::SharingPlane;
use ballbot::Ballbot;
use lpvmpc::{
    BoundId, Bounds, Controller, ControllerSettings, DelayLine, Estimator, LpvModel, Quantity,
    RampedInput, Reading, Reference, Rk4, Solution, Workspace,
};
use lpvmpc_sim::{Decision, Measurement, Regulator};
use nalgebra::{SVector, Vector1, Vector4};
use std::time::Duration;

/// Torques that can be on their way at once.
const MOST_COMMANDS: usize = 256;

/// One plane's controller with all that stands around it.
pub(crate) struct OutputFeedback<const N: usize, const M: usize> {
    pub(crate) belief: Belief,
    pub(crate) core: Core<N, M>,
    /// Time from a measurement to the torque that answers it, s.
    pub(crate) delay: f64,
    /// Time from one measurement to the next, s.
    pub(crate) period: f64,
    pub(crate) preview: bool,
    /// Bounds of the torque by the scenario, N m.
    pub(crate) torque: Bounds<f64, 1>,
    /// Largest torque that the other plane leaves, N m.
    pub(crate) share: f64,
    pub(crate) line: DelayLine<f64, 1, MOST_COMMANDS>,
    /// Time of the last measurement, s.
    pub(crate) time: f64,
}

/// Where the state comes from.
pub(crate) enum Belief {
    /// From the readings themselves.
    Measured {
        model: Ballbot<f64>,
        longest_step: f64,
        x: Vector4<f64>,
    },
    /// From the filter.
    Estimated(Box<Estimator<Ballbot<f64>, f64, 4, 1, 3, 3, 2>>),
}

/// The controller's model: torque, or rate of the torque.
pub(crate) enum Core<const N: usize, const M: usize> {
    Held {
        controller: Box<Controller<Ballbot<f64>, f64, 4, 1, 3, N, M>>,
        workspace: Box<Workspace<f64, 4, 1, N, M>>,
    },
    Ramped {
        controller: Box<Controller<RampedInput<Ballbot<f64>, 4>, f64, 5, 1, 3, N, M>>,
        workspace: Box<Workspace<f64, 5, 1, N, M>>,
        /// The commanded torque, N m, and its rate, N m/s.
        torque: f64,
        rate: f64,
    },
}

impl Belief {
    /// The state in the model's coordinates.
    fn model_state(&self) -> Vector4<f64> {
        match self {
            Self::Measured { x, .. } => *x,
            Self::Estimated(estimator) => *estimator.model_state(),
        }
    }

    /// The torque that acts besides the commanded one, N m.
    fn disturbance(&self) -> f64 {
        match self {
            Self::Measured { .. } => 0.0,
            Self::Estimated(estimator) => estimator.input_disturbance()[0],
        }
    }

    fn state(&self) -> Vector4<f64> {
        match self {
            Self::Measured { x, .. } => *x,
            Self::Estimated(estimator) => estimator.state(),
        }
    }

    fn predict(&self, z: &Vector4<f64>, u: &Vector1<f64>, duration: f64) -> Vector4<f64> {
        match self {
            Self::Measured {
                model,
                longest_step,
                ..
            } => {
                let substeps = (duration / longest_step).ceil().max(1.0) as usize;
                Rk4 { substeps }.advance(model, z, u, duration)
            }
            Self::Estimated(estimator) => estimator.predict(z, u, duration),
        }
    }

    fn observe(
        &mut self,
        measurement: &Measurement<4>,
        elapsed: f64,
        line: &DelayLine<f64, 1, MOST_COMMANDS>,
    ) {
        match self {
            Self::Measured { x, .. } => {
                for (x, value) in x.iter_mut().zip(&measurement.values) {
                    *x = value.unwrap_or(*x);
                }
            }
            Self::Estimated(estimator) => {
                line.for_each(elapsed, |duration, u| estimator.advance(u, duration));
                let reading = |i: usize| {
                    let age = measurement.ages[i];
                    measurement.values[i].map(|value| Reading { value, age })
                };
                // phi, theta and theta_dot; the filter does without phi_dot.
                let readings = [0, 1, 3].map(reading);
                estimator.update(&readings);
            }
        }
    }
}

/// What a plan says.
struct Plan<const NX: usize> {
    input: f64,
    decision: Decision<4, 1>,
}

impl<const NX: usize> Plan<NX> {
    /// One step of `controller`. The part of the state beyond the robot's is to be zero.
    fn step<P, const N: usize, const M: usize>(
        controller: &mut Controller<P, f64, NX, 1, 3, N, M>,
        workspace: &mut Workspace<f64, NX, 1, N, M>,
        x: &SVector<f64, NX>,
        reference: &dyn Fn(usize) -> Vector4<f64>,
        clock: &dyn Fn() -> Duration,
    ) -> Self
    where
        P: LpvModel<f64, NX, 1, 3>,
    {
        let horizon = controller.settings().horizon;
        let at = |i: usize| {
            let robot = reference(i);
            SVector::<f64, NX>::from_fn(|j, _| robot.get(j).copied().unwrap_or(0.0))
        };
        let mut window: Reference<f64, NX, N> = Reference::constant(at(horizon));
        for (i, place) in window.stages.iter_mut().enumerate().take(horizon) {
            *place = at(i);
        }
        let before = clock();
        let plan: &Solution<f64, NX, 1, N, M> = controller.step(x, &window, workspace);
        let step_time = clock().saturating_sub(before);
        let (input, status, active_bounds) = (plan.u[0][0], plan.status, plan.active.len());
        Self {
            input,
            decision: Decision {
                u: Vector1::zeros(),
                estimate: Vector4::zeros(),
                x_ref: Vector4::zeros(),
                cost: controller.tracking_cost(x, &window),
                status,
                active_bounds,
                step_time,
                gap: Vector4::zeros(),
                guard: None,
            },
        }
    }
}

impl<const N: usize, const M: usize> OutputFeedback<N, M> {
    /// The state, in the model's coordinates, at which a torque decided now will act.
    fn state_ahead(&self) -> Vector4<f64> {
        let mut z = self.belief.model_state();
        self.line.for_each(self.delay, |duration, u| {
            z = self.belief.predict(&z, u, duration)
        });
        z
    }

    /// The bounds of the torque that is commanded, N m.
    fn allowed(&self) -> Bounds<f64, 1> {
        let within = |bound: f64| bound.max(-self.share).min(self.share);
        Bounds {
            lower: self.torque.lower.map(within),
            upper: self.torque.upper.map(within),
        }
    }

    /// Sends a torque, within its bounds to rounding.
    fn send(&mut self, torque: f64) -> Vector1<f64> {
        let u = self.allowed().project(&Vector1::new(torque));
        self.line.command(u, self.delay);
        u
    }

    /// The torque in the middle of the coming period, while it moves in a ramp.
    fn next_of_ramp(&mut self) -> Option<f64> {
        match &mut self.core {
            Core::Held { .. } => None,
            Core::Ramped { torque, rate, .. } => {
                let step = *rate * self.period;
                *torque += step;
                Some(*torque - 0.5 * step)
            }
        }
    }
}

impl<const N: usize, const M: usize> Core<N, M> {
    /// Plans from `z` in the model's coordinates. Its torque is the commanded one and the
    /// `disturbance`, so the bounds of the commanded one are shifted. Returns what is to be
    /// said about the plan, and the torque to be commanded unless that is a ramp.
    fn plan(
        &mut self,
        z: &Vector4<f64>,
        disturbance: f64,
        allowed: &Bounds<f64, 1>,
        reference: &dyn Fn(usize) -> Vector4<f64>,
        clock: &dyn Fn() -> Duration,
    ) -> (Decision<4, 1>, Option<f64>) {
        let [lower, upper] = [&allowed.lower, &allowed.upper].map(|u| u.add_scalar(disturbance));
        match self {
            Self::Held {
                controller,
                workspace,
            } => {
                let x = controller.settings().x;
                // Bounds that are not numbers are refused; the state is none either then, and
                // the plan says so.
                controller.set_bounds(x, Bounds { lower, upper }).ok();
                let plan = Plan::step(controller, workspace, z, reference, clock);
                (plan.decision, Some(plan.input - disturbance))
            }
            Self::Ramped {
                controller,
                workspace,
                torque,
                rate,
            } => {
                let ControllerSettings { mut x, u, .. } = *controller.settings();
                (x.lower[4], x.upper[4]) = (lower[0], upper[0]);
                controller.set_bounds(x, u).ok();
                let torque = Vector1::new(*torque + disturbance);
                let joint = RampedInput::<Ballbot<f64>, 4>::join(z, &torque);
                let plan = Plan::<5>::step(controller, workspace, &joint, reference, clock);
                *rate = plan.input;
                (plan.decision, None)
            }
        }
    }
}

impl<const N: usize, const M: usize> SharingPlane for OutputFeedback<N, M> {
    fn largest_torque(&self) -> f64 {
        let disturbance = self.belief.disturbance();
        match &self.core {
            Core::Held { controller, .. } => {
                let plan = controller.solution().u.iter();
                let plan = plan.take(controller.settings().horizon);
                plan.fold(0.0, |most, u| most.max((u[0] - disturbance).abs()))
            }
            Core::Ramped { .. } => f64::INFINITY,
        }
    }

    fn set_share(&mut self, torque: f64) {
        if let Core::Held { .. } = self.core {
            self.share = torque;
        }
    }
}

impl<const N: usize, const M: usize> Regulator<4, 1, 4> for OutputFeedback<N, M> {
    fn t_s(&self) -> f64 {
        match &self.core {
            Core::Held { controller, .. } => controller.settings().t_s,
            Core::Ramped { controller, .. } => controller.settings().t_s,
        }
    }

    fn observe(&mut self, measurement: &Measurement<4>) {
        let elapsed = measurement.t - self.time;
        self.belief.observe(measurement, elapsed, &self.line);
        self.line.elapse(elapsed);
        self.time = measurement.t;
    }

    fn decide(
        &mut self,
        k: usize,
        reference: &dyn Fn(f64) -> Vector4<f64>,
        clock: &dyn Fn() -> Duration,
    ) -> Decision<4, 1> {
        let (t_s, delay, preview) = (self.t_s(), self.delay, self.preview);
        let ahead = |i: usize| match preview {
            true => reference((k + i) as f64 * t_s + delay),
            false => reference(k as f64 * t_s),
        };
        let z = self.state_ahead();
        let disturbance = self.belief.disturbance();
        let allowed = self.allowed();
        let (decision, first) = self.core.plan(&z, disturbance, &allowed, &ahead, clock);
        let torque = first.or_else(|| self.next_of_ramp()).unwrap_or(0.0);
        Decision {
            u: self.send(torque),
            estimate: self.belief.state(),
            x_ref: reference(k as f64 * t_s),
            ..decision
        }
    }

    fn between(&mut self) -> Option<Vector1<f64>> {
        let torque = self.next_of_ramp()?;
        Some(self.send(torque))
    }

    fn prediction(&self) -> Vec<Vector4<f64>> {
        match &self.core {
            Core::Held { controller, .. } => controller.rollout().to_vec(),
            Core::Ramped { controller, .. } => {
                let robot = |joint: &SVector<f64, 5>| joint.fixed_rows::<4>(0).into_owned();
                controller.rollout().iter().map(robot).collect()
            }
        }
    }

    /// With the torque as a fifth state, its bounds are those of the input, and those of its rate
    /// are left out.
    fn active_bounds(&self) -> Vec<BoundId> {
        match &self.core {
            Core::Held { controller, .. } => {
                let active = controller.solution().active.iter();
                active.map(|row| row.bound).collect()
            }
            Core::Ramped { controller, .. } => {
                let active = controller.solution().active.iter().map(|row| row.bound);
                active.filter_map(of_the_robot).collect()
            }
        }
    }
}

/// A bound of the plant with the torque as fifth state, as one of the robot.
fn of_the_robot(bound: BoundId) -> Option<BoundId> {
    match bound.quantity {
        Quantity::State(4) => Some(BoundId {
            quantity: Quantity::Input(0),
            ..bound
        }),
        Quantity::State(_) => Some(bound),
        Quantity::Input(_) | Quantity::Row(_) => None,
    }
}
