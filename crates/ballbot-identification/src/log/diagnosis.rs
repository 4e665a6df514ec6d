//! From columns of numbers to a run: what can be used, and what is odd.

mod sensors;
mod stamps;

use super::columns::Columns;
use super::error::Problem;
use super::finding::Finding;
use super::run::Run;
use super::table::Table;
use nalgebra::Vector3;
use std::ops::Range;
use std::path::Path;

/// Fewer rows are no log.
const FEWEST_ROWS: usize = 20;

/// The shortest stretch that a fit can use, s.
const SHORTEST_STRETCH: f64 = 1.0;

/// Names of the columns for messages, in the order of [`Table::columns`].
pub(super) struct Names<'a>([&'a str; 5]);

pub(super) fn run(
    path: &Path,
    mut table: Table,
    columns: &Columns,
    findings: &mut Vec<Finding>,
) -> Result<Run, Problem> {
    let rows = table.lines.len();
    if rows < FEWEST_ROWS {
        return Err(Problem::FewRows {
            rows,
            needed: FEWEST_ROWS,
        });
    }
    let torque_name = if columns.torque.column.is_empty() {
        "torque"
    } else {
        &columns.torque.column
    };
    let names = Names([
        &columns.time.column,
        columns.phi_name(),
        &columns.theta.column,
        &columns.theta_dot.column,
        torque_name,
    ]);
    let (time, mut breaks) = stamps::check(&table, &names, findings)?;
    let out = time.iter().enumerate();
    let out = out.filter(|(_, time)| !columns.takes(**time));
    let out: Vec<usize> = out.map(|(row, _)| row).collect();
    for &row in &out {
        isolate(row, &mut breaks);
    }
    if !out.is_empty() {
        findings.push(Finding::LeftOut { count: out.len() });
    }
    let length = time.last().copied().unwrap_or_default();
    let beyond = columns.leave_out.iter().filter(|[from, _]| *from > length);
    findings.extend(beyond.map(|&[from, to]| Finding::NothingLeftOut { from, to, length }));
    // What is left out must say nothing of the rest: where it is the larger part, it would be the middle.
    table.forget(&out);
    let table = &table;
    let has_rate = !columns.theta_dot.column.is_empty();
    missing(table, &names, has_rate, &out, findings)?;
    sensors::constant(table, &names)?;
    let [_, phi, theta, theta_dot, torque] = &table.columns;
    let angle;
    let phi = if table.rate_of_ball {
        findings.push(Finding::IntegratedRate {
            column: names.0[1].to_owned(),
        });
        angle = integrated(&time, phi, &mut breaks);
        &angle
    } else {
        phi
    };
    let outputs = phi.iter().zip(theta).zip(theta_dot);
    let mut run = Run {
        name: path.display().to_string(),
        outputs: outputs
            .map(|((phi, theta), theta_dot)| Vector3::new(*phi, *theta, *theta_dot))
            .collect(),
        torque: torque.clone(),
        stretches: stretches(&breaks, torque),
        torque_kind: table.torque,
        time,
    };
    // First of all: in degrees, an upright robot looks fallen.
    if let Some(suspicion) = sensors::units(&run, &names, findings) {
        if !columns.accept_suspicious_units {
            return Err(Problem::Units(suspicion));
        }
        findings.push(Finding::AcceptedUnits(suspicion));
    }
    sensors::jumps(table, &run, &names, &mut breaks, findings);
    sensors::standing_out(table, &names, &mut breaks, findings);
    sensors::fallen(table, &run.time, &mut breaks, findings);
    sensors::torque(table, findings);
    sensors::stuck_or_stepped(table, &names, &run.time, findings);
    run.stretches = stretches(&breaks, torque);
    let lengths = run.stretches.iter().map(|stretch| run.length(stretch));
    let longest = lengths.fold(0.0, f64::max);
    if longest < SHORTEST_STRETCH {
        let jumps = findings.iter().filter_map(|finding| match finding {
            Finding::Jumps { column, count, .. } => Some((column.clone(), *count)),
            _ => None,
        });
        let jumps = jumps.max_by_key(|(_, count)| *count);
        // These have sentences of their own.
        let (_, seen): (Vec<_>, Vec<_>) = findings.drain(..).partition(|finding| {
            matches!(finding, Finding::Jumps { .. } | Finding::LeftOut { .. })
        });
        return Err(Problem::NoStretch {
            needed: SHORTEST_STRETCH,
            longest,
            rows,
            left_out: out.len(),
            jumps,
            seen,
        });
    }
    Ok(run)
}

/// Lets a row stand alone, so that it is in no stretch.
fn isolate(row: usize, breaks: &mut [bool]) {
    breaks[row] = true;
    if let Some(next) = breaks.get_mut(row + 1) {
        *next = true;
    }
}

/// The angle of a rate, by trapezoids. Across a break, and a missing rate, it goes on where it was.
fn integrated(time: &[f64], rate: &[f64], breaks: &mut [bool]) -> Vec<f64> {
    let mut angle = vec![0.0; rate.len()];
    for row in 1..rate.len() {
        let change = 0.5 * (rate[row] + rate[row - 1]) * (time[row] - time[row - 1]);
        breaks[row] |= change.is_nan();
        angle[row] = angle[row - 1] + if breaks[row] { 0.0 } else { change };
    }
    angle
}

/// Values that are not there, in the rows that are not left `out` (in their order).
fn missing(
    table: &Table,
    names: &Names<'_>,
    has_rate: bool,
    out: &[usize],
    findings: &mut Vec<Finding>,
) -> Result<(), Problem> {
    let rows = table.lines.len() - out.len();
    for (place, values) in table.columns.iter().enumerate().skip(1) {
        if place == 3 && !has_rate {
            continue;
        }
        let mut missing = values
            .iter()
            .enumerate()
            .filter(|(row, value)| value.is_nan() && out.binary_search(row).is_err());
        let Some((first, _)) = missing.next() else {
            continue;
        };
        let (column, count) = (names.0[place].to_owned(), 1 + missing.count());
        if 2 * count > rows {
            return Err(Problem::MostlyMissing {
                column,
                missing: count,
                rows,
            });
        }
        findings.push(Finding::MissingValues {
            column,
            count,
            line: table.lines[first],
        });
    }
    Ok(())
}

/// The rows between breaks and missing torques. `breaks[i]` says that row i does not follow the row
/// before; a row between two breaks stands alone and is in no stretch.
fn stretches(breaks: &[bool], torque: &[f64]) -> Vec<Range<usize>> {
    let mut stretches = Vec::new();
    let mut start = 0;
    let mut end_at = |start: usize, end: usize| {
        if end > start + 1 {
            stretches.push(start..end);
        }
    };
    for row in 0..breaks.len() {
        if breaks[row] {
            end_at(start, row);
            start = row;
        }
        if torque[row].is_nan() {
            end_at(start, row);
            start = row + 1;
        }
    }
    end_at(start, breaks.len());
    stretches
}
