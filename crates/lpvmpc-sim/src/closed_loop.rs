//! Regulator and world together: Algorithm 2 around the continuous plant.

use crate::plant::{Plant, PlantError, Tolerances, Unloaded};
use crate::world::{World, WorldError};
use lpvmpc::{
    BoundId, Bounds, Controller, Guarantee, LpvModel, Observation, Reading, Regulator,
    StateFeedback, Status,
};
use nalgebra::SVector;
use std::time::Duration;

/// One sample of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Sample<const NX: usize, const NU: usize> {
    /// Time of the sample, s.
    pub t: f64,
    /// State at the sample.
    pub x: SVector<f64, NX>,
    /// The state that the input was decided for: measured, estimated, or predicted.
    pub estimate: SVector<f64, NX>,
    /// Input that was commanded from this sample to the next.
    pub u: SVector<f64, NU>,
    /// State reference at the sample.
    pub x_ref: SVector<f64, NX>,
    /// The cost J of the plan (Algorithm 1, constant terms included).
    pub cost: f64,
    /// What the plan is worth.
    pub status: Status<f64>,
    /// Bounds that are active in the plan.
    pub active_bounds: usize,
    /// Time that the decision took, by the clock that was handed in.
    pub step_time: Duration,
    /// Nonlinear rollout minus prediction at the end of the horizon, in state units.
    pub gap: SVector<f64, NX>,
    /// What only a guaranteed controller knows.
    pub guarantee: Option<Guarantee<f64>>,
}

/// How a run ended.
#[derive(Clone, Debug, PartialEq)]
pub enum Termination {
    /// After all samples.
    Complete,
    /// The controller had no plan: time, and why. No input was applied any more.
    NoPlan {
        /// Time of the sample, s.
        t: f64,
        /// What the solver said.
        status: Status<f64>,
    },
    /// The plant left the range in which its motion is followed: it fell, say.
    OutOfRange {
        /// Time at which it was found outside, s.
        t: f64,
        /// The component of the state, from 0.
        component: usize,
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
    pub termination: Termination,
}

impl<const NX: usize, const NU: usize> Trajectory<NX, NU> {
    /// All states, the final one included.
    pub fn states(&self) -> impl Iterator<Item = &SVector<f64, NX>> {
        let samples = self.samples.iter().map(|sample| &sample.x);
        samples.chain(std::iter::once(&self.final_state))
    }

    /// The bound that made the run end, if one did.
    pub fn conflict(&self) -> Option<BoundId> {
        match self.termination {
            Termination::NoPlan {
                status: Status::Infeasible(bound),
                ..
            } => Some(bound),
            _ => None,
        }
    }
}

/// What a regulated world does when the controller has no plan that keeps all bounds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OnInfeasible {
    /// It ends, so that nothing is recorded that the method does not guarantee.
    #[default]
    End,
    /// The input that comes with the answer is applied, finite and within its bounds; only a
    /// state that is not finite ends the run.
    Apply,
}

/// One row of a log: what a robot would have written down at a sample of its sensors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LogRow<const NY: usize, const NU: usize> {
    /// Time of the measurement, s.
    pub t: f64,
    /// The readings; `None` where one is missing.
    pub readings: [Option<Reading<f64>>; NY],
    /// What the regulator made of them.
    pub observation: Observation<NY>,
    /// The input commanded from here on.
    pub commanded: SVector<f64, NU>,
    /// The mean of the actuators' outputs from here to the next row.
    pub applied: SVector<f64, NU>,
}

/// A world with a regulator in it, stepped sample by sample.
#[derive(Debug)]
pub struct ClosedLoop<R, P, const NX: usize, const NU: usize, const NY: usize, const NL: usize> {
    /// What decides.
    pub regulator: R,
    /// What it decides about.
    pub world: World<P, NX, NU, NY, NL>,
    /// What happens without a plan.
    pub without_plan: OnInfeasible,
    /// The run ends when the plant's state is found outside.
    pub range: Bounds<f64, NX>,
    /// Samples of the sensors per control sample.
    per_sample: usize,
}

impl<R, P, const NX: usize, const NU: usize, const NY: usize, const NL: usize>
    ClosedLoop<R, P, NX, NU, NY, NL>
