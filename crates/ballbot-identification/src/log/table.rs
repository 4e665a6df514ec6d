//! From the text of a CSV file to columns of numbers.

use super::columns::{APPLIED, COMMANDED, Channel, Columns, Dimension};
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
) -> Result<Table, Problem> {
    let file = File::open(path).map_err(Problem::Read)?;
    if file.metadata().is_ok_and(|metadata| metadata.is_dir()) {
        return Err(Problem::Directory);
    }
    parse(BufReader::with_capacity(1 << 20, file), columns, findings)
}

fn parse(
    reader: impl BufRead,
    columns: &Columns,
    findings: &mut Vec<Finding>,
) -> Result<Table, Problem> {
    let mut lines = Lines::new(reader);
    let header = header(&mut lines, columns, findings)?;
    let header_line = lines.number;
    let (sources, commanded, torque) = sources(&header, columns)?;
    let mut table = Table {
        lines: Vec::new(),
        columns: Default::default(),
        commanded: Vec::new(),
        torque,
    };
    while lines.advance()? {
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
        if fields
            .iter()
            .zip(&header)
            .all(|(field, name)| field == name)
        {
            return Err(Problem::SecondHeader { line: number });
        }
        table.lines.push(number);
        for (column, source) in table.columns.iter_mut().zip(&sources) {
            column.push(match source {
                Some(source) => value(fields[source.place], source, number)?,
                None => f64::NAN,
            });
        }
        if let Some(source) = &commanded {
            let commanded = value(fields[source.place], source, number)?;
            table.commanded.push(commanded);
        }
    }
    Ok(table)
}

/// A blank line or a comment.
fn skipped(line: &str) -> bool {
    let line = line.trim_start();
    line.is_empty() || line.starts_with('#')
}

fn split(line: &str, delimiter: char) -> impl Iterator<Item = &str> {
    line.split(delimiter)
        .map(|field| field.trim().trim_matches('"').trim())
}

/// The names of the columns.
fn header(
    lines: &mut Lines<impl BufRead>,
    columns: &Columns,
    findings: &mut Vec<Finding>,
) -> Result<Vec<String>, Problem> {
    let text = loop {
        if !lines.advance()? {
            return Err(Problem::Empty);
        }
        let line = lines.text()?;
        let without_mark = line.trim_start_matches('\u{feff}');
        let (marked, text) = (without_mark.len() < line.len(), without_mark.to_owned());
        if marked {
            findings.push(Finding::ByteOrderMark);
        }
        if !skipped(&text) {
            break text;
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
    for (place, name) in header.iter().enumerate() {
        if let Some(first) = header[..place].iter().position(|other| other == name) {
            return Err(Problem::DuplicateColumn {
                name: name.clone(),
                first: first + 1,
                second: place + 1,
            });
        }
    }
    Ok(header)
}

type Sources = ([Option<Source>; 5], Option<Source>, Torque);

/// Where each quantity stands.
fn sources(header: &[String], columns: &Columns) -> Result<Sources, Problem> {
    let has = |name: &str| header.iter().any(|column| column == name);
    let mut torque = columns.torque.clone();
    let kind = if !torque.column.is_empty() {
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
        Some(source(header, &columns.time, Dimension::Time)?),
        Some(source(header, &columns.phi, Dimension::Angle)?),
        Some(source(header, &columns.theta, Dimension::Angle)?),
        if rate.column.is_empty() {
            None
        } else {
            Some(source(header, rate, Dimension::Rate)?)
        },
        Some(source(header, &torque, Dimension::Torque)?),
    ];
    Ok((sources, commanded, kind))
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
