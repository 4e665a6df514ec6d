//! Closed loops that a search asks for at once, and what became of them: who runs them, this process or
//! others, makes no difference to what is found.

use crate::error::TuningError;
use crate::judge::Ran;
use crate::tuning::{Tuning, changes};
use crate::values::{from_json, to_json};
use ballbot_campaign::{Campaign, CampaignError};
use ballbot_scenario::Files;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::ops::Range;
use std::time::Duration;
use toml::Value;

/// Which worlds closed loops are run in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Worlds {
    /// Those that the search sees.
    Search,
    /// Those of the comparison, which it does not see.
    HeldOut,
}

/// Closed loops that may be run in any order, at any place.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Batch {
    /// The worlds.
    pub worlds: Worlds,
    /// Candidates: their values, in the order of the parameters.
    pub candidates: Vec<Vec<serde_json::Value>>,
    /// Each closed loop: the candidate's place above, and the number of its world.
    pub loops: Vec<(usize, u64)>,
}

impl Batch {
    /// Candidates in worlds, one candidate after the other.
    pub(crate) fn of(worlds: Worlds, candidates: &[&[Value]], range: Range<u64>) -> Self {
        let each = |place| range.clone().map(move |world| (place, world));
        Self {
            worlds,
            candidates: candidates.iter().map(|values| to_json(values)).collect(),
            loops: (0..candidates.len()).flat_map(each).collect(),
        }
    }
}

/// What became of a closed loop.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Tried {
    /// It was run.
    Ran(Ran),
    /// The candidate's values make no scenario in this world.
    Refused {
        /// What the world draws.
        drawn: String,
        /// What the scenario says.
        problem: String,
    },
}

/// Who runs closed loops for a search: [`Tuning::run`], or other processes. The answer has an entry for
/// each loop, in their order.
pub type Run<'a, E> = &'a mut (dyn FnMut(&Batch) -> Result<Vec<Tried>, E> + Send);

impl<'a, F: Files + Copy + Sync> Tuning<'a, F> {
    /// Runs all closed loops of a batch.
    ///
    /// # Errors
    /// As [`run_some`](Self::run_some).
    pub fn run(&self, batch: &Batch) -> Result<Vec<Tried>, TuningError> {
        self.run_some(batch, 0..batch.loops.len())
    }

    /// Runs some closed loops of a batch, on all threads of the pool that it is called in.
    ///
    /// # Errors
    /// One of them fails for another reason than its values, or the batch is of another tuning.
    pub fn run_some(&self, batch: &Batch, some: Range<usize>) -> Result<Vec<Tried>, TuningError> {
        let campaign = self.campaign(batch.worlds);
        let columns = campaign.columns();
        let candidates = batch.candidates.iter();
        let candidates: Vec<Campaign<'a, F>> = candidates
            .map(|values| campaign.with(changes(self.axes(), &from_json(values))))
            .collect();
        let loops = batch.loops.get(some).unwrap_or_default();
        let one = |(place, world): &(usize, u64)| {
            let candidate = candidates.get(*place);
            let candidate = candidate.filter(|candidate| *world < candidate.runs());
            let Some(candidate) = candidate else {
                let problem = "it asks for a candidate or a world that is none".to_owned();
                return Err(TuningError::Batch(problem));
            };
            match candidate.run(*world, &|| Duration::ZERO) {
                Ok(row) => Ok(Tried::Ran(self.judge().ran(&columns, &row))),
                Err(CampaignError::Refused { drawn, source, .. }) => Ok(Tried::Refused {
                    drawn,
                    problem: source.to_string(),
                }),
                Err(error) => Err(error.into()),
            }
        };
        loops.par_iter().map(one).collect()
    }

    /// A candidate in all worlds, which must all take it.
    ///
    /// # Errors
    /// One of them does not, or what `run` says.
    pub(crate) fn run_all<E: From<TuningError>>(
        &self,
        worlds: Worlds,
        values: &[Value],
        run: Run<'_, E>,
    ) -> Result<Vec<Ran>, E> {
        let range = 0..self.campaign(worlds).runs();
        let all = run(&Batch::of(worlds, &[values], range))?;
        let ran = (0..).zip(all).map(|(world, tried)| match tried {
            Tried::Ran(ran) => Ok(ran),
            Tried::Refused { drawn, problem } => Err(TuningError::Refused {
                world,
                drawn,
                problem,
            }),
        });
        Ok(ran.collect::<Result<_, _>>()?)
    }
}
