//! Many closed loops: what is guaranteed, counted, and where it ends.
//!
//! A run is settled by variant, seed and its number alone, and runs are counted in their order,
//! so results are the same bit for bit on any number of threads.

mod paper;
mod run;
mod tally;
mod variant;

pub use run::{ImpossibleSetPoints, Record, SetPoints};
pub use tally::Tally;
pub use variant::Variant;

use ballbot_scenario::{Prepared, Scenario, ScenarioError};
use rayon::ThreadPoolBuilder;
use rayon::prelude::*;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

/// What is to be run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Campaign {
    /// Closed loops of the nominal variant.
    pub runs: usize,
    /// Closed loops of each other variant.
    pub other_runs: usize,
    /// Samples of each closed loop.
    pub samples: usize,
    /// Seed of everything random.
    pub seed: u64,
    /// Threads; 0 for one per core.
    pub threads: usize,
}

/// Why there is no campaign.
#[derive(Debug, thiserror::Error)]
pub enum CampaignError {
    /// A scenario, or a controller that refuses its settings.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// The threads.
    #[error("cannot start the threads: {0}")]
    Threads(#[from] rayon::ThreadPoolBuildError),
}

/// The runs of a variant.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// The variant.
    pub variant: Variant,
    /// Its runs, in their order.
    pub records: Vec<Record>,
    /// All of them together.
    pub tally: Tally,
}

/// The scenarios that the campaign takes its controllers from.
#[derive(Debug)]
pub struct Scenarios {
    /// The guaranteed loop.
    pub guaranteed: Prepared,
    /// The paper's literal scheme.
    pub paper: Prepared,
}

fn built_in(name: &str) -> Result<Prepared, ScenarioError> {
    Scenario::load(name)?.prepare(Path::new("."))
}

impl Scenarios {
    /// The built-in ones.
    ///
    /// # Errors
    /// None should occur, as there is no input.
    pub fn built_in() -> Result<Self, ScenarioError> {
        Self::of(built_in("far-setpoints")?)
    }

    /// Those of this guaranteed loop.
    ///
    /// # Errors
    /// It has no certified terminal set.
    pub fn of(guaranteed: Prepared) -> Result<Self, ScenarioError> {
        run::settings(&guaranteed)?;
        Ok(Self {
            guaranteed,
            paper: built_in("single-setpoint-terminal")?,
        })
    }
}

impl Campaign {
    /// Closed loops of all variants together.
    pub fn total_runs(&self) -> usize {
        self.runs + (Variant::ALL.len() - 1) * self.other_runs
    }

    /// Runs every variant. `progress` is called before and after each closed loop with the number of
    /// those that are done.
    ///
    /// # Errors
    /// A controller refuses its settings, or the threads cannot be started.
    pub fn run(
        &self,
        scenarios: &Scenarios,
        progress: &(dyn Fn(usize) + Sync),
    ) -> Result<Vec<Outcome>, CampaignError> {
        let pool = ThreadPoolBuilder::new().num_threads(self.threads).build()?;
        Ok(pool.install(|| self.run_here(scenarios, progress))?)
    }

    fn run_here(
        &self,
        scenarios: &Scenarios,
        progress: &(dyn Fn(usize) + Sync),
    ) -> Result<Vec<Outcome>, ScenarioError> {
        let done = AtomicUsize::new(0);
        let outcome = |variant: &Variant| {
            let runs = match variant {
                Variant::Nominal => self.runs,
                _ => self.other_runs,
            };
            let records = (0..runs).into_par_iter().map(|number| {
                // Before it, too: who ends the campaign from there does not wait for another loop.
                progress(done.load(Ordering::Relaxed));
                let record = variant.run(scenarios, self, number);
                progress(done.fetch_add(1, Ordering::Relaxed) + 1);
                record
            });
            let records = records.collect::<Result<Vec<_>, _>>()?;
            Ok(Outcome {
                variant: *variant,
                tally: Tally::of(&records),
                records,
            })
        };
        Variant::ALL.iter().map(outcome).collect()
    }
}
