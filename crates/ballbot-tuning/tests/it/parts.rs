//! Closed loops that other processes run, handed over as texts.

use crate::{TWO_GOALS, search, search_by, with};
use ballbot_campaign::Shard;
use ballbot_tuning::{Batch, Tried, Tuning, TuningError, Worlds};
use std::path::Path;

/// A batch run in so many parts, each from its text to its text.
fn in_parts(
    tuning: &Tuning<'_, &Path>,
    batch: &Batch,
    parts: u32,
) -> Result<Vec<Tried>, TuningError> {
    let text = tuning.batch_text(batch);
    let machine = tuning.machine()?;
    let mut all = Vec::new();
    for part in Shard::all(parts) {
        let result = tuning.run_part(&text, part)?;
        all.extend(tuning.read_part(&text, part, &result, &machine)?);
    }
    Ok(all)
}

/// Runs that ended early have infinite measures, which JSON has no number for.
#[test]
fn a_search_by_other_processes_finds_the_same_to_the_bit() {
    let hard = TWO_GOALS
        .replace("[-0.1, 0.1]", "[-1.4, 1.4]")
        .replace("at_most = 0.0\n", "at_most = 1.0\n")
        .replace("\"mean\"", "{ quantile = 0.25 }")
        .replace("\"worst\"", "{ quantile = 0.25 }");
    let mut infinite = 0;
    with(&hard, |tuning| {
        let (found, journal) = search(tuning, "").unwrap();
        let (again, other) = search_by(tuning, "", &mut |batch| {
            let tried = in_parts(tuning, batch, 3)?;
            let ended = |tried: &&Tried| matches!(tried, Tried::Ran(ran) if ran.lost > 0.0);
            infinite += tried.iter().filter(ended).count();
            Ok(tried)
        })
        .unwrap();
        assert_eq!(journal, other);
        assert_eq!(found.outcomes, again.outcomes);
    });
    assert!(infinite > 10, "{infinite}");
}

#[test]
fn a_part_that_is_cut_off_or_of_something_else_is_refused() {
    let value = |number: f64| serde_json::Value::from(number);
    let batch = |r: f64| Batch {
        worlds: Worlds::Search,
        candidates: vec![vec![20.into(), value(100.0), value(r)]],
        loops: vec![(0, 0), (0, 1), (0, 2), (0, 3)],
    };
    let [first, second] = ["1/2", "2/2"].map(|part| part.parse::<Shard>().unwrap());
    let said = |result: Result<_, TuningError>| match result {
        Ok(_) => panic!("it is taken"),
        Err(error) => error.to_string(),
    };
    let text = with(TWO_GOALS, |tuning| {
        let text = tuning.batch_text(&batch(1000.0));
        let result = tuning.run_part(&text, first).unwrap();
        let machine = tuning.machine().unwrap();
        let read =
            |part, result: &str, machine: &str| tuning.read_part(&text, part, result, machine);
        assert_eq!(read(first, &result, &machine).unwrap().len(), 2);
        let cut = &result[..result.len() - 9];
        assert!(said(read(first, cut, &machine)).contains("cut off"));
        assert!(said(read(first, &result, "0123")).contains("a machine that makes other numbers"));
        let third = tuning.run_part(&text, "1/4".parse().unwrap()).unwrap();
        assert!(said(read(first, &third, &machine)).contains("another batch"));
        let other = tuning.batch_text(&batch(1001.0));
        let other = tuning.run_part(&other, second).unwrap();
        assert!(said(read(second, &other, &machine)).contains("another batch"));
        let mut nowhere = batch(1000.0);
        nowhere.loops[3] = (0, 4);
        let nowhere = tuning.run_part(&tuning.batch_text(&nowhere), second);
        assert!(
            nowhere
                .unwrap_err()
                .to_string()
                .contains("a world that is none")
        );
        text
    });
    with(&TWO_GOALS.replace("seed = 1", "seed = 2"), |tuning| {
        let error = tuning.run_part(&text, first).unwrap_err().to_string();
        assert!(error.contains("for another tuning"), "{error}");
        let error = tuning.run_part(&text[..40], first).unwrap_err().to_string();
        assert!(error.contains("no batch of a tuning"), "{error}");
    });
}
