//! A campaign that has passed its checks, and its runs.

use crate::cell::{Cell, Column, Kind, Row};
use crate::checks::{check_fixed, check_goal, check_success, measures};
use crate::distribution::Distribution;
use crate::error::CampaignError;
use crate::file::{CampaignFile, LimitsTable, OnRefused};
use crate::fingerprint;
use crate::inputs::{Input, Inputs, child, named_seed};
use crate::measure::{Ending, Measure, Measured};
use crate::source::Source;
use ballbot_scenario::{Files, Prepared, Record, RunHooks, ScenarioError};
use rayon::prelude::*;
use std::time::Duration;
use toml::Value;

/// A clock that any thread may read.
pub type Clock<'a> = &'a (dyn Fn() -> Duration + Sync);

/// A campaign that has passed its checks. Run `i` is a function of the campaign and `i` alone: of no
/// order, thread or shard.
#[derive(Clone, Debug)]
pub struct Campaign<'a, F> {
    source: &'a Source,
    files: F,
    inputs: Inputs,
    measures: Vec<Measure>,
    runs: u64,
    /// Keys that are the same in all runs.
    fixed: Vec<(String, Value)>,
    /// Seed of the noise's seeds; none where the noise is the scenario's own.
    noise: Option<u64>,
    program: String,
    /// What it is made of, and by which program.
    fingerprint: String,
}

/// What a run draws.
#[derive(Clone, Debug, PartialEq)]
pub struct Drawn {
    /// Number of the run, from 0.
    pub run: u64,
    /// Seed of its noise; that of the scenario where it is not drawn.
    pub seed: Option<u64>,
    /// Values of the inputs, in their order.
    pub values: Vec<Value>,
}

/// A run that was repeated.
#[derive(Clone, Debug)]
pub struct Replay {
    /// Its row.
    pub row: Row,
    /// What was run.
    pub prepared: Prepared,
    /// What happened.
    pub record: Record,
}

/// The columns before those of inputs and measures.
pub(crate) const RUN: &str = "run";
const SEED: &str = "seed";
pub(crate) const OUTCOME: &str = "outcome";
pub(crate) const SUCCESS: &str = "success";
/// The outcome of a run whose drawn values make no scenario.
pub(crate) const REFUSED: &str = "refused";
/// The key of the noise's seed.
const NOISE: &str = "world.seed";

impl<'a, F: Files + Copy + Sync> Campaign<'a, F> {
    /// Checks a campaign, and that its first run is one. `program` names the program and its build:
    /// results of different ones are never merged.
    ///
    /// # Errors
    /// A value that makes no sense, with its key.
    pub fn new(source: &'a Source, files: F, program: &str) -> Result<Self, CampaignError> {
        let file = source.file();
        let (inputs, runs) = Inputs::new(&file.vary, file.design, file.seed, runs_of(file))?;
        let fixed = source.fixed();
        check_fixed(&fixed, &inputs)?;
        let keys = || inputs.keys().chain(fixed.iter().map(|(key, _)| key));
        let has_world =
            source.scenario().root().get("world").is_some() || keys().any(|key| is_of_world(key));
        let given = file.same_noise || keys().any(|key| key == NOISE);
        let campaign = Self {
            noise: (has_world && !given).then(|| named_seed(file.seed, NOISE)),
            measures: measures(file)?,
            fingerprint: fingerprint::of(
                source,
                program,
                source.text(),
                source.scenario(),
                &inputs,
            ),
            program: program.to_owned(),
            source,
            files,
            inputs,
            runs,
            fixed,
        };
        check_success(file, &campaign.measures)?;
        check_goal(file, &campaign.inputs)?;
        campaign.check_first()?;
        let success = file.success.keys();
        let success = success.map(|measure| (format!("success.{measure}"), *measure));
        let rare = file.rare.iter();
        let rare = rare.map(|rare| ("rare.measure".to_owned(), rare.measure));
        for (place, measure) in success.chain(rare) {
            if let Some(reason) = campaign.never_measured(measure) {
                return Err(CampaignError::value(place, measure.name(), reason));
            }
        }
        Ok(campaign)
    }

