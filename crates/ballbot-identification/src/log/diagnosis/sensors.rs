//! The measured values and the torque.

use super::{Names, isolate};
use crate::log::error::{Problem, Suspicion};
use crate::log::finding::Finding;
use crate::log::run::{Run, Torque, median, quantile};
use crate::log::table::Table;

/// A column that never changes.
pub(super) fn constant(table: &Table, names: &Names<'_>) -> Result<(), Problem> {
    let consequences = [
        "the rows have no order in time",
        "the ball did not move, or its encoder is not connected",
        "the body did not move, or its sensor is not connected",
        "the gyroscope is not connected; set column = \"\" in [log.theta_dot] if there is none",
        "without torque nothing can be told of inertias. Record while the robot is excited (`ballbot excite`)",
    ];
    for ((values, name), consequence) in table.columns.iter().zip(names.0).zip(consequences) {
        let mut present = values.iter().filter(|value| !value.is_nan());
        let Some(first) = present.next() else {
            continue;
        };
        if present.all(|value| value == first) {
            return Err(Problem::Constant {
                column: name.to_owned(),
                value: *first,
                consequence,
            });
        }
    }
    Ok(())
}

/// A change of the angle differs from its neighbours' by at least so much where it jumps, rad.
const SMALLEST_JUMP: f64 = 0.2;

/// Jumps of the angles; the run is cut there.
pub(super) fn jumps(
    table: &Table,
    run: &Run,
    names: &Names<'_>,
    breaks: &mut [bool],
    findings: &mut Vec<Finding>,
) {
    for place in [1, 2] {
        let values: Vec<f64> = run.outputs.iter().map(|row| row[place - 1]).collect();
        let changes: Vec<f64> = values.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let excess = |i: usize| {
            let before = changes[i.saturating_sub(1)];
            let after = changes[(i + 1).min(changes.len() - 1)];
            // At either end a neighbour is the change itself, beside what is missing there is none: only the
            // other one counts.
            let neighbours = match i {
                0 => after,
                _ if i + 1 == changes.len() || after.is_nan() => before,
                _ if before.is_nan() => after,
                _ => 0.5 * (before + after),
            };
            let largest = changes[i].abs() >= before.abs().max(after.abs());
            if largest {
                (changes[i] - neighbours).abs()
            } else {
                0.0
            }
        };
        let excesses: Vec<f64> = (0..changes.len()).map(excess).collect();
        let mut sorted: Vec<f64> = excesses.iter().copied().filter(|e| !e.is_nan()).collect();
        let threshold = SMALLEST_JUMP.max(40.0 * median(&mut sorted));
        let jumps: Vec<usize> = (0..changes.len())
            .filter(|i| excesses[*i] > threshold && !breaks[i + 1])
            .collect();
        if let Some(&first) = jumps.first() {
            findings.push(Finding::Jumps {
                column: names.0[place].to_owned(),
                count: jumps.len(),
                line: table.lines[first + 1],
                size: changes[first],
            });
        }
        for jump in jumps {
            breaks[jump + 1] = true;
        }
    }
}

/// A rate or a torque so many times as far from its middle as 99 % of all are is none of a robot, unless it lasts.
const STANDS_OUT: f64 = 5.0;

/// Rows whose tilt rate or torque is many times what all others are; they are cut out one by one. Neither changes
/// smoothly, so that a jump says nothing.
pub(super) fn standing_out(
    table: &Table,
    names: &Names<'_>,
    breaks: &mut [bool],
    findings: &mut Vec<Finding>,
) {
    for place in [3, 4] {
        let values = &table.columns[place];
        let middle = middle_of(values);
        let distances = values.iter().map(|value| (value - middle).abs());
        let mut present: Vec<f64> = distances.clone().filter(|d| !d.is_nan()).collect();
        // Where most values are the same, such as a torque that is zero between pulses, any other stands out.
        if median(&mut present) == 0.0 {
            continue;
        }
        let usual = quantile(&mut present, 0.99);
        let beyond: Vec<bool> = distances.map(|d| d > STANDS_OUT * usual).collect();
        let excursions = beyond.chunk_by(|a, b| a == b).scan(0, |begin, rows| {
            let range = *begin..*begin + rows.len();
            *begin = range.end;
            Some((rows[0], range))
        });
        let spikes = excursions.filter(|(beyond, range)| *beyond && range.len() < SPIKE);
        let rows: Vec<usize> = spikes.flat_map(|(_, range)| range).collect();
        for &row in &rows {
            isolate(row, breaks);
        }
        if let Some(&first) = rows.first() {
            findings.push(Finding::StandOut {
                column: names.0[place].to_owned(),
                count: rows.len(),
                line: table.lines[first],
                value: values[first],
                usual,
            });
        }
    }
}

