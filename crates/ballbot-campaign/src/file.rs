//! What stands in a campaign's file, with no more checks than its form.

use crate::measure::Measure;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use toml::{Table, Value};

/// A campaign, as written in a TOML file: a scenario, what varies, how often, what is measured, and
/// what counts as a success.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CampaignFile {
    /// One line for figures and lists.
    pub title: String,
    /// A built-in scenario by its name, or a file, relative to this one.
    pub scenario: String,
    /// How many runs, over all points of a grid together; one per point of the grid when absent.
    pub runs: Option<u64>,
    /// Seed of everything random.
    #[serde(default)]
    pub seed: u64,
    /// How the points are laid out.
    #[serde(default)]
    pub design: Design,
    /// Whether all runs have the noise of the scenario's own `world.seed`; each has its own otherwise.
    #[serde(default)]
    pub same_noise: bool,
    /// What becomes of a run whose drawn values make no scenario.
    #[serde(default)]
    pub refused: OnRefused,
    /// Keys of the scenario and their values, the same for all runs.
    #[serde(default)]
    pub set: Table,
    /// What varies.
    #[serde(default)]
    pub vary: Vec<VaryTable>,
    /// What is measured; all but times when absent.
    pub measure: Option<Vec<Measure>>,
    /// Bounds of measures that a run must keep to be a success; that it comes to its end is asked
    /// anyway.
    #[serde(default)]
    pub success: BTreeMap<Measure, LimitsTable>,
    /// When there are runs enough.
    pub stop: Option<StopTable>,
    /// A rare failure, to be estimated by subset simulation in place of runs.
    pub rare: Option<RareTable>,
}

/// How the points of the inputs are laid out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Design {
    /// Independent draws.
    #[default]
    Random,
    /// A Sobol sequence, randomised by a digital shift.
    Sobol,
    /// Each input has one value in each of as many equally likely intervals as there are runs.
    LatinHypercube,
}

/// What becomes of a run whose drawn values make no scenario.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OnRefused {
    /// The campaign ends with a message.
    #[default]
    Stop,
    /// It is counted apart: neither a success nor a failure.
    Count,
}

/// An input: a key of the scenario, or several that get the same value, and one distribution.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VaryTable {
    /// The key or keys, with dots between tables and places in lists.
    pub key: Keys,
    /// Evenly between the two.
    pub uniform: Option<[f64; 2]>,
    /// Evenly in the logarithm between the two.
    pub log_uniform: Option<[f64; 2]>,
    /// Normal, cut off outside bounds where there are some.
    pub normal: Option<NormalTable>,
    /// Whole numbers from the first to the second, all as likely.
    pub integers: Option<[i64; 2]>,
    /// Any of these values, all as likely.
    pub list: Option<Vec<Value>>,
    /// Each of these values with every value of the other grids.
    pub grid: Option<Vec<Value>>,
    /// A grid of so many numbers from one to another.
    pub range: Option<RangeTable>,
    /// `true`: a seed of its own for each run, such as for `world.draw`, which draws robots from the
    /// covariance of an identification.
    pub seeds: Option<bool>,
    /// What is drawn is rounded to a multiple of this.
    pub round_to: Option<f64>,
}

/// One key or several.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Keys {
    /// One.
    One(String),
    /// Several that get the same value; the first one names the column.
    Several(Vec<String>),
}

/// A normal distribution.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NormalTable {
    /// Its mean, before it is cut off.
    pub mean: f64,
    /// Its standard deviation, before it is cut off.
    pub deviation: f64,
    /// No value below.
    pub lower: Option<f64>,
    /// No value above.
    pub upper: Option<f64>,
}

/// Numbers at equal distances.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RangeTable {
    /// The first.
    pub from: f64,
    /// The last.
    pub to: f64,
    /// How many, two or more.
    pub points: u32,
}

/// Bounds of a measure.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LimitsTable {
    /// It must not be below.
    pub at_least: Option<f64>,
    /// It must not be above.
    pub at_most: Option<f64>,
}

/// When there are runs enough.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StopTable {
    /// When the share of failures is known to so much to either side.
    pub failure_share_within: f64,
    /// With this confidence.
    #[serde(default = "confidence")]
    pub confidence: f64,
}

/// Confidence of intervals, where nothing else is said.
pub fn confidence() -> f64 {
    0.95
}

/// A rare failure: a measure that exceeds a value.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RareTable {
    /// The measure; the larger, the closer to the failure.
    pub measure: Measure,
    /// The failure: the measure is above, or the run does not come to its end.
    pub above: f64,
    /// Runs per level.
    #[serde(default = "level_runs")]
    pub level_runs: u32,
    /// The estimate is not followed below this probability.
    #[serde(default = "least_probability")]
    pub least: f64,
}

fn level_runs() -> u32 {
    1000
}

fn least_probability() -> f64 {
    1e-9
}
