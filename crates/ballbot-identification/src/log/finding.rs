//! What is odd about a log and yet no reason to refuse it.

use crate::words::number;
use thiserror::Error;

/// Something the builder should know; its sentence is its `Display`. Lines are counted from 1,
/// times are since the first row.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum Finding {
    /// The text begins with a byte order mark.
    #[error("the file begins with a byte order mark; it is skipped")]
    ByteOrderMark,
    /// The last line is cut off.
    #[error("line {line}, the last, is cut off; it is left out")]
    IncompleteLastRow {
        /// Line.
        line: usize,
    },
    /// Empty fields, NaN or infinity.
    #[error(
        "`{column}` is missing or not finite in {count} rows, first in line {line}; they are not filled in"
    )]
    MissingValues {
        /// The column.
        column: String,
        /// How many rows.
        count: usize,
        /// Line of the first.
        line: usize,
    },
    /// Rows that the builder wants left out.
    #[error("{count} rows are left out, as from_s, until_s or leave_out say")]
    LeftOut {
        /// How many rows.
        count: usize,
    },
    /// A part that is to be left out, and is none of the log.
    #[error(
        "nothing of the log is from {} to {} s, which is to be left out: it lasts {} s, and times count from its \
         first row",
        number(*from), number(*to), number(*length)
    )]
    NothingLeftOut {
        /// From when, s.
        from: f64,
        /// Until when, s.
        to: f64,
        /// The log's length, s.
        length: f64,
    },
    /// A rate in place of an angle.
    #[error("`{column}` is a rate; it is integrated to the ball angle")]
    IntegratedRate {
        /// The column.
        column: String,
    },
    /// Rows are missing.
    #[error(
        "{count} gap(s) in the time stamps, the longest of {} s after {} s; the fit does not reach across",
        number(*longest), number(*time)
    )]
    Gaps {
        /// How many gaps.
        count: usize,
        /// The longest, s.
        longest: f64,
        /// When the longest begins, s.
        time: f64,
    },
    /// A time stamp like the one before.
    #[error(
        "{count} row(s) repeat the time stamp before, first in line {line}; the run is cut there"
    )]
    DuplicateStamps {
        /// How many rows.
        count: usize,
        /// Line of the first.
        line: usize,
    },
    /// A time stamp before the one before.
    #[error(
        "the time goes back {count} time(s), first in line {line} by {} s (rows out of order, or a restart of the clock); the run is cut there",
        number(*by)
    )]
    BackwardStamps {
        /// How many rows.
        count: usize,
        /// Line of the first.
        line: usize,
        /// By how much the first goes back, s.
        by: f64,
    },
    /// The rows are not evenly spaced.
    #[error("the rows are not evenly spaced: {:.3} ms in the middle, 99 % below {:.3} ms, at most {:.3} ms; the stamps are used as they are", median * 1e3, most * 1e3, longest * 1e3)]
    Jitter {
        /// Median interval, s.
        median: f64,
        /// What 99 % of the intervals are below, s.
        most: f64,
        /// The longest interval that is no gap, s.
        longest: f64,
    },
    /// A value that jumps: a reset, a wrap or a spike.
    #[error("`{column}` jumps {count} time(s), first by {} in line {line} ({}); the run is cut there", number(*size), kind_of_jump(*size))]
    Jumps {
        /// The column.
        column: String,
        /// How many.
        count: usize,
        /// Line of the first.
        line: usize,
        /// Its size, SI.
        size: f64,
    },
    /// Values for a moment that are many times all others.
    #[error(
        "`{column}` has {count} value(s) that stand out, first {} in line {line}, where 99 % are within {} of their middle; these rows are left out",
        number(*value), number(*usual)
    )]
    StandOut {
        /// The column.
        column: String,
        /// How many rows.
        count: usize,
        /// Line of the first.
        line: usize,
        /// The first, SI.
        value: f64,
        /// The distance from the middle that 99 % are within, SI.
        usual: f64,
    },
    /// The sensor stands still for longer than a robot does.
    #[error(
        "`{column}` does not change for {duration:.2} s from line {line} on: a sensor that hangs?"
    )]
    Frozen {
        /// The column.
        column: String,
        /// For how long, s.
        duration: f64,
        /// Line of its begin.
        line: usize,
    },
    /// The column has steps.
    #[error("`{column}` has steps of {step:.2e}")]
    Quantised {
        /// The column.
        column: String,
        /// The step, SI.
        step: f64,
    },
    /// The torque is at its limit.
    #[error("the torque is at its limit of {} N m in {:.1} % of the rows{}", number(*limit), 100.0 * part, if *commanded { COMMANDED_ONLY } else { "" })]
    Saturated {
        /// The limit, N m.
        limit: f64,
        /// In which part of the rows.
        part: f64,
        /// Only the torque that was asked for is known.
        commanded: bool,
    },
    /// What acted is not what was asked for.
    #[error(
        "the applied torque differs from the commanded one by {} N m (rms); the applied one is used",
        number(*difference)
    )]
    CommandNotApplied {
        /// Root of the mean square difference, N m.
        difference: f64,
    },
    /// The robot leans more than a standing one.
    #[error(
        "the robot leans beyond 0.8 rad after {time:.2} s (line {line}): it fell, or was lifted; {count} rows are left out"
    )]
    Fallen {
        /// Rows that are left out.
        count: usize,
        /// When the first of them is, s.
        time: f64,
        /// Line of the first.
        line: usize,
    },
    /// The tilt hardly changes with its rate.
    #[error(
        "the tilt changes by {slope:.2} times the integral of its rate, where 1 is right; the robot moved too little to say why"
    )]
    TiltAgainstRate {
        /// Slope; 1 is right.
        slope: f64,
    },
    /// Suspicious units that the builder accepts.
    #[error("accepted although suspicious: {0}")]
    AcceptedUnits(super::error::Suspicion),
}

const COMMANDED_ONLY: &str = "; it is the commanded one: if the motors gave less, friction and \
    inertias are wrong. Log the torque that was applied";

fn kind_of_jump(size: f64) -> &'static str {
    let turns = size.abs() / std::f64::consts::TAU;
    if (turns - turns.round()).abs() < 0.05 && turns > 0.5 {
        "an angle that wraps around"
    } else {
        "a reset or a spike"
    }
}
