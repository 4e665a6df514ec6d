//! Tunings of closed loops: repeated, interrupted, gone on with, and what they write.

use crate::{PROGRAM, TWO_GOALS, search, with, written};
use ballbot_campaign::{Campaign, Source};
use ballbot_scenario::Scenario;
use ballbot_tuning::{Batch, Ran, State, Tuning, TuningError};
use std::fs;
use std::path::Path;
use std::time::Duration;
use toml::Value;

/// The whole journal of a tuning on one thread; of two, the same; and from wherever it is cut off.
#[test]
fn an_interrupted_tuning_finds_the_same_and_runs_nothing_twice() {
    with(TWO_GOALS, |tuning| {
        let pool = |threads| rayon_pool(threads);
        let (found, whole) = pool(1).install(|| search(tuning, "")).unwrap();
        let (other, again) = pool(3).install(|| search(tuning, "")).unwrap();
        assert_eq!(whole, again);
        assert_eq!(found.outcomes, other.outcomes);
        assert!(found.candidates.len() > 30, "{}", found.candidates.len());
        let lines: Vec<&str> = whole.split_inclusive('\n').collect();
        // After the first line, in a generation, in a line, at the end.
        for (kept, cut) in [(1, 0), (5, 0), (17, 23), (lines.len(), 0)] {
            let mut text = lines[..kept].concat();
            let length = text.len();
            if cut > 0 {
                text += &lines[kept][..cut];
            }
            let (resumed, added) = search(tuning, &text).unwrap();
            assert_eq!(
                text[..length].to_owned() + &added,
                whole,
                "from line {kept}"
            );
            assert_eq!(resumed.outcomes, found.outcomes);
            assert_eq!(
                (resumed.chosen, &resumed.front),
                (found.chosen, &found.front)
            );
        }
    });
}

fn rayon_pool(threads: usize) -> rayon::ThreadPool {
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .unwrap()
}

#[test]
fn a_journal_that_was_changed_or_is_of_another_tuning_is_refused() {
    let whole = with(TWO_GOALS, |tuning| {
        let (_, whole) = search(tuning, "").unwrap();
        let lines: Vec<&str> = whole.split_inclusive('\n').collect();
        let refused = |text: &str| match search(tuning, text) {
            Ok(_) => panic!("taken: {text}"),
            Err(error) => error.to_string(),
        };
        let mut changed = lines.clone();
        let other = lines[7].replacen("\"runs\":", "\"runs\":1", 1);
        changed[7] = &other;
        assert!(refused(&changed.concat()).contains("line 8: it was changed"));
        let mut missing = lines.clone();
        missing.remove(4);
        assert!(refused(&missing.concat()).contains("line 5: it was changed, or lines before"));
        assert!(refused("run,seed\n").contains("line 1: it is no journal"));
        assert!(refused("mine").contains("line 1: it is no journal"));
        whole
    });
    for (from, to) in [("seed = 5", "seed = 6"), ("runs = 4", "runs = 3")] {
        with(&TWO_GOALS.replace(from, to), |tuning| {
            let error = search(tuning, &whole).unwrap_err().to_string();
            assert!(error.contains("line 1: it is of another tuning"), "{error}");
        });
    }
}

/// Each candidate meets the worlds of the campaign with the same seed, whatever its values.
#[test]
fn all_candidates_meet_the_same_worlds() {
    let campaign = |horizon: i64| {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("campaign.toml");
        let text = format!(
            "title = \"x\"\nscenario = \"single-setpoint-terminal\"\nruns = 4\nseed = 1\n\
             [set]\nduration_s = 1.0\n\"controller.horizon\" = {horizon}\n\
             [[vary]]\nkey = \"initial_state.theta_rad\"\nuniform = [-0.1, 0.1]\n"
        );
        fs::write(&path, text).unwrap();
        let source = Source::load(&path).unwrap();
        let campaign = Campaign::new(&source, source.folder(), PROGRAM).unwrap();
        let names: Vec<String> = campaign
            .columns()
            .into_iter()
            .map(|column| column.name)
            .collect();
        let number = |run, name: &str| {
            let row = campaign.run(run, &|| Duration::ZERO).unwrap();
            row[names.iter().position(|other| other == name).unwrap()]
                .number()
                .unwrap()
        };
        let errors = (0..4).map(|run| number(run, "rms_error_rad")).sum::<f64>() / 4.0;
        let torques = (0..4)
            .map(|run| number(run, "rms_torque_nm"))
            .fold(0.0, f64::max);
        [errors, torques]
    };
    let only = TWO_GOALS
        .replace(
            "\"controller.q.0\" = { log_uniform = [20.0, 2000.0] }\n",
            "",
        )
        .replace(
            "\"controller.r\" = { log_uniform = [100.0, 10000.0] }\n",
            "",
        );
    with(&only, |tuning| {
        let (found, _) = search(tuning, "").unwrap();
        let whole = found
            .candidates
            .iter()
            .filter(|entry| entry.state == State::Whole);
        let mut compared = 0;
        for entry in whole {
            let horizon = entry.values[0].as_i64().unwrap();
            assert_eq!(entry.judged().goals, campaign(horizon), "horizon {horizon}");
            compared += 1;
        }
        assert!(compared > 3);
        // Twelve horizons differ at most: none is run twice.
        let mut horizons: Vec<_> = found
            .candidates
            .iter()
            .filter(|entry| entry.state == State::Whole)
            .map(|entry| entry.values[0].as_i64())
            .collect();
        let count = horizons.len();
        horizons.sort();
        horizons.dedup();
        assert_eq!(horizons.len(), count);
    });
}

