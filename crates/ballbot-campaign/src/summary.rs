//! What a file of results says.

use crate::campaign::{Campaign, OUTCOME, REFUSED, SUCCESS};
use crate::cell::Cell;
use crate::distribution::Distribution;
use crate::error::CampaignError;
use crate::file::confidence;
use crate::inputs::Input;
use crate::intervals::{self, Interval};
use crate::measure::Ending;
use crate::results::RowFile;
use crate::sensitivity::{Sensitivity, sensitivity};
use ballbot_scenario::Files;
use serde::Serialize;

/// What the runs of a campaign say together.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// The campaign's.
    pub title: String,
    /// All runs.
    pub runs: u64,
    /// Those that came to their end.
    pub complete: u64,
    /// Those in which the robot fell.
    pub fell: u64,
    /// Those that ended without a plan.
    pub no_plan: u64,
    /// Those whose drawn values make no scenario; the shares leave them out.
    pub refused: u64,
    /// Runs that could be run and are no success.
    pub failures: u64,
    /// Their share, with its interval.
    pub failure_share: Interval,
    /// Confidence of all intervals.
    pub confidence: f64,
    /// The measures over the runs that came to their end.
    pub measures: Vec<MeasureSummary>,
    /// What each input says of the failures.
    pub sensitivities: Vec<Sensitivity>,
}

/// A measure over many runs; what never comes in a run is infinite, `null` in JSON.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MeasureSummary {
    /// Its name.
    pub measure: &'static str,
    /// Its median, with its interval.
    pub median: Interval,
    /// Not exceeded by 5 % of the runs.
    pub quantile_5: f64,
    /// Not exceeded by 95 % of the runs.
    pub quantile_95: f64,
    /// The largest.
    pub largest: f64,
}

/// Runs that sensitivities and figures look at: the first ones, where there are more.
pub const MOST_LOOKED_AT: usize = 1_000_000;

impl Summary {
    /// What the results of a campaign say. In memory is a column at a time.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn of<F: Files + Copy + Sync>(
        campaign: &Campaign<'_, F>,
        results: &RowFile,
    ) -> Result<Self, CampaignError> {
        let file = campaign.source().file();
        let confidence = file.stop.map_or(confidence(), |stop| stop.confidence);
        // As small as can be: one byte for each run.
        let mut complete = Vec::with_capacity(results.rows() as usize);
        let (mut fell, mut no_plan, mut refused) = (0, 0, 0);
        results.for_each_cell(OUTCOME, |cell| {
            let Cell::Text(outcome) = cell else { return };
            complete.push(outcome == Ending::Complete.name());
            fell += u64::from(outcome == Ending::Fell.name());
            no_plan += u64::from(outcome == Ending::NoPlan.name());
            refused += u64::from(outcome == REFUSED);
        })?;
        let mut failures = 0;
        results.for_each_cell(SUCCESS, |cell| {
            failures += u64::from(cell == Cell::Flag(false))
        })?;
        let runs = results.rows();
        let mut measures = Vec::new();
        for measure in campaign.measures() {
            let (mut values, mut empty) = (Vec::new(), 0);
            let mut complete = complete.iter();
            results.for_each_cell(measure.name(), |cell| {
                if complete.next() == Some(&true) {
                    let number = cell.number();
                    empty += usize::from(number.is_none());
                    values.extend(number);
                }
            })?;
            // Where none has a value, it has no meaning for the scenario. Otherwise a run that is left out
            // for its bad end would make the others' numbers better than those of all.
            if measure.may_never_come() && !values.is_empty() {
                values.extend(std::iter::repeat_n(f64::INFINITY, empty));
            }
            values.sort_unstable_by(f64::total_cmp);
            measures.extend(MeasureSummary::new(measure.name(), &values, confidence));
        }
        Ok(Self {
            title: file.title.clone(),
            runs,
            complete: complete.iter().filter(|complete| **complete).count() as u64,
            fell,
            no_plan,
            refused,
            failures,
            failure_share: intervals::share(failures, runs - refused, confidence),
            confidence,
            measures,
            sensitivities: sensitivities(campaign, results)?,
        })
    }
}

impl MeasureSummary {
    fn new(measure: &'static str, sorted: &[f64], confidence: f64) -> Option<Self> {
        let quantile = |share: f64| {
            let place = (share * sorted.len() as f64).ceil() as usize;
            sorted.get(place.saturating_sub(1)).copied()
        };
        Some(Self {
            measure,
            median: intervals::median(sorted, confidence)?,
            quantile_5: quantile(0.05)?,
            quantile_95: quantile(0.95)?,
            largest: *sorted.last()?,
        })
    }
}

/// What each input says of the failures, the most important one first.
fn sensitivities<F: Files + Copy + Sync>(
    campaign: &Campaign<'_, F>,
    results: &RowFile,
) -> Result<Vec<Sensitivity>, CampaignError> {
    let success = results.first_cells(SUCCESS, MOST_LOOKED_AT)?;
    let failed: Vec<f64> = success
        .iter()
        .filter_map(Cell::number)
        .map(|s| 1.0 - s)
        .collect();
    let mut found = Vec::new();
    let inputs = campaign.inputs().all.iter().zip(campaign.input_columns());
    for (Input { distribution, .. }, column) in inputs {
        // A seed explains nothing that another one would not.
        if *distribution != Distribution::Seeds {
            let values = results.first_cells(&column.name, MOST_LOOKED_AT)?;
            let ran = values.into_iter().zip(&success);
            let ran = ran.filter(|(_, success)| **success != Cell::Missing);
            let values: Vec<Cell> = ran.map(|(value, _)| value).collect();
            found.extend(sensitivity(&column.name, &values, &failed));
        }
    }
    found.sort_by(|a, b| b.first_order.total_cmp(&a.first_order));
    Ok(found)
}
