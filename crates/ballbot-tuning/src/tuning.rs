//! A tuning that has passed its checks, and its search.

use crate::batch::{Run, Worlds};
use crate::candidates::Candidates;
use crate::compare::{Comparison, compare};
use crate::error::TuningError;
use crate::file::{ParameterTable, SearchTable};
use crate::journal::Entry;
use crate::judge::{Judge, Outcome, Quantity, Ran};
use crate::pareto;
use crate::search::{self, Plan, Searched, value, weightings};
use crate::source::TuningSource;
use crate::values::from_json;
use ballbot_campaign::{Axis, Campaign, Cell, is_within, named_seed};
use ballbot_scenario::{Files, Scenario};
use toml::Value;

/// A tuning that has passed its checks. What it finds is a function of its file and the scenario alone:
/// of no thread, time, or interruption.
#[derive(Debug)]
pub struct Tuning<'a, F> {
    source: &'a TuningSource,
    axes: Vec<Axis>,
    /// The start, parameter by parameter.
    start: Vec<Value>,
    judge: Judge,
    worlds: Campaign<'a, F>,
    held_out: Campaign<'a, F>,
}

/// What a tuning has found.
#[derive(Clone, Debug)]
pub struct Found {
    /// All candidates; the first one is the start.
    pub candidates: Vec<Entry>,
    /// What each is worth.
    pub outcomes: Vec<Outcome>,
    /// How the searches went.
    pub searches: Vec<Searched>,
    /// The Pareto front: candidates that keep all limits, none of which is better than another one in
    /// all goals.
    pub front: Vec<usize>,
    /// The best one under equal weights.
    pub chosen: usize,
}

impl Found {
    /// The closed loops that were run for it.
    pub fn runs(&self) -> u64 {
        self.candidates.iter().map(|candidate| candidate.runs).sum()
    }

    /// What each candidate is worth under the weights of the first search; the smaller, the better, and
    /// above 1 where limits are not kept.
    pub fn values(&self) -> Vec<f64> {
        let weights = &weightings(self.outcomes.first().map_or(1, |first| first.goals.len()))[0];
        self.outcomes
            .iter()
            .map(|outcome| value(outcome, weights))
            .collect()
    }
}

/// What happens while a tuning runs.
pub struct Hooks<'a, E> {
    /// Who runs the closed loops.
    pub run: Run<'a, E>,
    /// Text that is to be added to the journal; lost when it fails.
    pub append: &'a mut (dyn FnMut(&str) -> Result<(), E> + Send),
    /// How many candidates are done.
    pub progress: &'a (dyn Fn(u64) + Sync),
}

impl<'a, F: Files + Copy + Sync> Tuning<'a, F> {
    /// Checks a tuning, and that its start is a scenario in all its worlds. `program` names the program
    /// and its build: a journal of another one is never gone on with.
    ///
    /// # Errors
    /// A value that makes no sense, with its key.
    pub fn new(source: &'a TuningSource, files: F, program: &str) -> Result<Self, TuningError> {
        let file = source.file();
        check_keys(source)?;
        let mut axes = Vec::new();
        let mut start = Vec::new();
        for (key, table) in &file.parameters {
            let axis = Axis::new(&format!("parameters.{key}"), &table.vary(key))?;
            let first = begin(source, key, table, &axis)?;
            // A number where the scenario takes whole ones is found out now.
            if let Some(own) = axis.unit(&first).map(|u| axis.value(u)) {
                source.worlds.scenario().with(&[(key.as_str(), own)])?;
            }
            start.push(first);
            axes.push(axis);
        }
        let confidence = file.held_out.confidence;
        if !(0.5..=0.9999).contains(&confidence) {
            let expected = "it must be from 0.5 to 0.9999, such as 0.95";
            return Err(TuningError::value(
                "held_out.confidence",
                format!("{confidence:?}"),
                expected,
            ));
        }
        let changed = changes(&axes, &start);
        let campaign = |source, table: &str| {
            let campaign = Campaign::new(source, files, program);
            let campaign = campaign.map_err(|error| TuningError::within(table, error))?;
            if campaign.runs() > MOST_RUNS {
                let expected = format!("at most {MOST_RUNS} are possible for a candidate");
                let (key, runs) = (format!("{table}.runs"), campaign.runs().to_string());
                return Err(TuningError::value(key, runs, expected));
            }
            Ok(campaign.with(changed.clone()))
        };
        let worlds = campaign(&source.worlds, "worlds")?;
        let held_out = campaign(&source.held_out, "held_out")?;
        let duration = worlds.scenario(&worlds.draw(0))?.end();
        let judge = Judge::new(file, duration)?;
        check_search(&file.search, judge.goals.len(), axes.len())?;
        Ok(Self {
            judge,
            source,
            axes,
            start,
            worlds,
            held_out,
        })
    }

