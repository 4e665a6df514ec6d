//! The candidates of a search: run in all worlds, taken from the journal, or known already.

use crate::batch::{Batch, Tried, Worlds};
use crate::error::TuningError;
use crate::journal::{Entry, Journal, State};
use crate::judge::{Judged, Outcome, Ran};
use crate::search::Problem;
use crate::tuning::{Hooks, Tuning};
use crate::values::to_json;
use ballbot_campaign::Axis;
use ballbot_scenario::Files;
use std::collections::{HashMap, VecDeque};
use toml::Value;

/// All candidates so far.
pub struct Candidates<'a, 'b, F, E> {
    tuning: &'b Tuning<'a, F>,
    hooks: Hooks<'b, E>,
    /// Units of the goals, once the start is known.
    scale: Vec<f64>,
    entries: Vec<Entry>,
    outcomes: Vec<Outcome>,
    /// By their values, the last one with these.
    known: HashMap<String, usize>,
    /// What the journal still has.
    done: VecDeque<Entry>,
    journal: Journal,
}

/// Parts of the runs of a candidate, after each of which it can be given up.
const PARTS: u64 = 8;

/// A candidate on its way.
#[derive(Default)]
struct Running {
    runs: Vec<Ran>,
    /// Why it is no scenario.
    refused: Option<String>,
    is_over: bool,
}

/// What became of it.
struct Ended {
    state: State,
    runs: Vec<Ran>,
    /// Why it is no scenario.
    refused: Option<String>,
}

impl<'a, 'b, F: Files + Copy + Sync, E: From<TuningError>> Candidates<'a, 'b, F, E> {
    /// None yet; `done` is what the journal has.
    pub fn new(tuning: &'b Tuning<'a, F>, mut done: Journal, hooks: Hooks<'b, E>) -> Self {
        let entries = std::mem::take(&mut done.entries);
        Self {
            tuning,
            hooks,
            scale: Vec::new(),
            entries: Vec::new(),
            outcomes: Vec::new(),
            known: HashMap::new(),
            done: entries.into(),
            journal: done,
        }
    }

    /// Runs the start, whether the journal has it or not.
    pub fn start(&mut self, values: &[Value]) -> Result<Outcome, E> {
        let ran = self
            .tuning
            .run_all(Worlds::Search, values, &mut *self.hooks.run)?;
        let judge = self.tuning.judge();
        let judged = judge.judged(&ran, ran.len());
        self.scale = judge.scale(&judged);
        let entry = self.entry(values, State::Whole, ran.len() as u64, &judged);
        if let Some(first) = self.done.pop_front() {
            if first != entry {
                let problem =
                    "this machine makes other numbers of the start; go on where it was begun";
                return Err(journal(0, problem).into());
            }
        } else {
            self.append(std::slice::from_ref(&entry))?;
        }
        Ok(self.keep(entry))
    }

    /// All candidates, and what they are worth.
    ///
    /// # Errors
    /// The journal has more than the search has asked for.
    pub fn into_parts(self) -> Result<(Vec<Entry>, Vec<Outcome>), E> {
        match self.done.is_empty() {
            true => Ok((self.entries, self.outcomes)),
            false => Err(journal(self.entries.len(), "the search ends before it").into()),
        }
    }

    fn entry(&self, values: &[Value], state: State, runs: u64, judged: &Judged) -> Entry {
        Entry {
            candidate: self.entries.len(),
            values: to_json(values),
            state,
            refused: None,
            runs,
            goals: judged.goals.clone(),
            limits: judged.limits.clone(),
            lost: judged.lost,
        }
    }

    fn append(&mut self, entries: &[Entry]) -> Result<(), E> {
        let lines: String = entries
            .iter()
            .map(|entry| self.journal.line(entry))
            .collect();
        (self.hooks.append)(&lines)
    }

    /// Puts a candidate beside the others.
    fn keep(&mut self, entry: Entry) -> Outcome {
        let outcome = match entry.state {
            State::Refused => Outcome {
                goals: vec![f64::INFINITY; self.tuning.judge().goals.len()],
                violation: f64::INFINITY,
                exact: false,
            },
            _ => self.tuning.judge().outcome(&entry.judged(), &self.scale),
        };
        self.known.insert(name(&entry.values), self.entries.len());
        self.entries.push(entry);
        self.outcomes.push(outcome.clone());
        (self.hooks.progress)(self.entries.len() as u64);
        outcome
    }

