//! The controller on a real robot: estimate, predict to the moment when the torque acts, decide.

use crate::planner::Planner;
use crate::sharing::SharingPlane;
use ballbot::Ballbot;
use lpvmpc::{BoundId, Bounds, DelayLine, Estimator, Reading, Rk4};
use lpvmpc_sim::{Decision, Measurement, Regulator};
use nalgebra::{Vector1, Vector4};
use std::time::Duration;

/// Torques that can be on their way at once.
const MOST_COMMANDS: usize = 256;

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

impl OutputFeedback {
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
}

impl SharingPlane for OutputFeedback {
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
        let (decision, held) = self.planner.plan(&z, disturbance, &allowed, &ahead, clock);
        let torque = held.or_else(|| self.planner.next_of_ramp(self.period));
        Decision {
            u: self.send(torque.unwrap_or(0.0)),
            estimate: self.belief.state(),
            x_ref: reference(k as f64 * t_s),
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
