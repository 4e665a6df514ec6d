//! What a tuning leaves: the tuned scenario, a page, tables, figures.

use super::{HeldOut, Own, moved};
use crate::commands::CommandError;
use crate::html::{self, escape};
use crate::json;
use crate::results::ResultFolder;
use crate::table::Table;
use crate::tuning_figures::Drawn;
use ballbot_campaign::Interval;
use ballbot_scenario::number;
use ballbot_tuning::{Comparison, Entry, Found, Judged, Quantity, State, with_files};
use serde_json::json;
use std::fmt::Write as _;
use toml::Value;

/// All files that a tuning can leave in its folder, beside its journal.
pub(super) const RESULTS: [&str; 12] = [
    TUNED,
    PAGE,
    SUMMARY,
    CANDIDATES,
    "front.svg",
    "front.png",
    "parallel.svg",
    "parallel.png",
    "progress.svg",
    "progress.png",
    "before-after.svg",
    "before-after.png",
];
const TUNED: &str = "tuned.toml";
const PAGE: &str = "report.html";
const SUMMARY: &str = "summary.json";
const CANDIDATES: &str = "candidates.csv";

/// Everything that is said of a tuning.
struct Report<'a> {
    tuning: &'a Own<'a>,
    found: &'a Found,
    /// The chosen candidate's values.
    values: Vec<Value>,
    start: Judged,
    chosen: Judged,
    comparisons: Option<Vec<Comparison>>,
}

/// Writes all results. Says on the screen, or as JSON, what was found.
pub(super) fn write(
    tuning: &Own<'_>,
    found: &Found,
    held_out: &HeldOut,
    results: &ResultFolder,
    as_json: bool,
) -> Result<String, CommandError> {
    let entry = &found.candidates[found.chosen];
    let report = Report {
        tuning,
        found,
        values: tuning.values(entry),
        start: found.candidates[0].judged(),
        chosen: entry.judged(),
        comparisons: tuning.compare(&held_out.before, &held_out.after),
    };
    let numbers = |axis: usize| {
        let all = found.candidates.iter().map(|entry| {
            let cells: Vec<_> = tuning.cells(&tuning.values(entry)).collect();
            cells[axis]
                .number()
                .filter(|number| number.is_finite())
                .unwrap_or_else(|| place(tuning, axis, entry))
        });
        all.collect()
    };
    let values: Vec<Vec<f64>> = (0..tuning.axes().len()).map(numbers).collect();
    let drawn = Drawn {
        title: &tuning.source().file().title,
        judge: tuning.judge(),
        axes: tuning.axes(),
        found,
        values: &values,
    };
    let figures = drawn.all(report.comparisons.as_deref().unwrap_or_default());
    let mut document = report.json();
    document["folder"] = json::path(results.path());
    let mut files = vec![
        (SUMMARY.to_owned(), json::text(&document).into_bytes()),
        (CANDIDATES.to_owned(), report.candidates().into_bytes()),
        (
            PAGE.to_owned(),
            report.page(&html::figures(&figures)?).into_bytes(),
        ),
    ];
    if found.chosen != 0 || tuning.starts_elsewhere() {
        let folder = tuning.source().folder();
        let renamed = |name: &str| moved::name(name, folder, results.path());
        let text = with_files(&tuning.document(&report.values)?, &renamed)?;
        files.push((TUNED.to_owned(), (report.comment() + &text).into_bytes()));
    }
    for figure in &figures {
        files.extend(figure.figure.files(figure.name)?);
    }
    results.write(&files, &RESULTS)?;
    match as_json {
        true => Ok(json::text(&document)),
        false => Ok(report.text() + &format!("written to {}\n", results.path().display())),
    }
}

/// The place in its list of a value that is no finite number.
fn place(tuning: &Own<'_>, axis: usize, entry: &Entry) -> f64 {
    let value = tuning.values(entry).into_iter().nth(axis);
    let unit = value.and_then(|value| tuning.axes()[axis].unit(&value));
    unit.unwrap_or(f64::NAN)
}

/// A number with its interval.
fn with_interval(interval: &Interval) -> String {
    let [value, lower, upper] =
        [interval.value, interval.lower, interval.upper].map(|number| format!("{number:.4}"));
    format!("{value} [{lower}, {upper}]")
}

