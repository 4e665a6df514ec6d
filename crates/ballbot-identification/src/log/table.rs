//! From the text of a CSV file to columns of numbers.

use super::Progress;
use super::channel::Channel;
use super::columns::{APPLIED, COMMANDED, Columns, Dimension};
use super::error::Problem;
use super::finding::Finding;
use super::lines::Lines;
use super::run::Torque;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;

/// Columns in SI units, with the line of each row. NaN is a missing value.
pub(super) struct Table {
    pub(super) lines: Vec<usize>,
    /// Time, phi, theta, theta_dot, torque.
    pub(super) columns: [Vec<f64>; 5],
    /// Torque that was asked for, where it stands beside the one that was applied.
    pub(super) commanded: Vec<f64>,
    pub(super) torque: Torque,
    /// The second column is the ball's rate.
    pub(super) rate_of_ball: bool,
}

impl Table {
    /// Takes all but the time of these rows away, as if it were missing.
    pub(super) fn forget(&mut self, rows: &[usize]) {
        let [_, measured @ ..] = &mut self.columns;
        for column in measured.iter_mut().chain([&mut self.commanded]) {
            for &row in rows {
                // There may be no second torque.
                if let Some(value) = column.get_mut(row) {
                    *value = f64::NAN;
                }
            }
        }
    }
}

/// A column that is read.
struct Source {
    place: usize,
    name: String,
    scale: f64,
}

pub(super) fn read(
    path: &Path,
    columns: &Columns,
    findings: &mut Vec<Finding>,
    progress: Progress<'_>,
) -> Result<Table, Problem> {
    let file = File::open(path).map_err(Problem::Read)?;
    let metadata = file.metadata().map_err(Problem::Read)?;
    if metadata.is_dir() {
        return Err(Problem::Directory);
    }
    let length = metadata.len().max(1) as f64;
    let progress = |bytes: u64| progress((bytes as f64 / length).min(1.0));
    let reader = BufReader::with_capacity(1 << 20, file);
    parse(reader, columns, findings, &progress)
}

/// Bytes between two reports of progress.
const REPORT: u64 = 1 << 20;

fn parse(
    reader: impl BufRead,
    columns: &Columns,
    findings: &mut Vec<Finding>,
    progress: &dyn Fn(u64),
) -> Result<Table, Problem> {
    let mut lines = Lines::new(reader);
    let header = names(&mut lines, columns, findings)?;
    let (sources, commanded, torque) = sources(&header, columns)?;
    let mut table = Table {
        lines: Vec::new(),
        columns: Default::default(),
        commanded: Vec::new(),
        torque,
        rate_of_ball: columns.ball_dimension()? == Dimension::Rate,
    };
    rows(
        &mut lines,
        &header,
        columns,
        findings,
        progress,
        &mut |fields, number| {
            table.lines.push(number);
            for (column, source) in table.columns.iter_mut().zip(&sources) {
                column.push(combined(fields, source, number)?);
            }
            if let Some(source) = &commanded {
                let commanded = value(fields[source.place], source, number)?;
                table.commanded.push(commanded);
            }
            Ok(())
        },
    )?;
    Ok(table)
}

/// The angles of the three encoders in rad, after their factors, row by row; NaN is a missing value.
pub(super) fn encoders(path: &Path, columns: &Columns) -> Result<Vec<[f64; 3]>, Problem> {
    let wheels = columns.wheels.as_ref().ok_or(Problem::NoWheels)?;
    let file = File::open(path).map_err(Problem::Read)?;
    let mut lines = Lines::new(BufReader::new(file));
    let mut findings = Vec::new();
    let header = names(&mut lines, columns, &mut findings)?;
    let [first, second, third] = &wheels.encoders;
    let sources = [
        source(&header, first, Dimension::Angle)?,
        source(&header, second, Dimension::Angle)?,
        source(&header, third, Dimension::Angle)?,
    ];
    let mut angles = Vec::new();
    rows(
        &mut lines,
        &header,
        columns,
        &mut findings,
        &|_| (),
        &mut |fields, number| {
            let mut row = [0.0; 3];
            for (angle, source) in row.iter_mut().zip(&sources) {
                *angle = value(fields[source.place], source, number)?;
            }
            angles.push(row);
            Ok(())
        },
    )?;
    Ok(angles)
}

/// Takes the fields of a row, and its line.
type TakeRow<'a> = dyn FnMut(&[&str], usize) -> Result<(), Problem> + 'a;

