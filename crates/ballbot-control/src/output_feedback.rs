//! The controller on a real robot: estimate, predict to the moment when the torque acts, decide.

use crate::handover::{Commands, Filter, Handover};
use crate::plane_regulator::PlaneRegulator;
use crate::planner::Planner;
use ballbot::Ballbot;
use lpvmpc::{BoundId, Bounds, Observation, Reading, Rk4, Status, Verdict};
use lpvmpc_sim::{Decision, MeasuredState, Measurement, Regulator};
use nalgebra::{Vector1, Vector4};
use std::time::Duration;

/// One plane's controller with all that stands around it.
pub(crate) struct OutputFeedback {
    pub(crate) belief: Belief,
    pub(crate) planner: Box<dyn Planner>,
    /// Time from a measurement to the torque that answers it, s.
    pub(crate) delay: f64,
    /// Time from one measurement to the next, s.
    pub(crate) period: f64,
    pub(crate) preview: bool,
    /// Bounds of the torque by the scenario, N m.
    pub(crate) torque: Bounds<f64, 1>,
    /// Largest torque that the other plane leaves, N m.
    pub(crate) share: f64,
    pub(crate) commands: Commands,
    /// The torque that was commanded last, N m.
    pub(crate) commanded: f64,
}

/// Where the state comes from.
pub(crate) enum Belief {
    /// From the readings themselves.
    Measured {
        model: Ballbot<f64>,
        longest_step: f64,
        measured: MeasuredState<4>,
    },
    /// From the filter.
    Estimated(Box<Filter>),
}

impl Belief {
    /// The state in the model's coordinates.
    fn model_state(&self) -> Vector4<f64> {
        match self {
            Self::Measured { measured, .. } => *measured.state(),
            Self::Estimated(filter) => *filter.model_state(),
        }
    }

    /// The torque that acts besides the commanded one, N m.
    fn disturbance(&self) -> f64 {
        match self {
            Self::Measured { .. } => 0.0,
            Self::Estimated(filter) => filter.input_disturbance()[0],
        }
    }

    fn state(&self) -> Vector4<f64> {
        match self {
            Self::Measured { measured, .. } => *measured.state(),
            Self::Estimated(filter) => filter.state(),
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
            Self::Estimated(filter) => filter.predict(z, u, duration),
        }
    }

    /// Takes in a measurement after the torques in `commands`, which elapse.
    fn observe(&mut self, measurement: &Measurement<4>, commands: &mut Commands) -> Observation<4> {
        match self {
            Self::Measured { measured, .. } => {
                let (elapsed, observation) = measured.observe(measurement);
                commands.elapse(elapsed);
                observation
            }
            Self::Estimated(filter) => {
                let reading = |i: usize| {
                    let age = measurement.ages[i];
                    measurement.values[i].map(|value| Reading { value, age })
                };
                // phi, theta and theta_dot; the filter does without phi_dot.
                let readings = [0, 1, 3].map(reading);
                let Observation { verdicts, restart } =
                    filter.observe(measurement.t, commands, &readings);
                let [phi, theta, theta_dot] = verdicts;
                Observation {
                    verdicts: [phi, theta, Verdict::NotNeeded, theta_dot],
                    restart,
                }
            }
        }
    }

    /// Stamp of the last measurement, s.
    fn time(&self) -> Option<f64> {
        match self {
            Self::Measured { measured, .. } => measured.time(),
            Self::Estimated(filter) => filter.time(),
        }
    }

    /// Whether there is no state to decide for.
    fn is_lost(&self) -> bool {
        match self {
            Self::Measured { .. } => false,
            Self::Estimated(filter) => filter.is_lost(),
        }
    }

    fn take_over(&mut self, handover: &Handover) {
        match (self, &handover.filter) {
            (Self::Measured { measured, .. }, _) => *measured = handover.measured,
            (Self::Estimated(filter), Some(previous)) => filter.take_over(previous),
            (Self::Estimated(filter), None) => {
                filter.begin_at(handover.measured.time(), *handover.measured.state());
            }
        }
    }
}