    /// What it was read from.
    pub fn source(&self) -> &'a TuningSource {
        self.source
    }

    /// Goals and limits.
    pub fn judge(&self) -> &Judge {
        &self.judge
    }

    /// What is searched over.
    pub fn axes(&self) -> &[Axis] {
        &self.axes
    }

    /// Closed loops of a candidate.
    pub fn runs(&self) -> u64 {
        self.worlds.runs()
    }

    /// Closed loops of the comparison, of the start and of the result each.
    pub fn held_out_runs(&self) -> u64 {
        self.held_out.runs()
    }

    /// A digest of the tuning, the scenario, the files that these name, and the program.
    pub fn fingerprint(&self) -> &str {
        self.worlds.fingerprint()
    }

    /// The values of the start, in the order of the parameters.
    pub fn start(&self) -> &[Value] {
        &self.start
    }

    /// The values of a candidate, in the order of the parameters.
    pub fn values(&self, candidate: &Entry) -> Vec<Value> {
        from_json(&candidate.values)
    }

    /// These values as cells of their columns.
    pub fn cells<'b>(&'b self, values: &'b [Value]) -> impl Iterator<Item = Cell> + 'b {
        self.axes
            .iter()
            .zip(values)
            .map(|(axis, value)| axis.cell(value))
    }

    /// Key by key what a candidate changes of the scenario.
    pub fn changes(&self, values: &[Value]) -> Vec<(String, Value)> {
        changes(&self.axes, values)
    }

    /// Whether the start may be another than what the scenario says: a parameter has one of its own, or other keys that get
    /// its value.
    pub fn starts_elsewhere(&self) -> bool {
        let mut tables = self.source.file().parameters.values();
        tables.any(|table| table.start.is_some() || !table.also.is_empty())
    }

    /// Searches. `done` are the entries of a journal, which are not run again; but the start is, so that
    /// a machine that computes differently is found out.
    ///
    /// # Errors
    /// The start is no scenario in one of its worlds, a run fails, the journal is of another search, or
    /// no candidate keeps all limits.
    pub fn search<'b, E: From<TuningError>>(
        &'b self,
        done: crate::Journal,
        hooks: Hooks<'b, E>,
    ) -> Result<Found, E> {
        let search = &self.source.file().search;
        let unit = |(axis, value): (&Axis, &Value)| axis.unit(value).unwrap_or(0.5);
        let point: Vec<f64> = self.axes.iter().zip(&self.start).map(unit).collect();
        let mut candidates = Candidates::new(self, done, hooks);
        let outcome = candidates.start(&self.start)?;
        let plan = Plan {
            weightings: weightings(self.judge.goals.len()),
            evaluations: search.evaluations,
            population: population(search, self.axes.len()),
            step: search.step,
            patience: search.patience,
            seed: named_seed(self.source.file().seed, "search"),
        };
        let searches = search::search(&plan, (point, outcome), &mut candidates)?;
        let (candidates, outcomes) = candidates.into_parts()?;
        let front = pareto::front(&outcomes);
        let mut found = Found {
            candidates,
            outcomes,
            searches,
            front,
            chosen: 0,
        };
        let values = found.values();
        let least = |places: &mut dyn Iterator<Item = usize>| {
            places.min_by(|a, b| values[*a].total_cmp(&values[*b]))
        };
        let Some(chosen) = least(&mut found.front.iter().copied()) else {
            let exact = (0..values.len()).filter(|place| found.outcomes[*place].exact);
            let closest = least(&mut { exact }).unwrap_or(0);
            let judged = found.candidates[closest].judged();
            return Err(TuningError::Nothing {
                evaluations: found.candidates.len(),
                number: closest,
                closest: self.judge.words(&judged),
            }
            .into());
        };
        found.chosen = chosen;
        Ok(found)
    }

    /// What a candidate does in the worlds that the search does not see.
    ///
    /// # Errors
    /// One of them is no scenario, or what `run` says.
    pub fn held_out<E: From<TuningError>>(
        &self,
        values: &[Value],
        run: Run<'_, E>,
    ) -> Result<Vec<Ran>, E> {
        self.run_all(Worlds::HeldOut, values, run)
    }

    /// A campaign in these worlds.
    pub(crate) fn campaign(&self, worlds: Worlds) -> &Campaign<'a, F> {
        match worlds {
            Worlds::Search => &self.worlds,
            Worlds::HeldOut => &self.held_out,
        }
    }

    /// Goals and limits before and after in the worlds that the search does not see; nothing where
    /// there are no others than it sees, since nothing in them is random.
    pub fn compare(&self, before: &[Ran], after: &[Ran]) -> Option<Vec<Comparison>> {
        if !self.held_out.is_random() {
            return None;
        }
        let file = self.source.file();
        let seed = named_seed(file.seed, "bootstrap");
        let one = |quantity: &Quantity| {
            let points = self.held_out.grid_points() as usize;
            let confidence = file.held_out.confidence;
            compare(quantity, (before, after), points, confidence, seed)
        };
        let all = self.judge.goals.iter().chain(&self.judge.limits);
        Some(all.map(one).collect())
    }

    /// The scenario's text with the values of a candidate; its comments stay. What `[worlds.set]` changes
    /// is not in it.
    ///
    /// # Errors
    /// The text has no place for a value, or would not be the scenario that was tried.
    pub fn document(&self, values: &[Value]) -> Result<String, TuningError> {
        let changes = self.changes(values);
        let text = crate::document::with_values(self.source.scenario(), &changes)?;
        let named: Vec<(&str, Value)> = changes
            .iter()
            .map(|(k, v)| (k.as_str(), v.clone()))
            .collect();
        let expected = self.source.worlds.scenario().with(&named)?;
        if Scenario::parse(&text, "the tuned scenario")? == expected {
            return Ok(text);
        }
        let expected = "the scenario's text could not be given these values; write them by hand";
        Err(TuningError::value("parameters", "(found)", expected))
    }
}

