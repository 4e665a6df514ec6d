//! What decides in a closed loop: measurements in, commands out.

use crate::guarded_loop::Guard;
use crate::measured::MeasuredState;
use crate::sensor::Measurement;
use lpvmpc::{BoundId, Controller, LpvModel, Observation, Reference, Status, Workspace};
use nalgebra::SVector;
use std::ops::DerefMut;
use std::time::Duration;

/// What was decided at a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Decision<const NX: usize, const NU: usize> {
    /// The command: finite and within its bounds, whatever the status.
    pub u: SVector<f64, NU>,
    /// The state that it was decided for.
    pub estimate: SVector<f64, NX>,
    /// State reference at the sample.
    pub x_ref: SVector<f64, NX>,
    /// The cost J of the plan (Algorithm 1, constant terms included).
    pub cost: f64,
    /// What the plan is worth.
    pub status: Status<f64>,
    /// Bounds that are active in the plan.
    pub active_bounds: usize,
    /// Time that the controller took, by the clock that was handed in.
    pub step_time: Duration,
    /// Nonlinear rollout minus prediction at the end of the horizon, in state units.
    pub gap: SVector<f64, NX>,
    /// What only a guarded controller knows.
    pub guard: Option<Guard>,
}

/// What stands between the sensors and the actuators.
pub trait Regulator<const NX: usize, const NU: usize, const NY: usize> {
    /// Time from one decision to the next, s.
    fn t_s(&self) -> f64;

    /// Takes in what the sensors deliver, and says what became of it. Called at every sample of
    /// the sensors, in order; at a control sample before [`decide`](Self::decide).
    fn observe(&mut self, measurement: &Measurement<NY>) -> Observation<NY>;

    /// The command from the last measurement on. `reference` is the state reference at a time in
    /// s, on the clock of the measurements' stamps; `clock` is a monotonic clock.
    fn decide(
        &mut self,
        reference: &dyn Fn(f64) -> SVector<f64, NX>,
        clock: &dyn Fn() -> Duration,
    ) -> Decision<NX, NU>;

    /// The command at a sample of the sensors between two control samples, called after
    /// [`observe`](Self::observe); `None` to hold the last one, as most do.
    fn between(&mut self) -> Option<SVector<f64, NU>> {
        None
    }

    /// The states that the model reaches under the last plan, one per sample of the horizon.
    fn prediction(&self) -> Vec<SVector<f64, NX>>;

    /// The bounds of the plant that are active in the last plan; none from a controller that does
    /// not tell.
    fn active_bounds(&self) -> Vec<BoundId> {
        Vec::new()
    }
}

impl<R, const NX: usize, const NU: usize, const NY: usize> Regulator<NX, NU, NY> for Box<R>
where
    R: Regulator<NX, NU, NY> + ?Sized,
{
    fn t_s(&self) -> f64 {
        (**self).t_s()
    }

    fn observe(&mut self, measurement: &Measurement<NY>) -> Observation<NY> {
        (**self).observe(measurement)
    }

    fn decide(
        &mut self,
        reference: &dyn Fn(f64) -> SVector<f64, NX>,
        clock: &dyn Fn() -> Duration,
    ) -> Decision<NX, NU> {
        (**self).decide(reference, clock)
    }

    fn between(&mut self) -> Option<SVector<f64, NU>> {
        (**self).between()
    }

    fn prediction(&self) -> Vec<SVector<f64, NX>> {
        (**self).prediction()
    }

    fn active_bounds(&self) -> Vec<BoundId> {
        (**self).active_bounds()
    }
}

/// The controller on the measured state itself. `K` holds a [`Controller`], in a box or by reference.
#[derive(Debug)]
pub struct StateFeedback<K, const NX: usize, const NU: usize> {
    controller: K,
    workspace: Workspace<f64, NX, NU>,
    measured: MeasuredState<NX>,
}

impl<K, C, const NX: usize, const NU: usize, const NS: usize> StateFeedback<K, NX, NU>
where
    C: LpvModel<f64, NX, NU, NS>,
    K: DerefMut<Target = Controller<C, f64, NX, NU, NS>>,
{
    /// The regulator with this controller and a workspace of its own.
    pub fn new(controller: K) -> Self {
        Self {
            workspace: controller.workspace(),
            controller,
            measured: MeasuredState::new(),
        }
    }

    /// The controller.
    pub fn controller(&self) -> &K {
        &self.controller
    }

    /// The controller, to hand something over to it.
    pub fn controller_mut(&mut self) -> &mut K {
        &mut self.controller
    }

    /// What was measured.
    pub fn measured(&self) -> &MeasuredState<NX> {
        &self.measured
    }

    /// Goes on from what another regulator knows of the state.
    pub fn set_measured(&mut self, measured: MeasuredState<NX>) {
        self.measured = measured;
    }
}

impl<K, C, const NX: usize, const NU: usize, const NS: usize> Regulator<NX, NU, NX>
    for StateFeedback<K, NX, NU>
where
    C: LpvModel<f64, NX, NU, NS>,
    K: DerefMut<Target = Controller<C, f64, NX, NU, NS>>,
{
    fn t_s(&self) -> f64 {
        self.controller.settings().t_s
    }

    fn observe(&mut self, measurement: &Measurement<NX>) -> Observation<NX> {
        self.measured.observe(measurement).1
    }

    fn decide(
        &mut self,
        reference: &dyn Fn(f64) -> SVector<f64, NX>,
        clock: &dyn Fn() -> Duration,
    ) -> Decision<NX, NU> {
        let settings = self.controller.settings();
        let now = self.measured.time().unwrap_or(0.0);
        let x = *self.measured.state();
        let at = |i: usize| reference(now + i as f64 * settings.t_s);
        let horizon = settings.horizon;
        let stages: Vec<SVector<f64, NX>> = (0..horizon).map(at).collect();
        let reference = Reference {
            stages: &stages,
            terminal: at(horizon),
        };
        let before = clock();
        let plan = self.controller.step(&x, &reference, &mut self.workspace);
        let step_time = clock().saturating_sub(before);
        let (u, status, active_bounds) = (plan.u[0], plan.status, plan.active.len());
        Decision {
            u,
            estimate: x,
            x_ref: *reference.at(0),
            cost: self.controller.tracking_cost(&x, &reference),
            status,
            active_bounds,
            step_time,
            gap: self.controller.gap(),
            guard: None,
        }
    }

    fn prediction(&self) -> Vec<SVector<f64, NX>> {
        self.controller.rollout().to_vec()
    }

    fn active_bounds(&self) -> Vec<BoundId> {
        let active = self.controller.solution().active.iter();
        active.map(|row| row.bound).collect()
    }
}
