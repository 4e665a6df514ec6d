//! Tuning as files: which keys of a scenario are searched over, for which goals, within which limits,
//! and in which worlds each candidate is tried. `docs/tuning.md` has every key of the file.
//!
//! | for | use |
//! |---|---|
//! | a tuning, read and checked | [`TuningSource`], [`Tuning`] |
//! | closed loops, run here or by other processes | [`Batch`], [`Tuning::run`], [`Tuning::run_part`] |
//! | its search, which goes on where a journal ends | [`Tuning::search`], [`Journal`] |
//! | before and after, in worlds that it has not seen | [`Tuning::held_out`], [`Tuning::compare`] |
//! | the scenario with what was found | [`Tuning::document`], [`with_files`] |
//! | the search alone, of any problem | [`search()`], [`Problem`] |
#![allow(
    clippy::neg_cmp_op_on_partial_ord,
    reason = "a comparison with NaN must take the failing branch"
)]

mod batch;
mod candidates;
mod comparable;
mod compare;
mod document;
mod error;
mod file;
mod journal;
mod judge;
mod pareto;
mod part;
mod search;
mod source;
mod statistic;
mod tuning;
mod values;

pub use batch::{Batch, Run, Tried, Worlds};
pub use compare::Comparison;
pub use document::with_files;
pub use error::TuningError;
pub use file::{
    GoalTable, HeldOutTable, LimitTable, ParameterTable, SearchTable, Statistic, TuningFile,
    WorldsTable,
};
pub use journal::{Entry, Journal, State};
pub use judge::{Judge, Judged, Outcome, Quantity, Ran};
pub use pareto::{dominates, front};
pub use part::digest;
pub use search::{Plan, Problem, SearchEnd, Searched, search, value, weightings};
pub use source::TuningSource;
pub use tuning::{Found, Hooks, Tuning};