impl OutputFeedback {
    /// The state, in the model's coordinates, at which a torque decided now will act.
    fn state_ahead(&self) -> Vector4<f64> {
        let mut z = self.belief.model_state();
        self.commands.for_each(self.delay, |duration, u| {
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
        self.commands.command(u, self.delay);
        self.commanded = u[0];
        u
    }
}

impl OutputFeedback {
    /// The decision while there is no state to decide for: no torque.
    fn without_state(&mut self, x_ref: Vector4<f64>) -> Decision<4, 1> {
        Decision {
            u: self.send(0.0),
            estimate: self.belief.state(),
            x_ref,
            cost: f64::NAN,
            status: Status::NotFinite,
            active_bounds: 0,
            step_time: Duration::ZERO,
            gap: Vector4::zeros(),
            guard: None,
        }
    }
}

impl PlaneRegulator for OutputFeedback {
    fn hand_over(&self) -> Handover {
        let (measured, filter) = match &self.belief {
            Belief::Measured { measured, .. } => (*measured, None),
            Belief::Estimated(filter) => {
                let known = MeasuredState::known(filter.state(), filter.time());
                (known, Some(filter.clone()))
            }
        };
        Handover {
            measured,
            filter,
            commands: self.commands.clone(),
            torque: self.commanded,
            next_torque: self.planner.next_torque().unwrap_or(self.commanded),
            share: self.share,
            plan: self.planner.last_plan(),
        }
    }

    fn take_over(&mut self, handover: &Handover) {
        self.belief.take_over(handover);
        self.commands = handover.commands.clone();
        self.commanded = handover.torque;
        self.set_share(handover.share);
        self.planner.go_on_from(handover);
    }

    fn largest_torque(&self) -> f64 {
        self.planner.largest_torque(self.belief.disturbance())
    }

    fn set_share(&mut self, torque: f64) {
        if self.planner.can_share() {
            self.share = torque;
        }
    }
}

impl Regulator<4, 1, 4> for OutputFeedback {
    fn t_s(&self) -> f64 {
        self.planner.t_s()
    }

    fn observe(&mut self, measurement: &Measurement<4>) -> Observation<4> {
        let observation = self.belief.observe(measurement, &mut self.commands);
        if observation.restart.is_some() {
            // The plan belongs to the state before.
            self.planner.forget_plan();
        }
        observation
    }

    fn decide(
        &mut self,
        reference: &dyn Fn(f64) -> Vector4<f64>,
        clock: &dyn Fn() -> Duration,
    ) -> Decision<4, 1> {
        let (t_s, delay, preview) = (self.t_s(), self.delay, self.preview);
        let now = self.belief.time().unwrap_or(0.0);
        let ahead = |i: usize| match preview {
            true => reference(now + i as f64 * t_s + delay),
            false => reference(now),
        };
        if self.belief.is_lost() {
            return self.without_state(reference(now));
        }
        let z = self.state_ahead();
        let disturbance = self.belief.disturbance();
        let allowed = self.allowed();
        let (decision, held) = self.planner.plan(&z, disturbance, &allowed, &ahead, clock);
        let torque = held.or_else(|| self.planner.next_of_ramp(self.period));
        Decision {
            u: self.send(torque.unwrap_or(0.0)),
            estimate: self.belief.state(),
            x_ref: reference(now),
            ..decision
        }
    }

    fn between(&mut self) -> Option<Vector1<f64>> {
        let torque = self.planner.next_of_ramp(self.period)?;
        Some(self.send(torque))
    }

    fn prediction(&self) -> Vec<Vector4<f64>> {
        self.planner.prediction()
    }

    fn active_bounds(&self) -> Vec<BoundId> {
        self.planner.active_bounds()
    }
}
