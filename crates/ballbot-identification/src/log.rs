//! A robot's log: read, converted to SI units, looked at. Nothing is repaired in silence: what is
//! missing stays missing, and what is odd becomes a [`Finding`].

mod channel;
mod columns;
mod diagnosis;
mod error;
mod finding;
mod lines;
mod run;
mod table;

pub use channel::Channel;
pub use columns::{BallAngle, Columns, SecondPlane, Unit, WheelEncoders, WheelPlane};
pub use error::{LogError, Problem, Suspicion};
pub use finding::Finding;
use run::median;
pub use run::{Run, Torque};
pub(crate) use run::{TorqueReader, quantile};

use std::path::Path;

/// A log with what was found in it.
#[derive(Clone, Debug)]
pub struct Log {
    /// The measured run.
    pub run: Run,
    /// What is odd about it, in words by `Display`.
    pub findings: Vec<Finding>,
}

/// A file with every plane that is identified from it.
#[derive(Clone, Debug)]
pub struct Recording {
    /// The log of each plane.
    pub planes: Vec<Log>,
    /// The turn of the wheels about the vertical and its torque, in place of a plane's ball angle and
    /// torque, where both planes are read from three wheels.
    pub turn: Option<Run>,
}

/// How far the three encoders of `[log.wheels]` have turned from the beginning of a log to its end,
/// rad after their factors: medians of the first and the last tenth of the values.
///
/// # Errors
/// [`LogError`]: the file cannot be read or understood, most of a column is missing, or
/// nothing was turned.
pub fn turned(path: &Path, columns: &Columns) -> Result<[f64; 3], LogError> {
    let located = |problem| LogError::at(path, problem);
    let rows = table::encoders(path, columns).map_err(located)?;
    let mut turned = [0.0; 3];
    let wheels = columns.wheels.iter().flat_map(|wheels| &wheels.encoders);
    for (wheel, (turned, source)) in turned.iter_mut().zip(wheels).enumerate() {
        let angles = rows.iter().map(|row| row[wheel]);
        let mut angles: Vec<f64> = angles.filter(|angle| angle.is_finite()).collect();
        let missing = rows.len() - angles.len();
        if missing >= angles.len() {
            return Err(located(Problem::MostlyMissing {
                column: source.column.clone(),
                missing,
                rows: rows.len(),
            }));
        }
        let end = (angles.len() / 10).max(1);
        let last = angles.len() - end;
        *turned = median(&mut angles[last..]) - median(&mut angles[..end]);
    }
    let ball_deg = turned
        .iter()
        .fold(0.0_f64, |most, angle| most.max(angle.abs()))
        .to_degrees();
    if ball_deg > LEAST_PUSH_DEG {
        Ok(turned)
    } else {
        Err(located(Problem::NoPush { ball_deg }))
    }
}

/// Less of a turn of the ball than this says nothing, degrees.
const LEAST_PUSH_DEG: f64 = 10.0;

/// Called now and then with the part of the file that was read, 0 to 1.
pub type Progress<'a> = &'a dyn Fn(f64);

/// Reads all planes of a CSV file with a header.
///
/// # Errors
/// As [`read`], of any plane.
pub fn recording(
    path: &Path,
    columns: &Columns,
    progress: Progress<'_>,
) -> Result<Recording, LogError> {
    let (planes, turn) = (columns.planes(), columns.turn());
    let passes = (planes.len() + usize::from(turn.is_some())) as f64;
    let pass = |place: usize, columns: &Columns| {
        let done = |part: f64| progress((place as f64 + part) / passes);
        read(path, columns, &done)
    };
    let logs = planes.iter().enumerate();
    Ok(Recording {
        planes: logs
            .map(|(place, columns)| pass(place, columns))
            .collect::<Result<_, _>>()?,
        // A robot that never turns has a turn that no diagnosis takes, and it is not needed.
        turn: turn.and_then(|columns| Some(pass(planes.len(), &columns).ok()?.run)),
    })
}

/// A part of a log, or of all, that is left out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LeftOut {
    /// Which log, counted from 1; all of them if `None`.
    pub log: Option<usize>,
    /// From when to when, s since the first row.
    pub time: [f64; 2],
}

/// Reads all planes of CSV files with a header, but for the parts that are left out beside those of
/// the `columns`.
///
/// # Errors
/// As [`read`], of any file and plane; or two files have the same content.
pub fn recordings(
    paths: &[impl AsRef<Path>],
    columns: &Columns,
    left_out: &[LeftOut],
    progress: Progress<'_>,
) -> Result<Vec<Recording>, LogError> {
    check_different(paths)?;
    let logs = paths.iter().enumerate().map(|(done, path)| {
        let report = |part: f64| progress((done as f64 + part) / paths.len() as f64);
        let mut columns = columns.clone();
        let of_this = left_out.iter();
        let of_this = of_this.filter(|part| part.log.is_none_or(|log| log == done + 1));
        columns.leave_out.extend(of_this.map(|part| part.time));
        recording(path.as_ref(), &columns, &report)
    });
    logs.collect()
}

/// A log that counts twice makes the standard deviations smaller than they are.
fn check_different(paths: &[impl AsRef<Path>]) -> Result<(), LogError> {
    for (i, path) in paths.iter().enumerate() {
        let path = path.as_ref();
        let mut before = paths[..i].iter().map(AsRef::as_ref);
        if let Some(first) = before.find(|first| have_one_content(first, path)) {
            let first = first.to_owned();
            return Err(LogError::at(path, Problem::SameLog { first }));
        }
    }
    Ok(())
}

/// What is wrong with a file that cannot be read is said when it is read as a log.
fn have_one_content(one: &Path, other: &Path) -> bool {
    let size = |path: &Path| {
        let known = std::fs::metadata(path).ok()?;
        known.is_file().then_some(known.len())
    };
    let content = |path: &Path| std::fs::read(path).ok();
    size(one).is_some() && size(one) == size(other) && content(one) == content(other)
}

/// Reads one plane of a CSV file with a header.
///
/// # Errors
/// [`LogError`]: the file cannot be read or understood, or what is in it cannot be the log of a
/// moving ballbot in the units that `columns` says.
pub fn read(path: &Path, columns: &Columns, progress: Progress<'_>) -> Result<Log, LogError> {
    let located = |problem| LogError::at(path, problem);
    let mut findings = Vec::new();
    let table = table::read(path, columns, &mut findings, progress).map_err(located)?;
    let run = diagnosis::run(path, table, columns, &mut findings).map_err(located)?;
    Ok(Log { run, findings })
}