    /// Runs candidates part by part, all of a part at once, until they are whole or given up.
    fn run(
        &mut self,
        wanted: &[Vec<Value>],
        is_hopeless: &(dyn Fn(&Outcome) -> bool + Sync),
    ) -> Result<Vec<Ended>, E> {
        let all = self.tuning.runs();
        let judge = self.tuning.judge();
        let mut running: Vec<Running> = wanted.iter().map(|_| Running::default()).collect();
        let size = all.div_ceil(PARTS);
        let mut from = 0;
        while from < all {
            let until = all.min(from + size);
            let open = running.iter_mut().zip(wanted);
            let mut open: Vec<(&mut Running, &Vec<Value>)> =
                open.filter(|(candidate, _)| !candidate.is_over).collect();
            if open.is_empty() {
                break;
            }
            let values: Vec<&[Value]> = open.iter().map(|(_, values)| values.as_slice()).collect();
            let batch = Batch::of(Worlds::Search, &values, from..until);
            let tried = (self.hooks.run)(&batch)?;
            for ((place, _), tried) in batch.loops.iter().zip(tried) {
                let candidate = &mut open[*place].0;
                match tried {
                    Tried::Ran(ran) => candidate.runs.push(ran),
                    Tried::Refused { problem, .. } => {
                        candidate.refused.get_or_insert(problem);
                        candidate.is_over = true;
                    }
                }
            }
            for (candidate, _) in open.iter_mut().filter(|(candidate, _)| !candidate.is_over) {
                let judged = judge.judged(&candidate.runs, all as usize);
                candidate.is_over = is_hopeless(&judge.outcome(&judged, &self.scale));
            }
            from = until;
        }
        let ended = running.into_iter().map(|candidate| {
            let state = match candidate.runs.len() as u64 == all {
                _ if candidate.refused.is_some() => State::Refused,
                true => State::Whole,
                false => State::GivenUp,
            };
            Ended {
                state,
                runs: candidate.runs,
                refused: candidate.refused,
            }
        });
        Ok(ended.collect())
    }
}

/// An entry that is not what it should be; the journal's first line is before entry 0.
fn journal(entry: usize, problem: &str) -> TuningError {
    TuningError::Journal {
        line: entry + 2,
        problem: problem.to_owned(),
    }
}

/// The name by which values are known again.
fn name(values: &[serde_json::Value]) -> String {
    values.iter().map(|value| format!("{value}\n")).collect()
}

/// A number as a person would write it: a multiple of its step, or four digits, if these are allowed, too.
fn readable(axis: &Axis, value: Value) -> Value {
    let Value::Float(number) = value else {
        return value;
    };
    if axis.has_step() {
        return value;
    }
    let short = format!("{number:.3e}").parse().unwrap_or(number);
    match axis.unit(&Value::Float(short)) {
        Some(_) => Value::Float(short),
        None => value,
    }
}

impl<F: Files + Copy + Sync, E: From<TuningError>> Problem for Candidates<'_, '_, F, E> {
    type Error = E;

    fn evaluate(
        &mut self,
        points: &[Vec<f64>],
        is_hopeless: &(dyn Fn(&Outcome) -> bool + Sync),
    ) -> Result<Vec<Outcome>, E> {
        let values = points.iter().map(|point| {
            let all = self.tuning.axes().iter().zip(point);
            all.map(|(axis, u)| readable(axis, axis.value(*u)))
                .collect::<Vec<Value>>()
        });
        let values: Vec<Vec<Value>> = values.collect();
        let names = values.iter().map(|values| name(&to_json(values)));
        let names: Vec<String> = names.collect();
        // A lower bound that was enough once is not for every threshold.
        let is_known = |name: &String| {
            let known = self
                .known
                .get(name)
                .map(|number| (&self.entries[*number], &self.outcomes[*number]));
            known.is_some_and(|(entry, outcome)| {
                entry.state != State::GivenUp || is_hopeless(outcome)
            })
        };
        let mut wanted: Vec<usize> = Vec::new();
        for place in 0..names.len() {
            let again = wanted.iter().any(|other| names[*other] == names[place]);
            if !again && !is_known(&names[place]) {
                wanted.push(place);
            }
        }
        let mut made = Vec::new();
        while let (Some(place), Some(entry)) = (wanted.first(), self.done.front()) {
            if name(&entry.values) != names[*place] || entry.candidate != self.entries.len() {
                return Err(
                    journal(self.entries.len(), "the search asks for another candidate").into(),
                );
            }
            wanted.remove(0);
            if let Some(entry) = self.done.pop_front() {
                self.keep(entry);
            }
        }
        let to_run: Vec<Vec<Value>> = wanted.iter().map(|place| values[*place].clone()).collect();
        let ended = self.run(&to_run, is_hopeless)?;
        for (values, ended) in to_run.iter().zip(ended) {
            let Ended {
                state,
                runs,
                refused,
            } = ended;
            let judged = self
                .tuning
                .judge()
                .judged(&runs, self.tuning.runs() as usize);
            let entry = Entry {
                refused,
                ..self.entry(values, state, runs.len() as u64, &judged)
            };
            made.push(entry.clone());
            self.keep(entry);
        }
        self.append(&made)?;
        Ok(names
            .iter()
            .map(|name| self.outcomes[self.known[name]].clone())
            .collect())
    }

    fn evaluations(&self) -> u64 {
        self.entries.len() as u64
    }
}