/// Calls `take` for every row below the header with its fields, as many as the header has, and its
/// line.
fn rows(
    lines: &mut Lines<impl BufRead>,
    header: &[String],
    columns: &Columns,
    findings: &mut Vec<Finding>,
    progress: &dyn Fn(u64),
    take: &mut TakeRow<'_>,
) -> Result<(), Problem> {
    // None where the configuration has it.
    let header_line = Some(lines.number).filter(|line| *line > 0);
    let mut reported = 0;
    while lines.advance()? {
        if lines.bytes >= reported + REPORT {
            reported = lines.bytes;
            progress(reported);
        }
        note_mark(lines, findings);
        let (number, line) = (lines.number, lines.text()?);
        if skipped(line) {
            continue;
        }
        let fields: Vec<&str> = split(line, columns.delimiter).collect();
        if fields.len() != header.len() {
            let found = fields.len();
            // A logger that lost its power leaves half a line.
            if found < header.len() && !lines.ended {
                findings.push(Finding::IncompleteLastRow { line: number });
                break;
            }
            return Err(Problem::FieldCount {
                line: number,
                found,
                expected: header.len(),
                header_line,
            });
        }
        if fields.iter().zip(header).all(|(field, name)| field == name) {
            return Err(Problem::SecondHeader { line: number });
        }
        take(&fields, number)?;
    }
    Ok(())
}

/// Reports the byte order mark of the line, if it has one.
fn note_mark(lines: &Lines<impl BufRead>, findings: &mut Vec<Finding>) {
    if lines.is_marked() {
        findings.push(Finding::ByteOrderMark);
    }
}

/// A blank line or a comment.
fn skipped(line: &str) -> bool {
    let line = line.trim_start();
    line.is_empty() || line.starts_with(['#', '%'])
}

fn split(line: &str, delimiter: char) -> impl Iterator<Item = &str> {
    let blank = delimiter == ' ';
    let line = if blank { line.trim() } else { line };
    line.split(move |c: char| c == delimiter || blank && c == '\t')
        // Blanks that align columns stand for one.
        .filter(move |field| !(blank && field.is_empty()))
        .map(|field| field.trim().trim_matches('"').trim())
}

/// The names of the columns.
fn names(
    lines: &mut Lines<impl BufRead>,
    columns: &Columns,
    findings: &mut Vec<Finding>,
) -> Result<Vec<String>, Problem> {
    let names = if columns.header.is_empty() {
        header(lines, columns, findings)?
    } else {
        columns.header.clone()
    };
    duplicates(&names)?;
    Ok(names)
}

/// The names in the file's first line.
fn header(
    lines: &mut Lines<impl BufRead>,
    columns: &Columns,
    findings: &mut Vec<Finding>,
) -> Result<Vec<String>, Problem> {
    let text = loop {
        if !lines.advance()? {
            return Err(Problem::Empty);
        }
        note_mark(lines, findings);
        let line = lines.text()?;
        if !skipped(line) {
            break line.to_owned();
        }
    };
    let header: Vec<String> = split(&text, columns.delimiter).map(str::to_owned).collect();
    let line = lines.number;
    if header.iter().all(|name| name.parse::<f64>().is_ok()) {
        return Err(Problem::NoHeader { line });
    }
    if header.len() == 1 {
        let present = [',', ';', '\t', '|', ' '].into_iter();
        let present = present.filter(|other| *other != columns.delimiter);
        let found = present.max_by_key(|other| text.matches(*other).count());
        return Err(Problem::Delimiter {
            delimiter: columns.delimiter,
            suspected: found.filter(|other| text.contains(*other)),
        });
    }
    Ok(header)
}

/// Each name once.
fn duplicates(header: &[String]) -> Result<(), Problem> {
    for (place, name) in header.iter().enumerate() {
        if let Some(first) = header[..place].iter().position(|other| other == name) {
            return Err(Problem::DuplicateColumn {
                name: name.clone(),
                first: first + 1,
                second: place + 1,
            });
        }
    }
    Ok(())
}

/// What each quantity is the sum of.
type Sources = ([Vec<Source>; 5], Option<Source>, Torque);

