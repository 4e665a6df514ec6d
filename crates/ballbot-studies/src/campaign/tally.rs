//! Closed loops together.

use super::run::Record;
use serde::Serialize;

/// The runs of a variant together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Tally {
    /// Closed loops.
    pub runs: usize,
    /// Those in which every sample had a plan that keeps all bounds.
    pub runs_feasible: usize,
    /// Those in which every state kept its bounds, too.
    pub runs_within_bounds: usize,
    /// Those in which the robot fell.
    pub runs_fallen: usize,
    /// Sums and largest values over the runs; `fell` if any did.
    pub total: Record,
}

impl Tally {
    /// How often something happened that is guaranteed not to.
    pub fn broken_promises(&self) -> usize {
        let Record {
            infeasible,
            violations,
            violations_between,
            cost_growths,
            ..
        } = self.total;
        infeasible + violations + violations_between + cost_growths + self.runs_fallen
    }

    /// Counts the runs.
    pub fn of(records: &[Record]) -> Self {
        let mut tally = Self::default();
        for record in records {
            tally.add(record);
        }
        tally
    }

    fn add(&mut self, record: &Record) {
        self.runs += 1;
        self.runs_feasible += usize::from(record.infeasible == 0);
        let outside = record.violations + record.violations_between;
        let kept = record.infeasible == 0 && outside == 0;
        self.runs_within_bounds += usize::from(kept);
        self.runs_fallen += usize::from(record.fell);
        let total = &mut self.total;
        total.samples += record.samples;
        total.infeasible += record.infeasible;
        total.violations += record.violations;
        total.violations_between += record.violations_between;
        total.cost_growths += record.cost_growths;
        for (total, count) in total.decisions.iter_mut().zip(record.decisions) {
            *total += count;
        }
        total.largest_tilt_rad = total.largest_tilt_rad.max(record.largest_tilt_rad);
        total.largest_growth = total.largest_growth.max(record.largest_growth);
        total.largest_gap = total.largest_gap.max(record.largest_gap);
        total.cost += record.cost;
        total.fell |= record.fell;
    }
}
