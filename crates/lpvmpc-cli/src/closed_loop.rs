//! The closed loop of an experiment.

use crate::error::CommandError;
use crate::experiment::{Experiment, Reference};
use lpvmpc_any::{Decision, Mpc, Preview, World};
use lpvmpc_terminal::progress::Progress;
use nalgebra::DVector;
use std::collections::BTreeMap;
use std::time::Instant;

/// What happened. One entry per sample, but of `x` one more: the end.
#[derive(Debug, Default)]
pub struct Run {
    /// The true states.
    pub x: Vec<Vec<f64>>,
    /// The commands.
    pub u: Vec<Vec<f64>>,
    /// The outputs under them.
    pub y: Vec<Vec<f64>>,
    /// The references of the states; empty without.
    pub x_ref: Vec<Vec<f64>>,
    /// The states that were estimated; empty without an estimator.
    pub estimates: Vec<Vec<f64>>,
    /// The disturbances that were found, in the order of the estimator's.
    pub disturbances: Vec<Vec<f64>>,
    /// Time of each step of the controller, s.
    pub step_times: Vec<f64>,
    /// Cost of each plan.
    pub costs: Vec<f64>,
    /// How often each status of a plan came.
    pub statuses: BTreeMap<String, usize>,
    /// Time and status of the first plan that was none.
    pub first_unsolved: Option<(f64, String)>,
}

impl Run {
    /// Runs the loop, as the Python package does.
    ///
    /// # Errors
    /// The controller or the world refuses its settings, or the motion cannot be integrated.
    pub fn new(experiment: &Experiment) -> Result<Self, CommandError> {
        let Experiment {
            plant,
            real,
            settings,
            ..
        } = experiment;
        let mut mpc = Mpc::new(plant, &experiment.proved_settings()?)
            .map_err(|error| experiment.refused("controller", &error))?;
        mpc.set_estimator(experiment.estimator.as_ref())
            .map_err(|error| experiment.refused("controller", &error))?;
        let mut world = World::new(real, &experiment.x0, &experiment.world)
            .map_err(|error| experiment.refused("world", &error))?;
        let bar = Progress::new("simulating", experiment.samples);
        let mut run = Self {
            x: vec![world.state().to_vec()],
            ..Self::default()
        };
        let mut seen = world.state().to_vec();
        for i in 0..experiment.samples {
            let t = i as f64 * settings.t_s;
            let readings = world.readings().iter();
            let readings: Vec<Option<f64>> = readings
                .map(|reading| reading.map(|reading| reading.value))
                .collect();
            let preview = experiment.ahead(i);
            let start = Instant::now();
            let plan = if experiment.estimator.is_some() {
                mpc.observe(world.time(), &readings)?;
                mpc.decide(&preview)?
            } else {
                // Where a reading is missing, the last one holds.
                for (seen, reading) in seen.iter_mut().zip(readings) {
                    *seen = reading.unwrap_or(*seen);
                }
                mpc.step(&seen, &preview)?
            };
            run.step_times.push(start.elapsed().as_secs_f64());
            let u = plan.first_input();
            // With a certificate, what is not guaranteed is no plan.
            let is_plan = (plan.decision).map_or(plan.is_solved(), Decision::is_guaranteed);
            if !is_plan && run.first_unsolved.is_none() {
                run.first_unsolved = Some((t, plan.status.clone()));
            }
            let word = plan.status.split([':', '(']).next().unwrap_or_default();
            *run.statuses.entry(word.trim().to_owned()).or_default() += 1;
            run.costs.push(plan.cost);
            run.y.push(real.output(world.state(), &u)?);
            run.x_ref.extend(experiment.reference_at(i, 0.0));
            if let Some(estimate) = mpc.estimate() {
                run.estimates.push(estimate.x);
                run.disturbances.push(estimate.disturbances);
            }
            world.command(&u)?;
            run.u.push(u);
            world.advance().map_err(|error| {
                CommandError::NoResult(format!("after {t:.6} s, sample {i}: {error}"))
            })?;
            run.x.push(world.state().to_vec());
            bar.set(i + 1);
        }
        Ok(run)
    }

    /// A quantile of the times of the steps, s.
    pub fn step_time(&self, quantile: f64) -> f64 {
        let mut times = self.step_times.clone();
        times.sort_by(f64::total_cmp);
        let last = times.len().saturating_sub(1);
        let place = (quantile * last as f64).round() as usize;
        times.get(place).copied().unwrap_or(0.0)
    }
}

impl Experiment {
    /// The reference that holds `later` seconds after a sample.
    fn reference_at(&self, sample: usize, later: f64) -> Option<Vec<f64>> {
        // A time that is meant to be that of the sample counts as such.
        let t = later + (sample as f64 + 1e-9) * self.settings.t_s;
        let holds = |one: &&Reference| one.time <= t;
        let holding = self.references.iter().rev().find(holds);
        holding.map(|one| one.x.clone())
    }

    /// The references over the horizon of the sample `i`, which begins when its input acts.
    fn ahead(&self, i: usize) -> Preview {
        let delay = self.estimator.as_ref().map_or(0.0, |one| one.delay);
        let stages = i..=i + self.settings.horizon;
        let stages = stages.map_while(|stage| self.reference_at(stage, delay));
        Preview {
            x_ref: stages.map(DVector::from_vec).collect(),
            ..Preview::default()
        }
    }
}