/// Beyond this distance from its middle the tilt is not that of a standing robot, rad.
const FALLEN: f64 = 0.8;

/// Rows in which the robot does not stand; they are cut out one by one.
pub(super) fn fallen(
    table: &Table,
    time: &[f64],
    breaks: &mut [bool],
    findings: &mut Vec<Finding>,
) {
    let middle = middle_of(&table.columns[2]);
    let theta = table.columns[2].iter().enumerate();
    let rows = theta.filter(|(_, theta)| (*theta - middle).abs() > FALLEN);
    let stands_alone = |row: usize| breaks[row] && breaks.get(row + 1) == Some(&true);
    let rows = rows.map(|(row, _)| row).filter(|row| !stands_alone(*row));
    let rows: Vec<usize> = rows.collect();
    for &row in &rows {
        isolate(row, breaks);
    }
    if let Some(&first) = rows.first() {
        findings.push(Finding::Fallen {
            count: rows.len(),
            time: time[first],
            line: table.lines[first],
        });
    }
}

fn middle_of(values: &[f64]) -> f64 {
    let mut present: Vec<f64> = values.iter().copied().filter(|v| !v.is_nan()).collect();
    median(&mut present)
}

/// This part of the rows at the largest torque is a limit, not a peak.
const SATURATED_PART: f64 = 0.02;

