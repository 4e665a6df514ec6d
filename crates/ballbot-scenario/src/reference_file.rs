//! A reference from a CSV file.

use crate::error::ScenarioError;
use crate::reference::SAME_TIME;
use crate::schema::{CsvTable, PointTable};
use std::path::Path;

/// Reads a reference file, refusing gaps rather than guessing what was meant.
pub(crate) fn read(
    table: &CsvTable,
    duration: f64,
    directory: &Path,
) -> Result<Vec<PointTable>, ScenarioError> {
    let path = directory.join(&table.path);
    let file = std::fs::read(&path).map_err(|source| ScenarioError::Read {
        path: path.clone(),
        source,
    })?;
    let problem = |line: Option<u64>, problem: String| ScenarioError::ReferenceFile {
        path: path.clone(),
        line,
        problem,
    };
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .comment(Some(b'#'))
        .from_reader(file.as_slice());
    let headers = reader
        .headers()
        .map_err(|error| problem(Some(1), error.to_string()))?
        .clone();
    let column = |name: &str| {
        headers
            .iter()
            .position(|header| header == name)
            .ok_or_else(|| {
                let present = headers.iter().collect::<Vec<_>>().join(", ");
                problem(
                    Some(1),
                    format!("there is no column `{name}`; the columns are: {present}"),
                )
            })
    };
    let (time_column, phi_column) = (column(&table.time_column)?, column(&table.phi_column)?);

    let mut points = Vec::new();
    let mut lines = Vec::new();
    for record in reader.records() {
        let record = record.map_err(|error| {
            problem(error.position().map(csv::Position::line), error.to_string())
        })?;
        let line = record.position().map(csv::Position::line);
        let number = |column: usize, name: &str| {
            let text = record.get(column).unwrap_or("");
            match text.parse::<f64>() {
                Ok(value) if value.is_finite() => Ok(value),
                _ if text.is_empty() => Err(problem(line, format!("`{name}` is missing"))),
                _ => Err(problem(
                    line,
                    format!("`{name}` is `{text}`, which is not a finite number"),
                )),
            }
        };
        points.push(PointTable {
            time_s: number(time_column, &table.time_column)?,
            phi_rad: number(phi_column, &table.phi_column)?,
        });
        lines.push(line);
    }
    check_grid(&points, &lines, duration, &path)?;
    Ok(points)
}

/// An interval this many times the median one is a gap.
const GAP: f64 = 3.0;

/// Times increase without a gap and cover the run.
fn check_grid(
    points: &[PointTable],
    lines: &[Option<u64>],
    duration: f64,
    path: &Path,
) -> Result<(), ScenarioError> {
    let problem = |line: Option<u64>, problem: String| ScenarioError::ReferenceFile {
        path: path.to_owned(),
        line,
        problem,
    };
    let (Some(first), Some(last)) = (points.first(), points.last()) else {
        return Err(problem(
            None,
            "there are no rows below the header".to_owned(),
        ));
    };
    let intervals = points
        .windows(2)
        .map(|pair| pair[1].time_s - pair[0].time_s);
    let mut sorted: Vec<f64> = intervals.clone().collect();
    sorted.sort_by(f64::total_cmp);
    let median = sorted.get(sorted.len() / 2).copied().unwrap_or(0.0);
    for (i, interval) in intervals.enumerate() {
        let line = lines.get(i + 1).copied().flatten();
        let time = points[i].time_s;
        if interval <= 0.0 {
            return Err(problem(
                line,
                format!(
                    "time does not increase: {} s after {time} s",
                    time + interval
                ),
            ));
        }
        if interval > GAP * median {
            return Err(problem(
                line,
                format!(
                    "a gap of {interval:.6} s after {time} s, where rows are {median:.6} s apart; \
                     fill it in"
                ),
            ));
        }
    }
    if first.time_s > SAME_TIME {
        return Err(problem(
            lines.first().copied().flatten(),
            format!(
                "it begins at {} s; it must begin at 0 s or before",
                first.time_s
            ),
        ));
    }
    if last.time_s < duration - SAME_TIME && points.len() > 1 {
        return Err(problem(
            lines.last().copied().flatten(),
            format!(
                "it ends at {} s, before the run does (duration_s = {duration})",
                last.time_s
            ),
        ));
    }
    Ok(())
}
