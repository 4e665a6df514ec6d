//! The time stamps.

use super::Names;
use crate::log::error::Problem;
use crate::log::finding::Finding;
use crate::log::run::{median, quantile};
use crate::log::table::Table;

/// An interval this many times the median one is a gap.
const GAP: f64 = 3.0;

/// Median intervals of a log, s: slower is no control loop, faster no robot.
const INTERVALS: std::ops::RangeInclusive<f64> = 2e-5..=0.2;

/// The times since the first row, and which rows do not follow the row before.
pub(super) fn check(
    table: &Table,
    names: &Names<'_>,
    findings: &mut Vec<Finding>,
) -> Result<(Vec<f64>, Vec<bool>), Problem> {
    let stamps = &table.columns[0];
    if let Some(row) = stamps.iter().position(|stamp| stamp.is_nan()) {
        return Err(Problem::MissingTime {
            line: table.lines[row],
        });
    }
    let time: Vec<f64> = stamps.iter().map(|stamp| stamp - stamps[0]).collect();
    let intervals: Vec<f64> = time.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let forward = intervals.iter().copied().filter(|interval| *interval > 0.0);
    let mut forward: Vec<f64> = forward.collect();
    if intervals.iter().all(|interval| *interval == 0.0) {
        return Err(Problem::Constant {
            column: names.0[0].to_owned(),
            value: stamps[0],
            consequence: "the rows have no order in time",
        });
    }
    let backward = intervals.iter().filter(|interval| **interval < 0.0).count();
    if backward > forward.len() {
        return Err(Problem::Backwards {
            column: names.0[0].to_owned(),
            count: backward,
            rows: time.len(),
        });
    }
    let middle = median(&mut forward);
    if !INTERVALS.contains(&middle) {
        return Err(Problem::Rate { interval: middle });
    }
    irregular(table, &time, &intervals, middle, findings);
    let even = forward
        .iter()
        .copied()
        .filter(|interval| *interval <= GAP * middle);
    let mut even: Vec<f64> = even.collect();
    let (least, most) = (quantile(&mut even, 0.01), quantile(&mut even, 0.99));
    if most > 1.2 * middle || least < 0.8 * middle {
        let longest = even.iter().copied().fold(0.0, f64::max);
        findings.push(Finding::Jitter {
            median: middle,
            most,
            longest,
        });
    }
    let follows = |interval: &f64| *interval > 0.0 && *interval <= GAP * middle;
    let breaks = std::iter::once(false).chain(intervals.iter().map(|interval| !follows(interval)));
    Ok((time, breaks.collect()))
}

/// Gaps, duplicates, steps back.
fn irregular(
    table: &Table,
    time: &[f64],
    intervals: &[f64],
    middle: f64,
    findings: &mut Vec<Finding>,
) {
    let rows = |which: &dyn Fn(f64) -> bool| -> Vec<usize> {
        let rows = intervals.iter().enumerate();
        rows.filter(|(_, interval)| which(**interval))
            .map(|(row, _)| row)
            .collect()
    };
    let gaps = rows(&|interval| interval > GAP * middle);
    let longest = gaps
        .iter()
        .max_by(|a, b| intervals[**a].total_cmp(&intervals[**b]));
    if let Some(&longest) = longest {
        findings.push(Finding::Gaps {
            count: gaps.len(),
            longest: intervals[longest],
            time: time[longest],
        });
    }
    let duplicates = rows(&|interval| interval == 0.0);
    if let Some(first) = duplicates.first() {
        findings.push(Finding::DuplicateStamps {
            count: duplicates.len(),
            line: table.lines[first + 1],
        });
    }
    let backward = rows(&|interval| interval < 0.0);
    if let Some(&first) = backward.first() {
        findings.push(Finding::BackwardStamps {
            count: backward.len(),
            line: table.lines[first + 1],
            by: -intervals[first],
        });
    }
}
