//! Studies: what is guaranteed, times of a step, the paper.

use super::scenario::{Scenario, prepare};
use super::values::plain;
use crate::errors::{of_scenario, study};
use crate::work::{Report, work};
use ballbot_studies::reproduction::{Claim, Reproduction};
use ballbot_studies::timing::{
    GuaranteedTimes, PROBLEMS, SEQUENCES, SequenceTimes, Stopwatch, time, time_guaranteed,
    time_problems,
};
use ballbot_studies::{Campaign, Outcome, Scenarios, StudyError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use serde_json::json;

/// The built-in scenarios that are timed.
#[pyfunction]
pub fn timed_scenarios() -> Vec<&'static str> {
    SEQUENCES.to_vec()
}

/// The times of the scenarios' controllers, of the sequences of problems if `problems`, and of the
/// guaranteed step.
#[pyfunction]
pub fn bench<'py>(
    py: Python<'py>,
    scenarios: Vec<PyRef<'py, Scenario>>,
    problems: bool,
    report: Report<'py>,
) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
    let scenarios: Vec<_> = scenarios.iter().map(|one| one.parts()).collect();
    let timed = work(py, &report, |watch| {
        let mut prepared = Vec::with_capacity(scenarios.len());
        for (document, folder) in &scenarios {
            prepared.push(prepare(document.scenario(), folder, watch)?);
        }
        let problems: &[&str] = if problems { &PROBLEMS } else { &[] };
        let count = scenarios.len() + problems.len();
        watch.begin("timing", count + 1);
        let clock = watch.clock();
        let stopwatch = Stopwatch::new(&clock);
        let mut sequences = Vec::with_capacity(count);
        for ((document, _), prepared) in scenarios.iter().zip(&prepared) {
            sequences.push(time(document.origin(), prepared, stopwatch)?);
            watch.step();
        }
        for name in problems {
            sequences.push(time_problems(name, stopwatch)?);
            watch.step();
        }
        let guaranteed = time_guaranteed(stopwatch)?;
        watch.step();
        Ok::<(Vec<SequenceTimes>, GuaranteedTimes), StudyError>((sequences, guaranteed))
    })?;
    let (sequences, guaranteed) = timed.map_err(study)?;
    Ok((plain(py, &sequences)?, plain(py, &guaranteed)?))
}

/// Many closed loops of a guaranteed scenario: of each variant its name, whether its plant is the
/// model, its runs together and one by one.
#[pyfunction]
pub fn count_guarantee<'py>(
    py: Python<'py>,
    scenario: &Scenario,
    runs: usize,
    samples: usize,
    seed: u64,
    threads: usize,
    report: Report<'py>,
) -> PyResult<Bound<'py, PyList>> {
    let (document, folder) = scenario.parts();
    let campaign = Campaign {
        runs,
        other_runs: runs.div_ceil(20),
        samples,
        seed,
        threads,
    };
    let scenarios = work(py, &report, |watch| {
        Scenarios::of(prepare(document.scenario(), folder, watch)?)
    })?;
    let scenarios = scenarios.map_err(of_scenario)?;
    let outcomes = work(py, &report, |watch| {
        watch.begin("running", campaign.total_runs());
        campaign.run(&scenarios, &|done| watch.set(done))
    })?;
    let outcomes = outcomes.map_err(study)?;
    let found = PyList::empty(py);
    for outcome in &outcomes {
        found.append(of_outcome(py, outcome)?)?;
    }
    Ok(found)
}

fn of_outcome<'py>(py: Python<'py>, outcome: &Outcome) -> PyResult<Bound<'py, PyDict>> {
    let found = PyDict::new(py);
    found.set_item("name", outcome.variant.to_string())?;
    found.set_item("is_nominal", outcome.variant.is_nominal())?;
    found.set_item("broken_promises", outcome.tally.broken_promises())?;
    found.set_item("tally", plain(py, &outcome.tally)?)?;
    found.set_item("records", plain(py, &outcome.records)?)?;
    Ok(found)
}

/// What the paper says beside what is computed.
#[pyfunction]
pub fn reproduce<'py>(py: Python<'py>, report: Report<'py>) -> PyResult<Bound<'py, PyAny>> {
    let claims = work(py, &report, |watch| {
        watch.begin("reproducing", Reproduction::PARTS);
        let clock = watch.clock();
        let reproduction = Reproduction::compute(&clock, &|done| watch.set(done));
        reproduction.map(|found| found.claims())
    })?;
    let told = |claim: &Claim| {
        json!({
            "claim": claim,
            "source": claim.source.name(),
            "difference": claim.difference(),
            "agrees": claim.agrees(),
        })
    };
    let claims = claims.map_err(study)?;
    plain(py, &claims.iter().map(told).collect::<Vec<_>>())
}