#[test]
fn what_is_found_is_better_and_its_text_is_that_scenario() {
    // One goal that has an optimum inside: with all torque free, less error.
    let one = TWO_GOALS.replace(
        "[[goal]]\nmeasure = \"rms_torque_nm\"\nstatistic = \"worst\"\n",
        "[[limit]]\nmeasure = \"rms_torque_nm\"\nstatistic = \"worst\"\nat_most = 0.5\n",
    );
    with(&one, |tuning| {
        let (found, _) = search(tuning, "").unwrap();
        let [start, chosen] = [0, found.chosen].map(|place| found.candidates[place].judged());
        assert!(
            chosen.goals[0] < 0.995 * start.goals[0],
            "{chosen:?} {start:?}"
        );
        assert!(chosen.limits[0] <= 0.5 && chosen.limits[1] == 0.0);
        let values = tuning.values(&found.candidates[found.chosen]);
        let text = tuning.document(&values).unwrap();
        assert!(text.contains("# weights of (phi, theta, phi_dot, theta_dot)"));
        let scenario = Scenario::parse(&text, "tuned").unwrap();
        assert_eq!(
            Some(scenario.controller.horizon as i64),
            values[0].as_integer()
        );
        assert_eq!(scenario.controller.r, values[2].as_float());
        // Other worlds than those of the search, and the same before and after.
        let [before, after] = [tuning.start(), &values].map(|values| held_out(tuning, values));
        let comparisons = tuning.compare(&before, &after).unwrap();
        assert_eq!(before.len(), 6);
        assert_ne!(comparisons[0].before.value, start.goals[0]);
        assert!(comparisons[0].is_better(), "{:?}", comparisons[0]);
        let seen = tuning.compare(&before, &before).unwrap();
        assert_eq!(seen[0].difference.upper, 0.0);
    });
}

/// Where nothing was better than a `start` of the tuning's own, there was no scenario of it.
#[test]
fn a_start_of_ones_own_is_not_what_the_scenario_says() {
    let starts_elsewhere = |text: &str| {
        let (_folder, source) = written(text);
        let tuning = Tuning::new(&source, source.folder(), PROGRAM).unwrap();
        tuning.starts_elsewhere()
    };
    assert!(!starts_elsewhere(TWO_GOALS));
    let with_start = TWO_GOALS.replace("[20.0, 2000.0] }", "[20.0, 2000.0], start = 30.0 }");
    assert!(starts_elsewhere(&with_start));
}

#[test]
fn values_that_make_no_scenario_are_refused_candidates_and_a_start_that_makes_none_is_an_error() {
    let text = TWO_GOALS.replace(
        "\"controller.horizon\" = { integers = [8, 24] }",
        "\"controller.horizon\" = { list = [-1, 20] }",
    );
    with(&text, |tuning| {
        let (found, whole) = search(tuning, "").unwrap();
        let refused = found
            .candidates
            .iter()
            .find(|entry| entry.state == State::Refused);
        assert!(
            refused
                .unwrap()
                .refused
                .as_ref()
                .unwrap()
                .contains("horizon")
        );
        assert!(
            found
                .front
                .iter()
                .all(|place| found.candidates[*place].state == State::Whole)
        );
        let (again, added) = search(tuning, &whole).unwrap();
        assert_eq!((again.candidates, added.as_str()), (found.candidates, ""));
    });
    let text = TWO_GOALS.replace(
        "= { integers = [8, 24] }",
        "= { list = [-1, 20], start = -1 }",
    );
    let (_folder, source) = written(&text);
    let error = Tuning::new(&source, source.folder(), PROGRAM).unwrap_err();
    assert!(error.to_string().contains("horizon"), "{error}");
}

fn held_out(tuning: &Tuning<'_, &Path>, values: &[Value]) -> Vec<Ran> {
    let mut run = |batch: &Batch| tuning.run(batch);
    tuning.held_out::<TuningError>(values, &mut run).unwrap()
}

#[test]
fn limits_that_nothing_keeps_are_no_result() {
    let text = TWO_GOALS.replace("at_most = 0.6", "at_most = 0.0001");
    with(&text, |tuning| {
        let error = search(tuning, "").unwrap_err().to_string();
        assert!(error.contains("no candidate keeps all limits"), "{error}");
        assert!(
            error.contains("share of failures 1.0000 (at most 0)"),
            "{error}"
        );
    });
}

#[test]
fn without_anything_random_there_is_nothing_to_hold_out() {
    let text = TWO_GOALS
        .replace(
            "[[worlds.vary]]\nkey = \"initial_state.theta_rad\"\nuniform = [-0.1, 0.1]\n",
            "",
        )
        .replace("runs = 4\n", "")
        .replace("runs = 6\n", "");
    with(&text, |tuning| {
        assert_eq!(tuning.runs(), 1);
        let ran = held_out(tuning, tuning.start());
        assert_eq!(tuning.compare(&ran, &ran), None);
        assert_eq!(tuning.start()[0], Value::Integer(20));
    });
}

/// Four digits of a multiple of a step are none as a rule: 190.375 became 190.4.
#[test]
fn values_with_a_step_are_multiples_of_it() {
    let (free, step) = (
        "log_uniform = [20.0, 2000.0]",
        "uniform = [180.0, 220.0], round_to = 0.125",
    );
    assert!(TWO_GOALS.contains(free));
    with(&TWO_GOALS.replace(free, step), |tuning| {
        let (found, _) = search(tuning, "").unwrap();
        let values = found.candidates.iter().skip(1);
        let values: Vec<f64> = values
            .map(|candidate| tuning.values(candidate)[1].as_float().unwrap())
            .collect();
        let steps: Vec<f64> = values.iter().map(|value| value / 0.125).collect();
        assert!(steps.iter().all(|steps| steps.fract() == 0.0), "{values:?}");
        assert!(steps.iter().any(|steps| steps % 2.0 == 1.0), "{values:?}");
    });
}
