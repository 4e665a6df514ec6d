//! A measured run in SI units.

use nalgebra::Vector3;
use std::ops::Range;

/// Which torque a log holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Torque {
    /// The one that acted, `torque_applied_nm`.
    Applied,
    /// The one that was asked for, `torque_commanded_nm`.
    Commanded,
    /// A column that the configuration names.
    Named,
}

/// One plane of a robot over one recording.
#[derive(Clone, Debug)]
pub struct Run {
    /// The file it came from, for messages.
    pub name: String,
    /// Time stamps since the first row, s. They increase within a stretch.
    pub time: Vec<f64>,
    /// Ball angle (rad), tilt (rad), tilt rate (rad/s) of each row; NaN where missing.
    pub outputs: Vec<Vector3<f64>>,
    /// Torque of the virtual wheel from each row to the next, N m.
    pub torque: Vec<f64>,
    /// Rows between which nothing is missing: no gap, no jump, every torque known.
    pub stretches: Vec<Range<usize>>,
    /// Which torque it is.
    pub torque_kind: Torque,
}

impl Run {
    /// The median time between rows, s.
    pub fn interval(&self) -> f64 {
        let mut intervals: Vec<f64> = self
            .time
            .windows(2)
            .map(|pair| pair[1] - pair[0])
            .filter(|interval| *interval > 0.0)
            .collect();
        median(&mut intervals)
    }

    /// The time within stretches, s.
    pub fn usable_time(&self) -> f64 {
        let stretches = self.stretches.iter();
        stretches.map(|stretch| self.length(stretch)).sum()
    }

    /// The length of rows, s.
    pub fn length(&self, rows: &Range<usize>) -> f64 {
        self.time[rows.end - 1] - self.time[rows.start]
    }

    /// The torque as a function of time, to be read forward from `time`.
    pub(crate) fn torque_from(&self, time: f64) -> TorqueReader<'_> {
        let row = self.time.partition_point(|stamp| *stamp <= time);
        TorqueReader {
            run: self,
            row: row.saturating_sub(1),
            time,
        }
    }
}

/// Reads a held torque forward in time.
pub(crate) struct TorqueReader<'a> {
    run: &'a Run,
    row: usize,
    time: f64,
}

impl TorqueReader<'_> {
    /// The mean torque over the next `duration` seconds.
    pub(crate) fn mean_over(&mut self, duration: f64) -> f64 {
        let Run { time, torque, .. } = self.run;
        let end = self.time + duration;
        let mut impulse = 0.0;
        let mut from = self.time;
        while self.row + 1 < time.len() && time[self.row + 1] < end {
            let until = time[self.row + 1];
            impulse += torque[self.row] * (until - from).max(0.0);
            from = until.max(from);
            self.row += 1;
        }
        impulse += torque[self.row] * (end - from);
        self.time = end;
        impulse / duration
    }
}

/// The middle value; 0 of none. Reorders the values.
pub(crate) fn median(values: &mut [f64]) -> f64 {
    quantile(values, 0.5)
}

/// The value that this part of the values is below; 0 of none. Reorders the values.
pub(crate) fn quantile(values: &mut [f64], part: f64) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let place = ((values.len() - 1) as f64 * part).round() as usize;
    *values.select_nth_unstable_by(place, f64::total_cmp).1
}
