//! A robot's log: read, converted to SI units, looked at. Nothing is repaired in silence: what is
//! missing stays missing, and what is odd becomes a [`Finding`].

mod columns;
mod diagnosis;
mod error;
mod finding;
mod lines;
mod run;
mod table;

pub use columns::{BallAngle, Channel, Columns, Unit, WheelEncoders, WheelPlane};
pub use error::{LogError, Problem, Suspicion};
pub use finding::Finding;
pub(crate) use run::quantile;
pub use run::{Run, Torque};

use std::path::Path;

/// A log with what was found in it.
#[derive(Clone, Debug)]
pub struct Log {
    /// The measured run.
    pub run: Run,
    /// What is odd about it, in words by `Display`.
    pub findings: Vec<Finding>,
}

/// Called now and then with the part of the file that was read, 0 to 1.
pub type Progress<'a> = &'a dyn Fn(f64);

/// Reads a CSV file with a header.
///
/// # Errors
/// [`LogError`]: the file cannot be read or understood, or what is in it cannot be the log of a
/// moving ballbot in the units that `columns` says.
pub fn read(path: &Path, columns: &Columns, progress: Progress<'_>) -> Result<Log, LogError> {
    let located = |problem| LogError::at(path, problem);
    let mut findings = Vec::new();
    let table = table::read(path, columns, &mut findings, progress).map_err(located)?;
    let run = diagnosis::run(path, &table, columns, &mut findings).map_err(located)?;
    Ok(Log { run, findings })
}
