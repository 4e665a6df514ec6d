//! The guaranteed controller around the continuous plant, with a few faults that cost no more than a
//! campaign can pay.

use crate::plant::{self, PlantError, Tolerances};
use lpvmpc::{GuaranteedController, GuaranteedStep, GuaranteedWorkspace, LpvModel};
use nalgebra::SVector;

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

/// A guaranteed controller and its plant.
#[derive(Clone, Debug)]
pub struct GuaranteedLoop<C, P, const NX: usize, const NU: usize, const NS: usize> {
    controller: GuaranteedController<C, f64, NX, NU, NS>,
    plant: P,
    tolerances: Tolerances,
    x: SVector<f64, NX>,
    /// The input that acts on the plant.
    acting: SVector<f64, NU>,
}

impl<C, P, const NX: usize, const NU: usize, const NS: usize> GuaranteedLoop<C, P, NX, NU, NS>
where
    C: LpvModel<f64, NX, NU, NS>,
    P: LpvModel<f64, NX, NU, NS>,
{
    /// The loop with the plant in the state `x`, no input acting on it.
    pub fn new(
        controller: GuaranteedController<C, f64, NX, NU, NS>,
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
        workspace: &mut GuaranteedWorkspace<f64, NU, NA>,
    ) -> GuaranteedStep<f64, NX, NU> {
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