/// Where each quantity stands.
fn sources(header: &[String], columns: &Columns) -> Result<Sources, Problem> {
    let has = |name: &str| header.iter().any(|column| column == name);
    let mut torque = columns.torque.clone();
    let wheels = columns.wheels.as_ref();
    let torques = wheels.and_then(|wheels| Some((wheels, wheels.torques.as_ref()?)));
    let kind = if torques.is_some() || !torque.column.is_empty() {
        Torque::Named
    } else if has(APPLIED) {
        torque.column = APPLIED.to_owned();
        Torque::Applied
    } else {
        torque.column = COMMANDED.to_owned();
        Torque::Commanded
    };
    let commanded = if kind == Torque::Applied && has(COMMANDED) {
        let channel = Channel {
            column: COMMANDED.to_owned(),
            ..torque.clone()
        };
        Some(source(header, &channel, Dimension::Torque)?)
    } else {
        None
    };
    let rate = &columns.theta_dot;
    let sources = [
        vec![source(header, &columns.time, Dimension::Time)?],
        ball_angle(header, columns)?,
        vec![source(header, &columns.theta, Dimension::Angle)?],
        if rate.column.is_empty() {
            Vec::new()
        } else {
            vec![source(header, rate, Dimension::Rate)?]
        },
        match torques {
            Some((wheels, torques)) => {
                let weights = wheels.torque_weights()?;
                weighted(header, torques, weights, Dimension::Torque)?
            }
            None => vec![source(header, &torque, Dimension::Torque)?],
        },
    ];
    Ok((sources, commanded, kind))
}

/// The ball angle's column, or those of the three wheels.
fn ball_angle(header: &[String], columns: &Columns) -> Result<Vec<Source>, Problem> {
    let dimension = columns.ball_dimension()?;
    let Some(wheels) = &columns.wheels else {
        return Ok(vec![source(header, &columns.phi, dimension)?]);
    };
    weighted(header, &wheels.encoders, wheels.weights()?, dimension)
}

/// The columns of three wheels, each with its weight.
fn weighted(
    header: &[String],
    channels: &[Channel; 3],
    weights: [f64; 3],
    dimension: Dimension,
) -> Result<Vec<Source>, Problem> {
    let channels = channels.iter().zip(weights);
    channels
        .map(|(channel, weight)| {
            let mut source = source(header, channel, dimension)?;
            source.scale *= weight;
            Ok(source)
        })
        .collect()
}

impl Columns {
    /// Whether the ball's angle is read, or its rate.
    fn ball_dimension(&self) -> Result<Dimension, Problem> {
        let channel = match &self.wheels {
            Some(wheels) => &wheels.encoders[0],
            None => &self.phi,
        };
        match channel.unit.dimension() {
            dimension @ (Dimension::Angle | Dimension::Rate) => Ok(dimension),
            _ => Err(Problem::Dimension {
                column: channel.column.clone(),
                expected: format!("{}; or {}", Dimension::Angle, Dimension::Rate),
            }),
        }
    }
}

fn source(header: &[String], channel: &Channel, dimension: Dimension) -> Result<Source, Problem> {
    if channel.unit.dimension() != dimension {
        return Err(Problem::Dimension {
            column: channel.column.clone(),
            expected: dimension.to_string(),
        });
    }
    if !(channel.factor.is_finite() && channel.factor != 0.0) {
        return Err(Problem::Factor {
            column: channel.column.clone(),
            factor: channel.factor,
        });
    }
    let place = header.iter().position(|name| *name == channel.column);
    let place = place.ok_or_else(|| {
        let similar =
            |name: &&String| (strsim::jaro_winkler(name, &channel.column) * 1000.0).round() as i64;
        Problem::MissingColumn {
            name: channel.column.clone(),
            nearest: header.iter().max_by_key(similar).cloned(),
            present: header.to_vec(),
        }
    })?;
    Ok(Source {
        place,
        name: channel.column.clone(),
        scale: channel.scale(),
    })
}

/// The sum of a quantity's columns; NaN where one is missing or there is none.
fn combined(fields: &[&str], sources: &[Source], line: usize) -> Result<f64, Problem> {
    let mut sum = if sources.is_empty() { f64::NAN } else { 0.0 };
    for source in sources {
        sum += value(fields[source.place], source, line)?;
    }
    Ok(sum)
}

/// A number; NaN where the field is empty or says that there is none.
fn value(field: &str, source: &Source, line: usize) -> Result<f64, Problem> {
    if let Ok(value) = field.parse::<f64>() {
        let finite = value.is_finite();
        return Ok(if finite {
            value * source.scale
        } else {
            f64::NAN
        });
    }
    let missing = ["", "na", "n/a", "null", "none", "-"];
    if missing.contains(&field.to_ascii_lowercase().as_str()) {
        return Ok(f64::NAN);
    }
    Err(Problem::Text {
        line,
        column: source.name.clone(),
        text: field.chars().take(40).collect(),
        decimal_comma: field.replacen(',', ".", 1).parse::<f64>().is_ok(),
    })
}