impl Report<'_> {
    /// Goals and limits, with what the search has seen of the start and of the candidate.
    fn quantities(&self) -> Vec<(&'static str, &Quantity, f64, f64)> {
        let judge = self.tuning.judge();
        let goals = judge
            .goals
            .iter()
            .zip(&self.start.goals)
            .zip(&self.chosen.goals);
        let limits = judge
            .limits
            .iter()
            .zip(&self.start.limits)
            .zip(&self.chosen.limits);
        let goals = goals.map(|((quantity, start), chosen)| ("goal", quantity, *start, *chosen));
        let limits = limits.map(|((quantity, start), chosen)| ("limit", quantity, *start, *chosen));
        goals.chain(limits).collect()
    }

    /// Key, start and found value of each parameter.
    fn parameters(&self) -> Vec<[String; 3]> {
        let axes = self
            .tuning
            .axes()
            .iter()
            .zip(self.tuning.start())
            .zip(&self.values);
        let rows = axes.map(|((axis, start), value)| {
            [axis.keys().join(", "), start.to_string(), value.to_string()]
        });
        rows.collect()
    }

    fn counts(&self, state: State) -> usize {
        let all = self.found.candidates.iter();
        all.filter(|entry| entry.state == state).count()
    }

    fn summed_up(&self) -> String {
        format!(
            "{} candidates in {} worlds each: {} run in all of them, {} given up, {} no scenario; {} \
             closed loops",
            self.found.candidates.len(),
            self.tuning.runs(),
            self.counts(State::Whole),
            self.counts(State::GivenUp),
            self.counts(State::Refused),
            self.found.runs(),
        )
    }

    /// What the comparison says, in a sentence.
    fn verdict(&self) -> String {
        if self.found.chosen == 0 {
            return "nothing is better than the start".to_owned();
        }
        let Some(comparisons) = &self.comparisons else {
            return "nothing in the worlds is random, so there are none that the search has not seen"
                .to_owned();
        };
        let goals = &comparisons[..self.tuning.judge().goals.len()];
        let limits = &comparisons[goals.len()..];
        let names = |which: fn(&Comparison) -> bool| {
            let names = goals
                .iter()
                .filter(|goal| which(goal))
                .map(|goal| goal.name.as_str());
            names.collect::<Vec<_>>().join(", ")
        };
        let mut said = Vec::new();
        for (names, verdict) in [
            (names(Comparison::is_better), "smaller"),
            (names(Comparison::is_worse), "LARGER"),
            (
                names(|goal| !goal.is_better() && !goal.is_worse()),
                "not told apart from before",
            ),
        ] {
            if !names.is_empty() {
                said.push(format!("{names}: {verdict}"));
            }
        }
        let is_exceeded = |limit: &&Comparison| {
            limit
                .at_most
                .is_some_and(|most| !(limit.after.value <= most))
        };
        for limit in limits.iter().filter(is_exceeded) {
            said.push(format!("{}: LIMIT EXCEEDED", limit.name));
        }
        for goal in goals.iter().filter(is_exceeded) {
            said.push(format!("{}: target not reached", goal.name));
        }
        said.join("; ")
    }

    fn held_out_title(&self) -> String {
        format!(
            "in {} worlds that the search has not seen (bootstrap, {} %)",
            self.tuning.held_out_runs(),
            100.0 * self.tuning.source().file().held_out.confidence
        )
    }

    fn text(&self) -> String {
        let mut said = format!(
            "{}: {}\ncandidate {}; {} are in front: {}\n",
            self.tuning.source().file().title,
            self.summed_up(),
            self.found.chosen,
            self.found.front.len(),
            self.verdict(),
        );
        let mut table = Table::new(["parameter", "start", "found"]);
        self.parameters().into_iter().for_each(|row| table.row(row));
        let _ = write!(said, "\n{table}");
        let mut table = Table::new(["in the worlds of the search", "at most", "start", "found"]);
        for (_, quantity, start, chosen) in self.quantities() {
            let most = quantity.at_most.map_or(String::new(), number::text);
            table.row([
                quantity.to_string(),
                most,
                format!("{start:.4}"),
                format!("{chosen:.4}"),
            ]);
        }
        let _ = write!(said, "\n{table}");
        if let Some(comparisons) = &self.comparisons {
            let title = self.held_out_title();
            let mut table = Table::new([&*title, "before", "after", "difference"]);
            for row in comparisons {
                let [before, after, difference] =
                    [&row.before, &row.after, &row.difference].map(with_interval);
                table.row([row.name.clone(), before, after, difference]);
            }
            let _ = write!(said, "\n{table}");
        }
        if let Some(reason) = self
            .found
            .candidates
            .iter()
            .find_map(|entry| entry.refused.as_ref())
        {
            let _ = writeln!(said, "\nthe first candidate that is no scenario: {reason}");
        }
        said + "\n"
    }

    /// The comment at the beginning of the tuned scenario: which goals, from what to what, in how many
    /// worlds.
    fn comment(&self) -> String {
        let source = self.tuning.source();
        let file = source
            .path()
            .file_name()
            .unwrap_or_default()
            .to_string_lossy();
        let mut text = format!(
            "# Tuned by `ballbot tune {file}`, candidate {} of {}:\n# {}\n",
            self.found.chosen,
            self.found.candidates.len(),
            self.verdict()
        );
        match &self.comparisons {
            Some(comparisons) => {
                let _ = writeln!(text, "# Before and after {}:", self.held_out_title());
                for row in comparisons {
                    let [before, after] = [&row.before, &row.after].map(with_interval);
                    let _ = writeln!(text, "#   {}: {before} -> {after}", row.name);
                }
            }
            None => {
                for (_, quantity, start, chosen) in self.quantities() {
                    let _ = writeln!(text, "#   {quantity}: {start:.4} -> {chosen:.4}");
                }
            }
        }
        for [key, start, value] in self.parameters() {
            let _ = writeln!(text, "# {key}: {start} -> {value}");
        }
        let set = &source.file().worlds.set;
        if !set.is_empty() {
            let set: Vec<String> = set
                .iter()
                .map(|(key, value)| format!("{key} = {value}"))
                .collect();
            let _ = writeln!(
                text,
                "# Tried with {}, which is not in this file.",
                set.join(", ")
            );
        }
        text + "\n"
    }

    fn candidates(&self) -> String {
        let judge = self.tuning.judge();
        let columns = self.tuning.axes().iter().map(|axis| axis.column().name);
        let goals = judge
            .goals
            .iter()
            .chain(&judge.limits)
            .map(Quantity::to_string);
        let first = ["candidate", "state", "runs", "keeps_limits", "in_front"].map(str::to_owned);
        let names: Vec<String> = first.into_iter().chain(columns).chain(goals).collect();
        let mut text = names.join(",") + "\n";
        for (entry, outcome) in self.found.candidates.iter().zip(&self.found.outcomes) {
            let state = match entry.state {
                State::Whole => "whole",
                State::GivenUp => "given_up",
                State::Refused => "refused",
            };
            let whole = entry.state == State::Whole;
            let mut cells = vec![
                entry.candidate.to_string(),
                state.to_owned(),
                entry.runs.to_string(),
                (whole && outcome.violation == 0.0).to_string(),
                self.found.front.contains(&entry.candidate).to_string(),
            ];
            let values = self.tuning.values(entry);
            // Commas would be columns.
            cells.extend(
                self.tuning
                    .cells(&values)
                    .map(|cell| cell.text().replace(',', ";")),
            );
            let judged = entry.judged();
            let numbers = judged.goals.iter().chain(&judged.limits);
            // A lower bound is no value.
            cells.extend(numbers.map(|number| match whole {
                true => format!("{number:?}"),
                false => String::new(),
            }));
            text += &(cells.join(",") + "\n");
        }
        text
    }

    fn json(&self) -> serde_json::Value {
        let parameters: Vec<_> = self
            .tuning
            .axes()
            .iter()
            .zip(self.tuning.start())
            .zip(&self.values)
            .map(|((axis, start), value)| json!({ "keys": axis.keys(), "start": start, "found": value }))
            .collect();
        let quantities: Vec<_> = self
            .quantities()
            .into_iter()
            .map(|(kind, quantity, start, found)| {
                json!({
                    "kind": kind, "name": quantity.to_string(), "at_most": quantity.at_most,
                    "start": start, "found": found,
                })
            })
            .collect();
        json!({
            "title": self.tuning.source().file().title,
            "candidates": self.found.candidates.len(),
            "whole": self.counts(State::Whole),
            "given_up": self.counts(State::GivenUp),
            "refused": self.counts(State::Refused),
            "worlds": self.tuning.runs(),
            "closed_loops": self.found.runs(),
            "searches": self.found.searches,
            "front": self.found.front,
            "chosen": self.found.chosen,
            "parameters": parameters,
            "in_the_search": quantities,
            "held_out_worlds": self.tuning.held_out_runs(),
            "held_out": self.comparisons,
            "verdict": self.verdict(),
        })
    }

    fn page(&self, figures: &str) -> String {
        let file = self.tuning.source().file();
        let texts = |words: &[&str]| {
            words
                .iter()
                .map(|word| (*word).to_owned())
                .collect::<Vec<_>>()
        };
        let parameters: Vec<Vec<String>> = self.parameters().into_iter().map(Vec::from).collect();
        let quantities = self
            .quantities()
            .into_iter()
            .map(|(kind, quantity, start, chosen)| {
                vec![
                    quantity.to_string(),
                    kind.to_owned(),
                    quantity.at_most.map_or(String::new(), number::text),
                    format!("{start:.4}"),
                    format!("{chosen:.4}"),
                ]
            });
        let quantities: Vec<Vec<String>> = quantities.collect();
        let held_out = match &self.comparisons {
            None => "<p>Nothing in the worlds is random: there are no others.</p>".to_owned(),
            Some(comparisons) => {
                let rows: Vec<Vec<String>> = comparisons
                    .iter()
                    .map(|row| {
                        let [before, after, difference] =
                            [&row.before, &row.after, &row.difference].map(with_interval);
                        vec![row.name.clone(), before, after, difference]
                    })
                    .collect();
                html::table(&texts(&["", "before", "after", "difference"]), &rows)
            }
        };
        let judge = self.tuning.judge();
        let names = self.tuning.axes().iter().map(|axis| axis.column().name);
        let goals = judge.goals.iter().map(Quantity::to_string);
        let headers: Vec<String> = ["candidate".to_owned()]
            .into_iter()
            .chain(names)
            .chain(goals)
            .collect();
        let front = self.found.front.iter().map(|place| {
            let entry = &self.found.candidates[*place];
            let values = self.tuning.values(entry);
            let cells = self.tuning.cells(&values).map(|cell| cell.text());
            let goals = entry.judged().goals;
            let goals = goals.iter().map(|goal| format!("{goal:.4}"));
            [place.to_string()]
                .into_iter()
                .chain(cells)
                .chain(goals)
                .collect()
        });
        let front: Vec<Vec<String>> = front.collect();
        let searches = self.found.searches.iter().map(|searched| {
            let weights = searched.weights.iter().map(|weight| format!("{weight:.2}"));
            let end = match searched.end {
                ballbot_tuning::SearchEnd::Budget => "evaluations used up",
                ballbot_tuning::SearchEnd::NoImprovement => "no improvement",
                ballbot_tuning::SearchEnd::Degenerate => "distribution degenerate",
                ballbot_tuning::SearchEnd::Reached => "all targets reached",
            };
            vec![
                weights.collect::<Vec<_>>().join(", "),
                searched.generations.to_string(),
                searched.evaluations.to_string(),
                end.to_owned(),
            ]
        });
        let searches: Vec<Vec<String>> = searches.collect();
        let body = format!(
            "<p>{}. Chosen: candidate {}. <strong>{}.</strong></p>\n<h2>Parameters</h2>\n{}\n\
             <h2>In the worlds of the search</h2>\n{}\n<h2>Before and after, {}</h2>\n{held_out}\n\
             <h2>Figures</h2>\n{figures}\n<h2>Pareto front</h2>\n{}\n<h2>Searches</h2>\n{}\n",
            escape(&self.summed_up()),
            self.found.chosen,
            escape(&self.verdict()),
            html::table(&texts(&["parameter", "start", "found"]), &parameters),
            html::table(&texts(&["", "", "at most", "start", "found"]), &quantities),
            escape(&self.held_out_title()),
            html::table(&headers, &front),
            html::table(
                &texts(&[
                    "weights of the goals",
                    "generations",
                    "candidates when it ended",
                    "end"
                ]),
                &searches
            ),
        );
        html::page(&file.title, &body)
    }
}