/// Saturation, and what was asked for against what acted.
pub(super) fn torque(table: &Table, findings: &mut Vec<Finding>) {
    let torque = &table.columns[4];
    let rows = torque.iter().filter(|value| !value.is_nan()).count() as f64;
    let limit = torque
        .iter()
        .fold(0.0_f64, |limit, value| limit.max(value.abs()));
    // A bang-bang signal is at its limit all the time, and is none that was cut off.
    let at_limit = torque.iter().filter(|value| value.abs() >= 0.999 * limit);
    let part = at_limit.count() as f64 / rows;
    if (SATURATED_PART..0.9).contains(&part) {
        findings.push(Finding::Saturated {
            limit,
            part,
            commanded: table.torque == Torque::Commanded,
        });
    }
    let pairs = table.commanded.iter().zip(torque);
    let squares = pairs.map(|(asked, acted)| (asked - acted).powi(2));
    let squares: Vec<f64> = squares.filter(|square| !square.is_nan()).collect();
    let difference = (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt();
    if difference > 0.02 * limit {
        findings.push(Finding::CommandNotApplied { difference });
    }
}

/// A standing robot trembles: a value that is the same for so long is a sensor that hangs, s.
const FROZEN: f64 = 0.25;

/// Values that hang, and values in steps.
pub(super) fn stuck_or_stepped(
    table: &Table,
    names: &Names<'_>,
    time: &[f64],
    findings: &mut Vec<Finding>,
) {
    for place in 1..=3 {
        let values = &table.columns[place];
        let column = || names.0[place].to_owned();
        let mut distinct: Vec<f64> = values.iter().copied().filter(|v| !v.is_nan()).collect();
        let rows = distinct.len();
        distinct.sort_by(f64::total_cmp);
        distinct.dedup();
        if distinct.len() * 5 < rows {
            let steps = distinct.windows(2).map(|pair| pair[1] - pair[0]);
            let mut steps: Vec<f64> = steps.collect();
            let step = median(&mut steps);
            findings.push(Finding::Quantised {
                column: column(),
                step,
            });
            // A coarse value stays on a step while the robot moves within it.
            continue;
        }
        let (mut start, mut longest) = (0, (0.0, 0));
        for row in 1..=values.len() {
            if row == values.len() || values[row] != values[start] {
                let duration = time[row - 1] - time[start];
                if duration > longest.0 {
                    longest = (duration, start);
                }
                start = row;
            }
        }
        if longest.0 > FROZEN {
            findings.push(Finding::Frozen {
                column: column(),
                duration: longest.0,
                line: table.lines[longest.1],
            });
        }
    }
}

/// A robot that leans beyond [`FALLEN`] lies. One that comes back so many times is none: its tilt is
/// in degrees.
const RETURNS: usize = 2;

/// An excursion of fewer rows is a spike.
const SPIKE: usize = 3;

/// Changes of the tilt are looked at over this time, s: long against the noise of the gyroscope,
/// short against the time in which its bias matters.
const WINDOW: f64 = 0.2;

/// Below this change of the tilt over a window nothing can be said, rad.
const SMALLEST_CHANGE: f64 = 5e-3;

/// Whether the tilt and its rate belong together.
pub(super) fn units(
    run: &Run,
    names: &Names<'_>,
    findings: &mut Vec<Finding>,
) -> Option<Suspicion> {
    let rows = run.stretches.iter().cloned().flatten();
    let theta: Vec<f64> = rows.map(|row| run.outputs[row][1]).collect();
    let slope = slope_of_tilt_over_rate(run);
    if let Some((slope, change)) = slope
        && !(0.7..=1.4).contains(&slope)
    {
        if change > SMALLEST_CHANGE {
            return Some(Suspicion::TiltAgainstRate {
                slope,
                tilt: names.0[2].to_owned(),
                rate: names.0[3].to_owned(),
            });
        }
        findings.push(Finding::TiltAgainstRate { slope });
    }
    let returns = returns_from_beyond(&theta);
    (returns >= RETURNS).then(|| Suspicion::LargeTilt {
        returns,
        limit: FALLEN,
        column: names.0[2].to_owned(),
    })
}

/// How many times the tilt goes beyond [`FALLEN`] for more than a spike, and comes back.
fn returns_from_beyond(theta: &[f64]) -> usize {
    let middle = middle_of(theta);
    let (mut beyond, mut returns) = (0, 0);
    for value in theta {
        let distance = (value - middle).abs();
        if distance > FALLEN {
            beyond += 1;
        } else if distance < 0.5 * FALLEN {
            returns += usize::from(beyond >= SPIKE);
            beyond = 0;
        }
    }
    returns
}

/// Slope of the tilt's changes over the integrals of the rate, and the size of the larger of them, rad.
fn slope_of_tilt_over_rate(run: &Run) -> Option<(f64, f64)> {
    let mut pairs: Vec<(f64, f64)> = Vec::new();
    for stretch in &run.stretches {
        let mut start = stretch.start;
        let mut integral = 0.0;
        for row in stretch.start + 1..stretch.end {
            let duration = run.time[row] - run.time[row - 1];
            integral += 0.5 * duration * (run.outputs[row][2] + run.outputs[row - 1][2]);
            if run.time[row] - run.time[start] >= WINDOW {
                let change = run.outputs[row][1] - run.outputs[start][1];
                if (change * integral).is_finite() {
                    pairs.push((integral, change));
                }
                (start, integral) = (row, 0.0);
            }
        }
    }
    // Medians, because a fall or a spike must not decide about units.
    let middle = |of: fn(&(f64, f64)) -> f64| median(&mut pairs.iter().map(of).collect::<Vec<_>>());
    let (middle_integral, middle_change) = (middle(|pair| pair.0), middle(|pair| pair.1));
    let sizes = pairs.iter().map(|pair| (pair.0 - middle_integral).abs());
    let size = median(&mut sizes.collect::<Vec<_>>());
    let changes = pairs.iter().map(|pair| (pair.1 - middle_change).abs());
    let change = median(&mut changes.collect::<Vec<_>>());
    // Of a tilt in the wrong unit, or of its rate, one alone may look like rest.
    let change = change.max(size);
    let ratios = pairs
        .iter()
        .map(|pair| (pair.0 - middle_integral, pair.1 - middle_change))
        .filter(|(integral, _)| integral.abs() >= size)
        .map(|(integral, change)| change / integral);
    let mut ratios: Vec<f64> = ratios.collect();
    (pairs.len() >= 4 && size > 0.0).then(|| (median(&mut ratios), change))
}
