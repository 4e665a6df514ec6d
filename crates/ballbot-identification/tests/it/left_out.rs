//! What a configuration leaves out of a log says nothing of the rest.

use crate::laboratory::{Laboratory, csv, healthy};
use ballbot_identification::Config;
use ballbot_identification::log::{self, Log, LogError};

/// Rows of the log, and those of them that are left out: more than half.
const ROWS: usize = 300;
const OUT: usize = 180;

/// A log of which one column of the rows that are left out is another.
fn log_with(column: usize, change: impl Fn(usize, f64) -> Option<f64>) -> Result<Log, LogError> {
    let laboratory = Laboratory {
        duration: 3.0,
        rate: 100.0,
        ..healthy()
    };
    let text = csv(&laboratory.record(1));
    let (header, rows) = text.split_once('\n').unwrap();
    let changed = rows.lines().enumerate().map(|(row, line)| {
        let mut fields: Vec<String> = line.split(',').map(str::to_owned).collect();
        if row < OUT {
            let value = change(row, fields[column].parse().unwrap());
            fields[column] = value.map_or(String::new(), |value| value.to_string());
        }
        fields.join(",") + "\n"
    });
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.csv");
    std::fs::write(&path, format!("{header}\n{}", changed.collect::<String>())).unwrap();
    let config = Config::parse("[log]\nleave_out = [[0.0, 1.795]]").unwrap();
    log::read(&path, &config.log, &|_| ())
}

/// Where the robot lay for more than half of the log, all of the rest was what had fallen.
#[test]
fn a_larger_part_that_is_left_out_judges_nothing() {
    type Change = fn(usize, f64) -> Option<f64>;
    let changes: [(usize, Change); 5] = [
        // It lies; it is turned over again and again, as if its tilt were in degrees.
        (2, |_, theta| Some(theta + 1.5)),
        (2, |row, theta| Some(theta + 1.5 * f64::from(row % 60 < 20))),
        // The gyroscope hangs, and there is none.
        (3, |_, _| Some(0.1)),
        (3, |_, _| None),
        // The motors are at their limit.
        (5, |row, _| Some(if row % 2 == 0 { 9.0 } else { -9.0 })),
    ];
    for (case, (column, change)) in changes.into_iter().enumerate() {
        let log = log_with(column, change).unwrap();
        assert_eq!(
            log.run.stretches.len(),
            1,
            "case {case}: {:?}",
            log.findings
        );
        assert_eq!(log.run.stretches.first(), Some(&(OUT..ROWS)), "case {case}");
        assert_eq!(log.findings.len(), 1, "case {case}: {:?}", log.findings);
    }
}

/// The motors were on in what is left out alone.
#[test]
fn what_is_left_is_judged_by_itself() {
    let laboratory = Laboratory {
        duration: 3.0,
        rate: 100.0,
        ..healthy()
    };
    let mut record = laboratory.record(1);
    record.run.torque[OUT..].fill(0.0);
    record.commanded[OUT..].fill(0.0);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.csv");
    std::fs::write(&path, csv(&record)).unwrap();
    let config = Config::parse("[log]\nleave_out = [[0.0, 1.795]]").unwrap();
    let message = log::read(&path, &config.log, &|_| ()).unwrap_err();
    assert!(message.to_string().contains("without torque"), "{message}");
}
