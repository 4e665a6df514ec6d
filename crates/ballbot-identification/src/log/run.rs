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
    /// Rows between which nothing is missing, in their order: no gap, no jump, every torque known.
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

    /// The torque as a function of time in the stretch of a row, to be read forward from `delay`
    /// seconds before that row.
    pub(crate) fn torque_before(&self, row: usize, delay: f64) -> TorqueReader<'_> {
        // The rows of another stretch are at other times, or of a clock that was set anew, or have no
        // torque. What a delay brings in from before the stretch is the first torque that is known.
        let place = self.stretches.partition_point(|rows| rows.end <= row);
        let stretch = self.stretches.get(place).filter(|rows| rows.contains(&row));
        let rows = stretch.map_or(0..self.time.len(), Clone::clone);
        let start = self.time[row] - delay;
        let time = &self.time[rows.clone()];
        let after = time.partition_point(|stamp| *stamp <= start);
        TorqueReader {
            time,
            torque: &self.torque[rows],
            row: after.saturating_sub(1),
            start,
        }
    }
}

/// Reads a held torque forward in time.
pub(crate) struct TorqueReader<'a> {
    time: &'a [f64],
    torque: &'a [f64],
    row: usize,
    start: f64,
}

impl TorqueReader<'_> {
    /// The mean torque over the next `duration` seconds.
    pub(crate) fn mean_over(&mut self, duration: f64) -> f64 {
        let Self { time, torque, .. } = *self;
        let end = self.start + duration;
        let mut impulse = 0.0;
        let mut from = self.start;
        while self.row + 1 < time.len() && time[self.row + 1] < end {
            let until = time[self.row + 1];
            impulse += torque[self.row] * (until - from).max(0.0);
            from = until.max(from);
            self.row += 1;
        }
        impulse += torque[self.row] * (end - from);
        self.start = end;
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
