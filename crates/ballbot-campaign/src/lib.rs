//! Campaigns as files: a scenario, what varies of it, how often, what is measured, and what counts as
//! a success; in one piece or in shards, with statistics of the results.
#![allow(
    clippy::neg_cmp_op_on_partial_ord,
    reason = "a comparison with NaN must take the failing branch"
)]

mod campaign;
mod cell;
mod distribution;
mod error;
mod file;
mod fingerprint;
mod inputs;
mod intervals;
mod measure;
mod permutation;
mod rare;
mod results;
mod sensitivity;
mod shard;
mod stopping;
mod subset;
mod summary;

pub use campaign::{Campaign, Clock, Drawn, Replay, Source};
pub use cell::{Cell, Column, Kind, Row};
pub use error::CampaignError;
pub use file::{CampaignFile, Design, LimitsTable, RareTable, StopTable};
pub use intervals::{Interval, share};
pub use measure::{Ending, Measure};
pub use results::{RowFile, RowWriter};
pub use sensitivity::{Sensitivity, sensitivity};
pub use shard::{MOST_SHARDS, Shard, Shards, shard_files};
pub use subset::{Level, Point, RareEstimate, Subset};
pub use summary::{MOST_LOOKED_AT, MeasureSummary, Summary};