/// Candidates, at most.
const MOST_EVALUATIONS: u64 = 1_000_000;
/// Generations without an improvement, at most. Where few values are allowed, all have been tried soon, and nothing
/// but patience ends a search.
const MOST_PATIENCE: u32 = 10_000;
/// Runs of a candidate, at most; what is decided by more is a campaign.
const MOST_RUNS: u64 = 100_000;

/// Candidates of a generation; as is usual (Hansen 2016) where the file does not say.
fn population(search: &SearchTable, dimensions: usize) -> usize {
    let usual = || 4 + (3.0 * (dimensions as f64).ln()) as usize;
    search.population.unwrap_or_else(usual)
}

pub(crate) fn changes(axes: &[Axis], values: &[Value]) -> Vec<(String, Value)> {
    let all = axes.iter().zip(values);
    let all =
        all.flat_map(|(axis, value)| axis.keys().iter().map(|key| (key.clone(), value.clone())));
    all.collect()
}

fn check_search(search: &SearchTable, goals: usize, dimensions: usize) -> Result<(), TuningError> {
    let refused = |key: &str, value: String, expected: &str| {
        Err(TuningError::value(format!("search.{key}"), value, expected))
    };
    if let Some(population) = search.population
        && !(4..=10_000).contains(&population)
    {
        return refused(
            "population",
            population.to_string(),
            "it must be from 4 to 10000",
        );
    }
    if !(search.step > 0.0 && search.step <= 1.0) {
        let expected = "it must be above 0 and at most 1, a share of each range, such as 0.2";
        return refused("step", format!("{:?}", search.step), expected);
    }
    let (searches, population) = (weightings(goals).len(), population(search, dimensions));
    let least = 1 + (searches * population) as u64;
    if !(least..=MOST_EVALUATIONS).contains(&search.evaluations) {
        let expected = format!(
            "it must be from {least}, for the start and a generation of {population} in each of \
             {searches} searches, to {MOST_EVALUATIONS}"
        );
        return refused("evaluations", search.evaluations.to_string(), &expected);
    }
    if !(1..=MOST_PATIENCE).contains(&search.patience) {
        let expected = format!("it must be from 1 to {MOST_PATIENCE} generations");
        return refused("patience", search.patience.to_string(), &expected);
    }
    Ok(())
}

/// No key has two values.
fn check_keys(source: &TuningSource) -> Result<(), TuningError> {
    let file = source.file();
    if file.parameters.is_empty() {
        let expected = "at least one key of the scenario must be searched over";
        return Err(TuningError::value("parameters", "(none)", expected));
    }
    let searched: Vec<&String> = file
        .parameters
        .iter()
        .flat_map(|(key, table)| std::iter::once(key).chain(&table.also))
        .collect();
    let varied = file.worlds.vary.iter().flat_map(|table| match &table.key {
        ballbot_campaign::Keys::One(key) => std::slice::from_ref(key),
        ballbot_campaign::Keys::Several(keys) => keys.as_slice(),
    });
    let varied = varied.map(|key| (key, "worlds.vary"));
    let set = source.worlds.fixed();
    let set = set.iter().map(|(key, _)| (key, "worlds.set"));
    let others: Vec<(&String, &str)> = set.chain(varied).collect();
    for (i, key) in searched.iter().enumerate() {
        let meets = |other: &str| is_within(key, other) || is_within(other, key);
        let before = searched[..i].iter().map(|other| (*other, "parameters"));
        if let Some((other, table)) = before
            .chain(others.iter().copied())
            .find(|(other, _)| meets(other))
        {
            let expected = format!("`{other}` in {table} has a value for it already");
            return Err(TuningError::value(
                "parameters",
                format!("{key:?}"),
                expected,
            ));
        }
    }
    Ok(())
}

/// Where the search begins along an axis.
fn begin(
    source: &TuningSource,
    key: &str,
    table: &ParameterTable,
    axis: &Axis,
) -> Result<Value, TuningError> {
    let own = source.worlds.scenario().value(key);
    let place = format!("parameters.{key:?}");
    let Some(start) = table.start.clone().or(own) else {
        let expected = "the scenario has no value there to begin at; say one with `start`";
        return Err(TuningError::value(place, "(absent)", expected));
    };
    if axis.unit(&start).is_some() {
        return Ok(start);
    }
    let whose = if table.start.is_some() {
        "`start`"
    } else {
        "the scenario's own value"
    };
    let expected =
        format!("{whose}, where the search begins, is not among the values that are allowed");
    Err(TuningError::value(place, start.to_string(), expected))
}