where
    R: Regulator<f64, NX, NU, NY>,
    P: Plant<NX, NU, NL>,
{
    /// A regulator in a world at time zero. It ends without a plan, and has no range.
    ///
    /// # Errors
    /// [`WorldError::Rates`] if the sampling time of the control is not a whole number of
    /// periods of the sensors.
    pub fn new(regulator: R, world: World<P, NX, NU, NY, NL>) -> Result<Self, WorldError> {
        let (t_s, period) = (regulator.t_s(), world.period());
        let per_sample = (t_s / period).round();
        if !(per_sample >= 1.0 && (per_sample * period - t_s).abs() <= 1e-9 * t_s) {
            return Err(WorldError::Rates { t_s, period });
        }
        Ok(Self {
            per_sample: per_sample as usize,
            ..Self::at_one_rate(regulator, world)
        })
    }

    /// One sample of the sensors per control sample.
    fn at_one_rate(regulator: R, world: World<P, NX, NU, NY, NL>) -> Self {
        Self {
            regulator,
            world,
            without_plan: OnInfeasible::End,
            range: Bounds::none(),
            per_sample: 1,
        }
    }

    /// One control sample: observe, decide, command, and let the world move on to the next.
    /// `log` gets a row for every sample of the sensors.
    ///
    /// # Errors
    /// The [`Termination`], if the run ends here.
    pub fn sample(
        &mut self,
        reference: &dyn Fn(f64) -> SVector<f64, NX>,
        clock: &dyn Fn() -> Duration,
        log: &mut dyn FnMut(LogRow<NY, NU>),
    ) -> Result<Sample<NX, NU>, Termination> {
        self.in_range()?;
        let (t, x) = (self.world.time(), *self.world.state());
        let mut observation = self.regulator.observe(self.world.measurement());
        let before = clock();
        let command = self.regulator.decide(reference);
        let step_time = clock().saturating_sub(before);
        let cost = self.regulator.cost();
        let status = command.status;
        // A guaranteed controller has an answer whatever its quadratic program said.
        let guaranteed = command.guarantee.is_some();
        let usable = match self.without_plan {
            OnInfeasible::End => guaranteed || status.is_solved(),
            OnInfeasible::Apply => x.iter().all(|value| value.is_finite()),
        };
        if !usable {
            return Err(Termination::NoPlan { t, status });
        }
        self.world.command(command.u);
        for i in 0..self.per_sample {
            if i > 0 {
                observation = self.regulator.observe(self.world.measurement());
                if let Some(u) = self.regulator.between() {
                    self.world.command(u);
                }
            }
            self.advance(observation, log)?;
        }
        Ok(Sample {
            t,
            x,
            estimate: command.estimate,
            u: command.u,
            x_ref: command.x_ref,
            cost,
            status,
            active_bounds: command.active_bounds,
            step_time,
            gap: command.gap,
            guarantee: command.guarantee,
        })
    }

    /// Whether the plant's state is in the [`range`](Self::range).
    ///
    /// # Errors
    /// [`Termination::OutOfRange`] names the first component that is not.
    pub fn in_range(&self) -> Result<(), Termination> {
        let (t, x) = (self.world.time(), self.world.state());
        let sides = self.range.lower.iter().zip(self.range.upper.iter());
        // NaN in the state is the regulator's to refuse.
        let outside = |(value, (lower, upper)): (&f64, _)| value < lower || value > upper;
        match x.iter().zip(sides).position(outside) {
            Some(component) => Err(Termination::OutOfRange { t, component }),
            None => Ok(()),
        }
    }

    /// One sample of the sensors.
    fn advance(
        &mut self,
        observation: Observation<NY>,
        log: &mut dyn FnMut(LogRow<NY, NU>),
    ) -> Result<(), Termination> {
        let world = &mut self.world;
        let measurement = *world.measurement();
        let t = measurement.t;
        let moved = world.advance();
        moved.map_err(|error| Termination::PlantFailed { t, error })?;
        log(LogRow {
            t,
            readings: measurement.readings,
            observation,
            commanded: *world.commanded(),
            applied: *world.applied(),
        });
        Ok(())
    }
}

/// What a run needs besides regulator and world.
pub struct RunConfig<'a, const NX: usize> {
    /// Number of control samples.
    pub samples: usize,
    /// State reference at a time in s; the controller sees it over its whole horizon.
    pub reference: &'a dyn Fn(f64) -> SVector<f64, NX>,
    /// A monotonic clock; used for [`Sample::step_time`] only.
    pub clock: &'a dyn Fn() -> Duration,
    /// Called after every control sample with the number of samples done.
    pub progress: &'a dyn Fn(usize),
}

/// A run with what its sensors delivered.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording<const NX: usize, const NU: usize, const NY: usize> {
    /// What happened, sample by sample of the control.
    pub trajectory: Trajectory<NX, NU>,
    /// What a robot would have logged, sample by sample of its sensors.
    pub log: Vec<LogRow<NY, NU>>,
}

/// Runs a closed loop from where it stands.
///
/// The run ends early, with what was recorded so far, when the loop ends;
/// [`Trajectory::termination`] says why.
pub fn record<R, P, const NX: usize, const NU: usize, const NY: usize, const NL: usize>(
    closed_loop: &mut ClosedLoop<R, P, NX, NU, NY, NL>,
    course: &RunConfig<'_, NX>,
) -> Recording<NX, NU, NY>
where
    R: Regulator<f64, NX, NU, NY>,
    P: Plant<NX, NU, NL>,
{
    let mut samples = Vec::with_capacity(course.samples);
    let mut log = Vec::new();
    let mut termination = Termination::Complete;
    for k in 0..course.samples {
        match closed_loop.sample(course.reference, course.clock, &mut |row| log.push(row)) {
            Ok(sample) => samples.push(sample),
            Err(early) => {
                termination = early;
                break;
            }
        }
        (course.progress)(k + 1);
    }
    if let (Termination::Complete, Err(late)) = (&termination, closed_loop.in_range()) {
        termination = late;
    }
    let final_time = closed_loop.world.time();
    let trajectory = Trajectory {
        samples,
        final_time,
        final_state: *closed_loop.world.state(),
        final_reference: (course.reference)(final_time),
        termination,
    };
    Recording { trajectory, log }
}

/// What a run in an ideal world needs besides controller and plant.
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

/// Runs the closed loop in an ideal world: measure the state, step, hold the input for one
/// sample. It ends early as [`record`] says.
pub fn run<C, P, const NX: usize, const NU: usize, const NS: usize>(
    controller: Controller<C, f64, NX, NU, NS>,
    plant: &P,
    experiment: &Experiment<'_, NX>,
) -> Trajectory<NX, NU>
where
    C: LpvModel<f64, NX, NU, NS> + Clone,
    P: LpvModel<f64, NX, NU, NS>,
{
    let world = World::ideal(
        Unloaded::<P, NS>(plant),
        experiment.initial_state,
        controller.settings().t_s,
        experiment.tolerances,
    );
    let regulator = StateFeedback::state_feedback(controller);
    let course = RunConfig {
        samples: experiment.samples,
        reference: experiment.reference,
        clock: experiment.clock,
        progress: experiment.progress,
    };
    record(&mut ClosedLoop::at_one_rate(regulator, world), &course).trajectory
}
