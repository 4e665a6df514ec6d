//! Controller and plant together: Algorithm 2 around the continuous plant.

use crate::plant::{self, PlantError, Tolerances};
use lpvmpc::{BoundId, Controller, LpvModel, Reference, Status, Workspace};
use nalgebra::SVector;
use std::time::Duration;

/// One sample of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Sample<const NX: usize, const NU: usize> {
    /// Time of the sample, s.
    pub t: f64,
    /// State at the sample.
    pub x: SVector<f64, NX>,
    /// Input held from this sample to the next.
    pub u: SVector<f64, NU>,
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
}

/// How a run ended.
#[derive(Clone, Debug, PartialEq)]
pub enum Ending {
    /// After all samples.
    Complete,
    /// The controller had no plan: time, state, and why. No input was applied any more.
    NoPlan {
        /// Time of the sample, s.
        t: f64,
        /// What the solver said.
        status: Status<f64>,
    },
    /// The plant's motion could not be integrated from this time on.
    PlantFailed {
        /// Time of the sample, s.
        t: f64,
        /// Why.
        error: PlantError,
    },
}

/// A recorded run.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory<const NX: usize, const NU: usize> {
    /// One entry per sample at which an input was applied.
    pub samples: Vec<Sample<NX, NU>>,
    /// Time after the last sample, s.
    pub final_time: f64,
    /// State after the last sample.
    pub final_state: SVector<f64, NX>,
    /// State reference at that time.
    pub final_reference: SVector<f64, NX>,
    /// How the run ended.
    pub ending: Ending,
}

impl<const NX: usize, const NU: usize> Trajectory<NX, NU> {
    /// All states, the final one included.
    pub fn states(&self) -> impl Iterator<Item = &SVector<f64, NX>> {
        let samples = self.samples.iter().map(|sample| &sample.x);
        samples.chain(std::iter::once(&self.final_state))
    }

    /// The bound that made the run end, if one did.
    pub fn conflict(&self) -> Option<BoundId> {
        match self.ending {
            Ending::NoPlan {
                status: Status::Infeasible(bound),
                ..
            } => Some(bound),
            _ => None,
        }
    }
}

/// What a run needs besides controller and plant.
pub struct Experiment<'a, const NX: usize> {
    /// State at time zero.
    pub initial_state: SVector<f64, NX>,
    /// Number of samples.
    pub samples: usize,
    /// State reference at a time in s; the controller sees it over its whole horizon.
    pub reference: &'a dyn Fn(f64) -> SVector<f64, NX>,
    /// Tolerances of the plant's integration.
    pub tolerances: Tolerances,
    /// A monotonic clock; used for [`Sample::step_time`] only.
    pub clock: &'a dyn Fn() -> Duration,
    /// Called after every sample with the number of samples done.
    pub progress: &'a dyn Fn(usize),
}

/// Runs the closed loop: measure, step, hold the input for one sample.
///
/// The run ends early, with what was recorded so far, when the controller has no plan or the
/// plant's motion cannot be integrated; [`Trajectory::ending`] says so.
pub fn run<
    C,
    P,
    const NX: usize,
    const NU: usize,
    const NS: usize,
    const N: usize,
    const M: usize,
>(
    controller: &mut Controller<C, f64, NX, NU, NS, N, M>,
    plant: &P,
    experiment: &Experiment<'_, NX>,
    workspace: &mut Workspace<f64, NX, NU, N, M>,
) -> Trajectory<NX, NU>
where
    C: LpvModel<f64, NX, NU, NS>,
    P: LpvModel<f64, NX, NU, NS>,
{
    let t_s = controller.settings().t_s;
    let mut samples = Vec::with_capacity(experiment.samples);
    let mut x = experiment.initial_state;
    let mut ending = Ending::Complete;
    for k in 0..experiment.samples {
        let t = k as f64 * t_s;
        let reference = preview(experiment, k, t_s, controller.settings().horizon);
        let before = (experiment.clock)();
        let plan = controller.step(&x, &reference, workspace);
        let step_time = (experiment.clock)().saturating_sub(before);
        let (u, status, active_bounds) = (plan.u[0], plan.status, plan.active.len());
        if !status.is_solved() {
            ending = Ending::NoPlan { t, status };
            break;
        }
        let next = match plant::advance(plant, &x, &u, t_s, experiment.tolerances) {
            Ok(next) => next,
            Err(error) => {
                ending = Ending::PlantFailed { t, error };
                break;
            }
        };
        samples.push(Sample {
            t,
            x,
            u,
            x_ref: reference.stages[0],
            cost: controller.tracking_cost(&x, &reference),
            status,
            active_bounds,
            step_time,
        });
        x = next;
        (experiment.progress)(k + 1);
    }
    let final_time = samples.len() as f64 * t_s;
    Trajectory {
        samples,
        final_time,
        final_state: x,
        final_reference: (experiment.reference)(final_time),
        ending,
    }
}

/// The reference over the horizon that begins at sample `k`.
fn preview<const NX: usize, const N: usize>(
    experiment: &Experiment<'_, NX>,
    k: usize,
    t_s: f64,
    horizon: usize,
) -> Reference<f64, NX, N> {
    let at = |i: usize| (experiment.reference)((k + i) as f64 * t_s);
    let mut reference = Reference::constant(at(horizon));
    for (i, place) in reference.stages.iter_mut().enumerate().take(horizon) {
        *place = at(i);
    }
    reference
}
