//! Rare failures of a campaign.

use crate::campaign::{Campaign, Clock, Drawn};
use crate::cell::Cell;
use crate::distribution::standard;
use crate::error::CampaignError;
use crate::file::{RareTable, confidence};
use crate::inputs::named_seed;
use crate::measure::Ending;
use crate::subset::{Point, RareEstimate, Subset};
use ballbot_scenario::Files;
use statrs::distribution::ContinuousCDF;

/// A level's runs, at most.
const MOST_LEVEL_RUNS: u32 = 1_000_000;

impl RareTable {
    /// Whether the numbers make sense.
    pub(crate) fn check(&self) -> Result<(), CampaignError> {
        let refused = |key: &str, value: String, expected: &str| {
            Err(CampaignError::value(format!("rare.{key}"), value, expected))
        };
        if !self.above.is_finite() {
            return refused(
                "above",
                format!("{:?}", self.above),
                "it must be a finite number",
            );
        }
        if self.measure.is_time() {
            let expected = "a time differs from run to run, so no run could be repeated by it";
            return refused("measure", self.measure.to_string(), expected);
        }
        if !(100..=MOST_LEVEL_RUNS).contains(&self.level_runs) {
            let expected = format!("it must be from 100 to {MOST_LEVEL_RUNS}");
            return refused("level_runs", self.level_runs.to_string(), &expected);
        }
        if !(self.least >= 1e-12 && self.least <= 0.1) {
            let expected = "it must be from 1e-12 to 0.1";
            return refused("least", format!("{:?}", self.least), expected);
        }
        Ok(())
    }
}

impl<F: Files + Copy + Sync> Campaign<'_, F> {
    /// Estimates the probability of the rare failure `rare` of the campaign's file.
    ///
    /// # Errors
    /// A drawn scenario is none, or the measure does not tell runs apart.
    pub fn rare(
        &self,
        rare: &RareTable,
        clock: Clock<'_>,
        progress: &(dyn Fn() + Sync),
    ) -> Result<RareEstimate, CampaignError> {
        let subset = Subset {
            dimension: self.inputs().all.len(),
            level_runs: rare.level_runs as usize,
            least: rare.least,
            seed: named_seed(self.source().file().seed, "rare"),
            confidence: confidence(),
        };
        let limit = |point: &Point| -> Result<f64, CampaignError> {
            let measured = self.measured(&self.drawn_at(point), clock)?;
            progress();
            let Some(measured) = measured else {
                return Ok(f64::NEG_INFINITY);
            };
            let number = measured.cell(rare.measure).number();
            Ok(match (measured.ending, number) {
                (Ending::Complete, Some(number)) => number - rare.above,
                // The worst there is.
                _ => f64::INFINITY,
            })
        };
        subset.estimate(&limit)?.ok_or_else(|| {
            let expected = "it is the same in all runs of a level, so it does not lead to the failure; \
                            choose a measure that grows on the way to it";
            CampaignError::value("rare.measure", rare.measure.name(), expected)
        })
    }

    /// What is drawn at a point.
    pub fn drawn_at(&self, point: &Point) -> Drawn {
        let units: Vec<f64> = point.normal.iter().map(|z| standard().cdf(*z)).collect();
        Drawn {
            run: 0,
            seed: self.noise_at(point.noise),
            values: self.inputs().values_at(&units, point.noise),
        }
    }

    /// The drawn values as cells, with the noise's seed before them.
    pub fn drawn_cells(&self, drawn: &Drawn) -> Vec<Cell> {
        let seed = drawn
            .seed
            .map_or(Cell::Missing, |seed| Cell::Whole(seed as i64));
        [seed]
            .into_iter()
            .chain(self.inputs().cells(&drawn.values))
            .collect()
    }
}
