//! Runs until the share of failures is known well enough.

use crate::campaign::{Campaign, Clock, SUCCESS};
use crate::cell::{Cell, Row};
use crate::error::CampaignError;
use crate::file::StopTable;
use crate::intervals;
use ballbot_scenario::Files;

/// Runs before the first look.
const FIRST_LOOK: u64 = 200;
/// From one look to the next the runs grow by this: each look is a chance to stop too early, and more
/// than a few more runs than needed cost more.
const GROWTH: f64 = 1.25;

/// The numbers of runs at which it is looked, in multiples of `multiple`; the last one is `most`.
fn looks(most: u64, multiple: u64) -> impl Iterator<Item = u64> {
    let sizes = std::iter::successors(Some(FIRST_LOOK), |runs| {
        Some((*runs as f64 * GROWTH).ceil() as u64)
    });
    let sizes = sizes.map(move |runs| runs.next_multiple_of(multiple));
    sizes.take_while(move |runs| *runs < most).chain([most])
}

/// Whether the share is known well enough.
fn is_known(stop: &StopTable, failures: u64, runs: u64) -> bool {
    intervals::share(failures, runs, stop.confidence).reach() <= stop.failure_share_within
}

impl StopTable {
    /// Whether the numbers make sense.
    pub(crate) fn check(&self) -> Result<(), CampaignError> {
        let refused = |key: &str, value: f64, expected: &str| {
            Err(CampaignError::value(key, format!("{value:?}"), expected))
        };
        if !(self.failure_share_within > 0.0 && self.failure_share_within < 0.5) {
            let expected = "it must be above 0 and below 0.5: 0.005 is half a percent to each side";
            return refused(
                "stop.failure_share_within",
                self.failure_share_within,
                expected,
            );
        }
        if !(self.confidence >= 0.5 && self.confidence <= 0.9999) {
            let expected = "it must be from 0.5 to 0.9999, such as 0.95";
            return refused("stop.confidence", self.confidence, expected);
        }
        Ok(())
    }
}

impl<F: Files + Copy + Sync> Campaign<'_, F> {
    /// Hands over the rows of all runs in their order, or of as many as `[stop]` asks for. Says how
    /// many these are, and whether the share of failures is then known as well as asked.
    ///
    /// # Errors
    /// As [`for_each`](Self::for_each).
    pub fn run_all<E: From<CampaignError> + Send>(
        &self,
        clock: Clock<'_>,
        progress: &(dyn Fn() + Sync),
        mut each: impl FnMut(Row) -> Result<(), E>,
    ) -> Result<(u64, bool), E> {
        let Some(stop) = self.source().file().stop else {
            self.for_each((0, self.runs()), clock, progress, each)?;
            return Ok((self.runs(), true));
        };
        let success = self
            .columns()
            .iter()
            .position(|column| column.name == SUCCESS);
        let (mut done, mut failures, mut ran) = (0, 0, 0);
        for look in looks(self.runs(), self.inputs().grid_points) {
            self.for_each((done, look), clock, progress, |row: Row| {
                let succeeded = success.and_then(|index| row.get(index));
                failures += u64::from(succeeded == Some(&Cell::Flag(false)));
                ran += u64::from(succeeded != Some(&Cell::Missing));
                each(row)
            })?;
            done = look;
            if is_known(&stop, failures, ran) {
                return Ok((done, true));
            }
        }
        Ok((done, false))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The probability that the interval at the stop holds the true share, computed exactly: the
    /// distribution of the failures is carried from look to look, and what stops is taken out.
    fn coverage(stop: &StopTable, share: f64, most: u64) -> f64 {
        let mut going = vec![1.0];
        let (mut done, mut covered) = (0, 0.0);
        for look in looks(most, 1) {
            for _ in done..look {
                let mut next = vec![0.0; going.len() + 1];
                for (failures, mass) in going.iter().enumerate() {
                    next[failures] += mass * (1.0 - share);
                    next[failures + 1] += mass * share;
                }
                going = next;
            }
            done = look;
            for (failures, mass) in going.iter_mut().enumerate() {
                if is_known(stop, failures as u64, look) || look == most {
                    let interval = intervals::share(failures as u64, look, stop.confidence);
                    if interval.lower <= share && share <= interval.upper {
                        covered += *mass;
                    }
                    *mass = 0.0;
                }
            }
        }
        covered
    }

    #[test]
    fn the_interval_at_the_stop_holds_the_share_as_often_as_claimed() {
        let stop = StopTable {
            failure_share_within: 0.03,
            confidence: 0.95,
        };
        let shares = [0.01, 0.03, 0.05, 0.1, 0.2, 0.3, 0.5];
        let found = shares.map(|share| coverage(&stop, share, 2000));
        let mean = found.iter().sum::<f64>() / found.len() as f64;
        assert!(found.iter().all(|share| *share > 0.93), "{found:?}");
        assert!(mean > 0.945, "{found:?}");
    }

    #[test]
    fn looks_end_with_all_runs_and_keep_to_the_grid() {
        assert_eq!(looks(100, 1).collect::<Vec<_>>(), [100]);
        let found: Vec<u64> = looks(1000, 30).collect();
        assert!(found.windows(2).all(|pair| pair[0] < pair[1]), "{found:?}");
        assert_eq!(found.last(), Some(&1000));
        assert!(
            found[..found.len() - 1]
                .iter()
                .all(|runs| runs.is_multiple_of(30))
        );
    }
}
