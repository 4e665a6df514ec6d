//! Which rows are fitted, and which are held back.

use crate::log::Run;
use crate::model::Segment;
use std::ops::Range;

/// Rows without a gap between them, and which run they are of.
pub type Stretch = (usize, Range<usize>);

/// Rows for the fit and rows held back to judge it.
#[derive(Clone, Debug, PartialEq)]
pub struct Split {
    /// Stretches for the fit, with their run.
    pub fitted: Vec<Stretch>,
    /// Stretches held back: the ends of the runs.
    pub held_back: Vec<Stretch>,
}

impl Split {
    /// Holds back the last `part` (0 to less than 1) of the usable time of each run.
    pub fn new(runs: &[Run], part: f64) -> Self {
        let mut split = Self {
            fitted: Vec::new(),
            held_back: Vec::new(),
        };
        for (index, run) in runs.iter().enumerate() {
            let mut left = (1.0 - part) * run.usable_time();
            for stretch in &run.stretches {
                let begin = run.time[stretch.start];
                let fitted = |row: &f64| row - begin <= left;
                let cut = if part == 0.0 {
                    stretch.end
                } else {
                    stretch.start + run.time[stretch.clone()].partition_point(fitted)
                };
                if cut > stretch.start {
                    split.fitted.push((index, stretch.start..cut));
                }
                if cut < stretch.end {
                    split.held_back.push((index, cut..stretch.end));
                }
                left -= run.length(stretch);
            }
        }
        split
    }
}

/// Cuts stretches into segments of `length` seconds. The first `lead` seconds of each stretch are
/// left out, because the torque before them, which a delay brings in, is not known. A rest of at
/// least half a length is a segment, too.
pub fn segments(runs: &[Run], stretches: &[Stretch], length: f64, lead: f64) -> Vec<Segment> {
    let mut segments = Vec::new();
    for (run, stretch) in stretches {
        let time = &runs[*run].time;
        let after = |from: usize, duration: f64| {
            let until = time[from] + duration;
            from + time[from..stretch.end].partition_point(|stamp| *stamp < until - 1e-9)
        };
        let mut first = if lead > 0.0 {
            after(stretch.start, lead)
        } else {
            stretch.start
        };
        while first + 1 < stretch.end {
            let end = (after(first, length) + 1).min(stretch.end);
            if time[end - 1] - time[first] < 0.5 * length {
                break;
            }
            segments.push(Segment {
                run: *run,
                first,
                end,
            });
            // A row belongs to one segment: its noise must not count twice.
            first = end;
        }
    }
    segments
}

/// At most `count` of the segments, evenly spread.
pub fn spread(segments: &[Segment], count: usize) -> Vec<Segment> {
    if segments.len() <= count {
        return segments.to_vec();
    }
    let places = (0..count).map(|i| i * segments.len() / count);
    places.map(|place| segments[place]).collect()
}
