//! The guarded controller: as a regulator in a world, and around the continuous plant with a
//! few faults that cost no more than a campaign can pay.

use crate::measured::MeasuredState;
use crate::plant::{self, PlantError, Tolerances};
use crate::regulator::{Decision, Regulator};
use crate::sensor::Measurement;
use lpvmpc::{
    BoundId, GuardedController, GuardedSettings, GuardedStep, GuardedWorkspace, LpvModel,
    Observation, SetPoints,
};
use nalgebra::SVector;
use std::time::Duration;

/// What becomes of a commanded input on its way to the plant, for one sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Actuation<const NU: usize> {
    /// Time until the new input acts, s, from 0 to the sampling time; the input before it acts
    /// until then.
    pub delay: f64,
    /// Added to the new input, in input units.
    pub error: SVector<f64, NU>,
}

impl<const NU: usize> Actuation<NU> {
    /// The input acts at once and as commanded.
    pub fn ideal() -> Self {
        Self {
            delay: 0.0,
            error: SVector::zeros(),
        }
    }
}

/// A guarded controller and its plant.
#[derive(Clone, Debug)]
pub struct GuardedLoop<C, P, const NX: usize, const NU: usize, const NS: usize> {
    controller: GuardedController<C, f64, NX, NU, NS>,
    plant: P,
    tolerances: Tolerances,
    x: SVector<f64, NX>,
    /// The input that acts on the plant.
    acting: SVector<f64, NU>,
}

impl<C, P, const NX: usize, const NU: usize, const NS: usize> GuardedLoop<C, P, NX, NU, NS>
where
    C: LpvModel<f64, NX, NU, NS>,
    P: LpvModel<f64, NX, NU, NS>,
{
    /// The loop with the plant in the state `x`, no input acting on it.
    pub fn new(
        controller: GuardedController<C, f64, NX, NU, NS>,
        plant: P,
        x: SVector<f64, NX>,
        tolerances: Tolerances,
    ) -> Self {
        Self {
            controller,
            plant,
            tolerances,
            x,
            acting: SVector::zeros(),
        }
    }

    /// The plant's state.
    pub fn state(&self) -> &SVector<f64, NX> {
        &self.x
    }

    /// Adds `jump`, in state units, to the plant's state: a push.
    pub fn push(&mut self, jump: &SVector<f64, NX>) {
        self.x += jump;
    }

    /// How much the integration error of the coming sample may add to the cost of the next plan.
    pub fn epsilon(&self) -> f64 {
        self.controller.epsilon()
    }

    /// The controller's answer to the measured state and the wanted set point.
    pub fn decide<const NA: usize>(
        &mut self,
        wanted: f64,
        workspace: &mut GuardedWorkspace<f64, NU, NA>,
    ) -> GuardedStep<f64, NX, NU> {
        self.controller.step(&self.x, wanted, workspace)
    }

    /// The plant's motion under the input `u` until the next sample.
    ///
    /// # Errors
    /// [`PlantError`]; the state then stays as it was.
    pub fn advance(
        &mut self,
        u: &SVector<f64, NU>,
        actuation: &Actuation<NU>,
    ) -> Result<(), PlantError> {
        let t_s = self.controller.settings().t_s;
        let u = u + actuation.error;
        let mut x = self.x;
        for (u, duration) in [(self.acting, actuation.delay), (u, t_s - actuation.delay)] {
            x = plant::advance(&self.plant, &x, &u, duration, self.tolerances)?;
        }
        self.x = x;
        self.acting = u;
        Ok(())
    }
}

/// What a guarded controller says of a sample besides its plan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Guard {
    /// What the input is backed by.
    pub decision: lpvmpc::Decision,
    /// The artificial set point z: the plan ends at z times the direction of the set points.
    pub set_point: f64,
}

/// A guarded controller on the measured state itself. The wanted set points are the reference's coordinates along the
/// direction of the set points.
#[derive(Debug)]
pub struct GuardedFeedback<C, const NX: usize, const NU: usize, const NS: usize, const NA: usize> {
    /// What decides.
    pub controller: GuardedController<C, f64, NX, NU, NS>,
    /// Its memory.
    pub workspace: GuardedWorkspace<f64, NU, NA>,
    /// The measured state.
    pub measured: MeasuredState<NX>,
    /// The input that was decided last.
    pub input: SVector<f64, NU>,
    /// Whether the controller sees the reference before its time, over the whole horizon.
    pub preview: bool,
}

impl<C, const NX: usize, const NU: usize, const NS: usize, const NA: usize>
    GuardedFeedback<C, NX, NU, NS, NA>
where
    C: LpvModel<f64, NX, NU, NS>,
{
    /// The regulator with this controller and a workspace of its own, with `preview` of the reference or
    /// without.
    pub fn new(controller: GuardedController<C, f64, NX, NU, NS>, preview: bool) -> Self {
        Self {
            workspace: controller.workspace(),
            controller,
            measured: MeasuredState::new(),
            input: SVector::zeros(),
            preview,
        }
    }
}

impl<C, const NX: usize, const NU: usize, const NS: usize, const NA: usize> Regulator<NX, NU, NX>
    for GuardedFeedback<C, NX, NU, NS, NA>
where
    C: LpvModel<f64, NX, NU, NS>,
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
        let GuardedSettings {
            t_s,
            direction,
            horizon,
            ..
        } = *self.controller.settings();
        let now = self.measured.time().unwrap_or(0.0);
        let x = *self.measured.state();
        let x_ref = reference(now);
        let coordinate = |x: &SVector<f64, NX>| x.dot(&direction) / direction.norm_squared();
        let seen = if self.preview { horizon } else { 0 };
        let at = |i: usize| coordinate(&reference(now + i as f64 * t_s));
        let stages: Vec<f64> = (0..seen).map(at).collect();
        let wanted = SetPoints {
            stages: &stages,
            end: at(seen),
        };
        let before = clock();
        let workspace = &mut self.workspace;
        let step = self.controller.step_with_preview(&x, &wanted, workspace);
        let step_time = clock().saturating_sub(before);
        self.input = step.u;
        Decision {
            u: step.u,
            estimate: x,
            x_ref,
            cost: step.cost,
            status: step.status,
            active_bounds: self.workspace.active_bounds(),
            step_time,
            gap: step.gap,
            guard: Some(Guard {
                decision: step.decision,
                set_point: step.set_point,
            }),
        }
    }

    fn prediction(&self) -> Vec<SVector<f64, NX>> {
        self.controller.rollout().copied().collect()
    }

    fn active_bounds(&self) -> Vec<BoundId> {
        self.controller.active_bounds().collect()
    }
}
