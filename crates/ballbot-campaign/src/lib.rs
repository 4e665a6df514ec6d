//! Campaigns as files: a scenario, what varies of it, how often, what is measured, and what counts as
//! a success; in one piece or in shards, with statistics of the results. `docs/campaigns.md` has every
//! key of the file. (What is guaranteed is counted by `ballbot_studies::Campaign`.)
//!
//! | for | use |
//! |---|---|
//! | a campaign, read and checked | [`Source`], [`Campaign`] |
//! | one run, or all of it again | [`Campaign::run`], [`Campaign::replay`] |
//! | all runs, or as many as are needed | [`Campaign::run_all`] |
//! | a part, and all parts together | [`Campaign::write_shard`], [`Campaign::shards`] |
//! | what the rows say | [`RowFile`], [`Summary`] |
//! | the same runs with other values, along an interval | [`Campaign::with`], [`Axis`] |
//! | the probability of a rare failure | [`Campaign::rare`], [`Subset`] |
//!
//! ```no_run
//! use ballbot_campaign::{Campaign, Source};
//! use std::{path::Path, time::Duration};
//!
//! # fn main() -> Result<(), ballbot_campaign::CampaignError> {
//! let source = Source::load(Path::new("my-campaign.toml"))?;
//! let campaign = Campaign::new(&source, source.folder(), "my program 1.0")?;
//! let row = campaign.run(17, &|| Duration::ZERO)?;
//! for (column, cell) in campaign.columns().iter().zip(&row) {
//!     println!("{} = {}", column.name, cell.text());
//! }
//! # Ok(())
//! # }
//! ```
#![allow(
    clippy::neg_cmp_op_on_partial_ord,
    reason = "a comparison with NaN must take the failing branch"
)]

mod axis;
mod campaign;
mod cell;
mod checks;
mod distribution;
mod error;
mod file;
mod fingerprint;
mod fixed;
mod inputs;
mod intervals;
mod measure;
mod permutation;
mod rare;
mod results;
mod sensitivity;
mod shard;
mod source;
mod stopping;
mod subset;
mod summary;

pub use axis::Axis;
pub use campaign::{Campaign, Clock, Drawn, Replay};
pub use cell::{Cell, Column, Kind, Row};
pub use error::CampaignError;
pub use file::{
    CampaignFile, Design, Keys, LimitsTable, OnRefused, RareTable, StopTable, VaryTable, confidence,
};
pub use inputs::{MOST_RUNS, is_within, named_seed};
pub use intervals::{Interval, share};
pub use measure::{Ending, Measure};
pub use results::{RowFile, RowWriter};
pub use sensitivity::{Sensitivity, sensitivity};
pub use shard::{MOST_SHARDS, Shard, Shards, shard_files};
pub use source::Source;
pub use subset::{Level, Point, RareEstimate, Subset};
pub use summary::{MOST_LOOKED_AT, MeasureSummary, Summary};
