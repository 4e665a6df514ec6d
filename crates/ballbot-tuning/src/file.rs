//! What stands in a tuning's file, with no more checks than its form.

use ballbot_campaign::{Design, Keys, LimitsTable, Measure, VaryTable, confidence};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use toml::{Table, Value};

/// A tuning, as written in a TOML file: a scenario, what is searched over, for what, within which
/// limits, and the worlds in which each candidate is tried.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TuningFile {
    /// One line for figures and lists.
    pub title: String,
    /// A built-in scenario by its name, or a file, relative to this one: where the search begins.
    pub scenario: String,
    /// Seed of the search.
    #[serde(default)]
    pub seed: u64,
    /// Keys of the scenario, with the values that they may have.
    pub parameters: BTreeMap<String, ParameterTable>,
    /// What is to become small; several make a Pareto front.
    pub goal: Vec<GoalTable>,
    /// What must be kept.
    #[serde(default)]
    pub limit: Vec<LimitTable>,
    /// The worlds of every candidate: the same for all.
    #[serde(default)]
    pub worlds: WorldsTable,
    /// Worlds that the search does not see.
    #[serde(default)]
    pub held_out: HeldOutTable,
    /// How long is searched, and how.
    #[serde(default)]
    pub search: SearchTable,
}

/// The values that a key may have: exactly one of `uniform`, `log_uniform`, `integers` and `list`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ParameterTable {
    /// Numbers between the two.
    pub uniform: Option<[f64; 2]>,
    /// Positive numbers between the two; equal steps of the search are equal ratios.
    pub log_uniform: Option<[f64; 2]>,
    /// Whole numbers from the first to the second.
    pub integers: Option<[i64; 2]>,
    /// Any of these values; neighbours are tried after each other, so put them in an order.
    pub list: Option<Vec<Value>>,
    /// Multiples of this only.
    pub round_to: Option<f64>,
    /// Where the search begins; the scenario's own value when absent.
    pub start: Option<Value>,
    /// More keys that get the same value.
    #[serde(default)]
    pub also: Vec<String>,
}

impl ParameterTable {
    /// As a campaign would draw it.
    pub(crate) fn vary(&self, key: &str) -> VaryTable {
        let keys = std::iter::once(key.to_owned()).chain(self.also.iter().cloned());
        VaryTable {
            key: Keys::Several(keys.collect()),
            uniform: self.uniform,
            log_uniform: self.log_uniform,
            normal: None,
            integers: self.integers,
            list: self.list.clone(),
            grid: None,
            range: None,
            seeds: None,
            round_to: self.round_to,
        }
    }
}

/// What is to become small: a statistic of a measure over the worlds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GoalTable {
    /// The measure; none for the share of failures.
    pub measure: Option<Measure>,
    /// Of all worlds.
    pub statistic: Statistic,
    /// A target: below it nothing more is gained. As small as can be when absent.
    pub at_most: Option<f64>,
}

/// What must be kept: a statistic of a measure over the worlds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LimitTable {
    /// The measure; none for the share of failures.
    pub measure: Option<Measure>,
    /// Of all worlds.
    pub statistic: Statistic,
    /// It must not be above.
    pub at_most: f64,
}

/// One number of many runs. A run that does not come to its end has an infinite measure.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Statistic {
    /// The mean.
    Mean,
    /// The median.
    Median,
    /// The largest.
    Worst,
    /// Not exceeded by this share of the runs.
    Quantile(f64),
    /// The share of runs that do not come to their end, or do not keep `[worlds.success]`.
    FailureShare,
}

/// The worlds of a candidate, as a campaign has them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WorldsTable {
    /// How many; one per point of the grids when absent, and one where nothing varies.
    pub runs: Option<u64>,
    /// Seed of everything random in them.
    #[serde(default)]
    pub seed: u64,
    /// How their points are laid out.
    #[serde(default)]
    pub design: Design,
    /// Whether all have the noise of the scenario's own `world.seed`.
    #[serde(default)]
    pub same_noise: bool,
    /// Keys of the scenario that are the same in all of them.
    #[serde(default)]
    pub set: Table,
    /// What varies.
    #[serde(default)]
    pub vary: Vec<VaryTable>,
    /// What a run must keep to be no failure, beside coming to its end.
    #[serde(default)]
    pub success: BTreeMap<Measure, LimitsTable>,
}

/// Worlds for the comparison of the result with the start.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HeldOutTable {
    /// How many; as many as the search has when absent.
    pub runs: Option<u64>,
    /// Seed of everything random in them; another one than that of the worlds.
    pub seed: Option<u64>,
    /// Confidence of the intervals.
    #[serde(default = "confidence")]
    pub confidence: f64,
}

impl Default for HeldOutTable {
    fn default() -> Self {
        Self {
            runs: None,
            seed: None,
            confidence: confidence(),
        }
    }
}

/// How long is searched, and how.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SearchTable {
    /// Candidates, at most, the start included.
    pub evaluations: u64,
    /// Candidates of a generation; 4 + 3 ln(parameters) when absent, as is usual.
    pub population: Option<usize>,
    /// Standard deviation of the first generation, as a share of each range.
    pub step: f64,
    /// A search ends after so many generations without an improvement.
    pub patience: u32,
}

impl Default for SearchTable {
    fn default() -> Self {
        Self {
            evaluations: 200,
            population: None,
            step: 0.2,
            patience: 10,
        }
    }
}