    /// Why none of the runs has this measure; nothing where one may have it. Of many runs the first ones
    /// are looked at.
    fn never_measured(&self, measure: Measure) -> Option<&'static str> {
        let mut never = None;
        for run in 0..self.runs.min(ATTEMPTS) {
            // What is no scenario has no measures, and says nothing of the others.
            if let Ok(prepared) = self.scenario(&self.draw(run)) {
                never = measure.never_in(&prepared);
                if never.is_none() {
                    break;
                }
            }
        }
        never
    }

    /// A key that is none is wrong in all runs: where the first one is no scenario, the campaign
    /// ends, or another one must be.
    fn check_first(&self) -> Result<(), CampaignError> {
        let attempts = match self.source.file().refused {
            OnRefused::Stop => 1,
            OnRefused::Count => self.runs.min(ATTEMPTS),
        };
        let mut first = None;
        for run in 0..attempts {
            let drawn = self.draw(run);
            match self.scenario(&drawn) {
                Ok(_) => return Ok(()),
                Err(error) => first = first.or_else(|| Some(self.refused(&drawn, error))),
            }
        }
        first.map_or(Ok(()), Err)
    }

    /// The same runs of a scenario in which more keys have values of their own: the worlds, the robots
    /// and the noise of each run are those of this campaign. Nothing is checked before a run.
    pub fn with(&self, values: impl IntoIterator<Item = (String, Value)>) -> Self {
        let mut changed = self.clone();
        changed.fixed.extend(values);
        changed
    }

    /// Points of the grids together, 1 without: run `i` is at point `i` modulo that.
    pub fn grid_points(&self) -> u64 {
        self.inputs.grid_points
    }

    /// Whether run `i` differs from run `j` at all: something is drawn, or there is noise.
    pub fn is_random(&self) -> bool {
        let drawn = |input: &Input| !matches!(input.distribution, Distribution::Grid(_));
        self.noise.is_some() || self.inputs.all.iter().any(drawn)
    }

    /// What it was read from.
    pub fn source(&self) -> &'a Source {
        self.source
    }

    /// How many runs it has.
    pub fn runs(&self) -> u64 {
        self.runs
    }

    /// The program and its build.
    pub fn program(&self) -> &str {
        &self.program
    }

    /// A digest of the campaign, the scenario, the files that these name, and the program.
    pub fn fingerprint(&self) -> &str {
        &self.fingerprint
    }

    /// The names of the inputs' columns, with what these hold.
    pub fn input_columns(&self) -> Vec<Column> {
        self.inputs.columns().collect()
    }

    /// What is measured.
    pub fn measures(&self) -> &[Measure] {
        &self.measures
    }

    /// The seed of the noise that belongs to `own`; none where the noise is the scenario's.
    pub(crate) fn noise_at(&self, own: u64) -> Option<u64> {
        self.noise.map(|seed| child(seed, own))
    }

    pub(crate) fn inputs(&self) -> &Inputs {
        &self.inputs
    }

    /// All columns of a row.
    pub fn columns(&self) -> Vec<Column> {
        let first = [
            (RUN, Kind::Whole),
            (SEED, Kind::Whole),
            (OUTCOME, Kind::Text),
            (SUCCESS, Kind::Flag),
        ];
        let first = first
            .into_iter()
            .map(|(name, kind)| Column::new(name, kind));
        let measures = self.measures.iter();
        let measures = measures.map(|measure| Column::new(measure.name(), measure.kind()));
        first.chain(self.inputs.columns()).chain(measures).collect()
    }

    /// What a run draws.
    pub fn draw(&self, run: u64) -> Drawn {
        Drawn {
            run,
            seed: self.noise_at(run),
            values: self.inputs.values(run),
        }
    }

    /// The drawn values, key by key, for people.
    pub fn words(&self, drawn: &Drawn) -> String {
        let values = self.inputs.changes(&drawn.values);
        let mut words: Vec<String> = values
            .map(|(key, value)| format!("{key} = {value}"))
            .collect();
        words.extend(drawn.seed.map(|seed| format!("{NOISE} = {seed}")));
        words.join(", ")
    }

    /// The scenario with the drawn values.
    ///
    /// # Errors
    /// It is none.
    pub fn scenario(&self, drawn: &Drawn) -> Result<Prepared, ScenarioError> {
        let fixed = self.fixed.iter();
        let mut changes: Vec<(&str, Value)> = fixed
            .map(|(key, value)| (key.as_str(), value.clone()))
            .collect();
        changes.extend(self.inputs.changes(&drawn.values));
        changes.extend(drawn.seed.map(|seed| (NOISE, Value::Integer(seed as i64))));
        self.source.scenario().with(&changes)?.prepare(self.files)
    }

    fn refused(&self, drawn: &Drawn, source: ScenarioError) -> CampaignError {
        CampaignError::Refused {
            run: drawn.run,
            drawn: self.words(drawn),
            source,
        }
    }

    /// Runs the scenario with the drawn values; nothing where it is none and such runs are counted.
    pub(crate) fn measured(
        &self,
        drawn: &Drawn,
        clock: Clock<'_>,
    ) -> Result<Option<Measured>, CampaignError> {
        let hooks = RunHooks {
            clock,
            progress: &|_| (),
        };
        let ran = self.scenario(drawn).and_then(|prepared| {
            let trajectories = prepared.run(&hooks)?;
            Ok(Measured::new(&prepared, &trajectories))
        });
        match ran {
            Ok(measured) => Ok(Some(measured)),
            Err(_) if self.source.file().refused == OnRefused::Count => Ok(None),
            Err(error) => Err(self.refused(drawn, error)),
        }
    }

    /// The row of a run.
    ///
    /// # Errors
    /// What it draws is no scenario, and the campaign does not count such runs.
    pub fn run(&self, run: u64, clock: Clock<'_>) -> Result<Row, CampaignError> {
        let drawn = self.draw(run);
        let measured = self.measured(&drawn, clock)?;
        Ok(self.row(&drawn, measured.as_ref()))
    }

    /// Runs one run again and keeps all of it.
    ///
    /// # Errors
    /// There is no such run, or what it draws is no scenario.
    pub fn replay(&self, run: u64, clock: Clock<'_>) -> Result<Replay, CampaignError> {
        if run >= self.runs {
            let expected = format!("the campaign has the runs 0 to {}", self.runs - 1);
            return Err(CampaignError::value("run", run.to_string(), expected));
        }
        let drawn = self.draw(run);
        let prepared = self
            .scenario(&drawn)
            .map_err(|error| self.refused(&drawn, error))?;
        let record = prepared.record(&RunHooks {
            clock,
            progress: &|_| (),
        })?;
        let planes = record.planes.iter().map(|plane| plane.trajectory.clone());
        let measured = Measured::new(&prepared, &planes.collect::<Vec<_>>());
        Ok(Replay {
            row: self.row(&drawn, Some(&measured)),
            prepared,
            record,
        })
    }

    fn row(&self, drawn: &Drawn, measured: Option<&Measured>) -> Row {
        let outcome = measured.map_or(REFUSED, |measured| measured.ending.name());
        let success = measured.map_or(Cell::Missing, |measured| {
            Cell::Flag(self.succeeds(measured))
        });
        let own = self.fixed.iter().find(|(key, _)| key == NOISE);
        let seed = match (drawn.seed, own) {
            (Some(seed), _) => Cell::Whole(seed as i64),
            (None, Some((_, value))) => Cell::of(value, Kind::Whole),
            (None, None) => Cell::Missing,
        };
        let first = [
            Cell::Whole(drawn.run as i64),
            seed,
            Cell::Text(outcome.to_owned()),
            success,
        ];
        let measures = self
            .measures
            .iter()
            .map(|measure| measured.map_or(Cell::Missing, |measured| measured.cell(*measure)));
        first
            .into_iter()
            .chain(self.inputs.cells(&drawn.values))
            .chain(measures)
            .collect()
    }

    /// Whether a run is a success: it comes to its end and keeps all limits.
    fn succeeds(&self, measured: &Measured) -> bool {
        let kept = |(measure, limits): (&Measure, &LimitsTable)| {
            let number = measured.cell(*measure).number();
            // A number that there is not keeps nothing.
            number.is_some_and(|number| {
                limits.at_least.is_none_or(|least| number >= least)
                    && limits.at_most.is_none_or(|most| number <= most)
            })
        };
        measured.ending == Ending::Complete && self.source.file().success.iter().all(kept)
    }

    /// Runs the runs from `from` to before `until` on all threads of the pool it is called in and
    /// hands their rows over in their order, part by part. A part is what is in memory.
    ///
    /// # Errors
    /// As [`run`](Self::run); what `each` says.
    pub fn for_each<E: From<CampaignError> + Send>(
        &self,
        (from, until): (u64, u64),
        clock: Clock<'_>,
        progress: &(dyn Fn() + Sync),
        mut each: impl FnMut(Row) -> Result<(), E>,
    ) -> Result<(), E> {
        let mut from = from;
        while from < until {
            let end = until.min(from + PART);
            let rows = (from..end).into_par_iter().map(|run| {
                let row = self.run(run, clock);
                progress();
                row
            });
            let rows = rows.collect::<Result<Vec<Row>, _>>()?;
            rows.into_iter().try_for_each(&mut each)?;
            from = end;
        }
        Ok(())
    }
}

/// The runs that a file asks for; those of a rare failure have no numbers of their own.
fn runs_of(file: &CampaignFile) -> Option<u64> {
    file.runs
        .or(file.rare.map(|rare| u64::from(rare.level_runs)))
}

/// Whether a scenario with this key has a world, and so noise.
fn is_of_world(key: &str) -> bool {
    key == "world" || key.starts_with("world.")
}

/// One of so many runs must be a scenario.
const ATTEMPTS: u64 = 100;
/// Runs that are in memory at a time.
const PART: u64 = 4096;
