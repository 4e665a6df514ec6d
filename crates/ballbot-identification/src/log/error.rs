//! Why a log cannot be used, said to a person.

use super::finding::Finding;
use crate::words::number;
use lpvmpc_design::number_text;
use std::fmt;
use std::io;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// A log that cannot be used: which file, and what is wrong.
#[derive(Debug, Error)]
#[error("{}: {problem}", path.display())]
pub struct LogError {
    /// The file.
    pub path: PathBuf,
    /// What is wrong.
    pub problem: Problem,
}

impl LogError {
    /// A problem with the file at `path`.
    pub fn at(path: &Path, problem: Problem) -> Self {
        Self {
            path: path.to_owned(),
            problem,
        }
    }
}

/// What is wrong with a log. Lines and fields are counted from 1, the header is a line.
#[derive(Debug, Error)]
pub enum Problem {
    /// The file system refuses.
    #[error("cannot be read: {0}")]
    Read(io::Error),
    /// A folder.
    #[error("is a folder; a CSV file is needed")]
    Directory,
    /// Nothing in it.
    #[error("is empty; a header line with column names and one row per sample are needed")]
    Empty,
    /// UTF-16.
    #[error("is UTF-16 text; save it as UTF-8")]
    Utf16,
    /// Zero bytes.
    #[error("line {line}, byte {column} is zero: this is a binary file, not CSV text")]
    Binary {
        /// Line.
        line: usize,
        /// Byte in the line.
        column: usize,
    },
    /// Bytes that are no text.
    #[error("line {line}, byte {column}: not UTF-8 text; save the file as UTF-8")]
    NotUtf8 {
        /// Line.
        line: usize,
        /// Byte in the line.
        column: usize,
    },
    /// No line feeds, or a line of no log.
    #[error(
        "line {line} is longer than {limit} bytes; a row of a log has a few numbers, and ends with \
         a line feed"
    )]
    LongLine {
        /// Line.
        line: usize,
        /// The limit, bytes.
        limit: usize,
    },
    /// A log that is there already.
    #[error(
        "it has the same content as {}: a log that counts twice makes the results look surer than they are; name it \
         once",
        first.display()
    )]
    SameLog {
        /// The file that was named before.
        first: PathBuf,
    },
    /// A zenith angle of the wheels at which they do not turn the ball.
    #[error(
        "[log.wheels] zenith_angle_deg = {degrees}: it must be strictly between 0 and 90 degrees \
         (the paper's robot has 45)", degrees = number_text(*degrees))]
    ZenithAngle {
        /// The angle, degrees.
        degrees: f64,
    },
    /// Wheels that stand at one place.
    #[error(
        "[log.wheels] azimuths_deg = {degrees:?}: they must be finite and apart from each other \
         (the paper's robot has [-90, 30, 150])"
    )]
    Azimuths {
        /// The azimuths, degrees.
        degrees: [f64; 3],
    },
    /// Encoders of wheels are needed, and not named.
    #[error(
        "the columns of the wheels' encoders are not named: give them in the [log.wheels] table of a \
         configuration (`ballbot identify --example`)"
    )]
    NoWheels,
    /// A log of a push in which the wheels stand, or go to and fro.
    #[error(
        "the wheels have turned by no more than {ball_deg:.1} degrees of the ball from the beginning \
         to the end: push it in one direction, by a quarter of a turn or more"
    )]
    NoPush {
        /// How far, degrees of the ball.
        ball_deg: f64,
    },
    /// The first line has numbers only.
    #[error(
        "line {line} holds numbers where the header is expected: put a line with the column names \
         first, such as t_s,phi_rad,theta_rad,theta_dot_rad_s,torque_commanded_nm"
    )]
    NoHeader {
        /// Line.
        line: usize,
    },
    /// The header is a single field.
    #[error("the header has no `{delimiter}`{}", delimiter_hint(*suspected))]
    Delimiter {
        /// What was looked for.
        delimiter: char,
        /// What seems to be used instead.
        suspected: Option<char>,
    },
    /// Two columns of one name.
    #[error("the header names `{name}` twice, as fields {first} and {second}: rename one")]
    DuplicateColumn {
        /// The name.
        name: String,
        /// Field.
        first: usize,
        /// Field.
        second: usize,
    },
    /// A column is not there.
    #[error(
        "there is no column `{name}`{}; the columns are: {}. Give the names in the [log] table of a \
         configuration (`ballbot identify --example`)",
        nearest.as_ref().map_or(String::new(), |nearest| format!(" (did you mean `{nearest}`?)")),
        present.join(", ")
    )]
    MissingColumn {
        /// The name.
        name: String,
        /// The most similar one.
        nearest: Option<String>,
        /// All names.
        present: Vec<String>,
    },
    /// A unit of something else.
    #[error("column `{column}`: its unit must be one of {expected}")]
    Dimension {
        /// The column.
        column: String,
        /// Which units it may have.
        expected: String,
    },
    /// A factor that destroys the column.
    #[error(
        "column `{column}`: its factor is {factor}; it must be finite and not 0",
        factor = number_text(*factor)
    )]
    Factor {
        /// The column.
        column: String,
        /// The factor.
        factor: f64,
    },
    /// A row of another length.
    #[error("line {line} has {found} fields; the header {} has {expected}", header_place(*header_line))]
    FieldCount {
        /// Line.
        line: usize,
        /// Its fields.
        found: usize,
        /// The header's.
        expected: usize,
        /// The header's line; none where the configuration has it.
        header_line: Option<usize>,
    },
    /// The header once more.
    #[error(
        "line {line} is the header again: these are two logs in one file; hand them in as two files"
    )]
    SecondHeader {
        /// Line.
        line: usize,
    },
    /// Text where a number should be.
    #[error(
        "line {line}, column `{column}`: `{text}` is not a number{}",
        if *decimal_comma {
            "; numbers are written with a decimal point here, not with a comma"
        } else {
            ""
        }
    )]
    Text {
        /// Line.
        line: usize,
        /// The column.
        column: String,
        /// What stands there.
        text: String,
        /// It would be a number with a point.
        decimal_comma: bool,
    },
    /// A time stamp is missing.
    #[error(
        "line {line}: the time stamp is missing or not finite; without it the row has no place"
    )]
    MissingTime {
        /// Line.
        line: usize,
    },
    /// Too few rows.
    #[error("has {rows} rows below the header; at least {needed} are needed")]
    FewRows {
        /// Rows.
        rows: usize,
        /// Needed.
        needed: usize,
    },
    /// A column without information.
    #[error("column `{column}` is {} in all rows: {consequence}", number(*value))]
    Constant {
        /// The column.
        column: String,
        /// Its value, SI.
        value: f64,
        /// What that means.
        consequence: &'static str,
    },
    /// A column without values.
    #[error(
        "column `{column}` has no value in {missing} of {rows} rows; more than half must be there"
    )]
    MostlyMissing {
        /// The column.
        column: String,
        /// Rows without value.
        missing: usize,
        /// All rows.
        rows: usize,
    },
    /// Most rows are earlier than the row before.
    #[error(
        "column `{column}` goes back at {count} of {rows} rows: the rows must be in the order of time, the \
         earliest first"
    )]
    Backwards {
        /// The column.
        column: String,
        /// Rows that are earlier than the row before.
        count: usize,
        /// All rows.
        rows: usize,
    },
    /// The time between rows is that of no control loop.
    #[error(
        "rows are {} s apart (median): {}",
        number(*interval),
        if *interval > 0.2 {
            "a tilt mode of a ballbot needs at least 5 rows per second; is the time in ms, us or \
             ns? Say so as unit of [log.time]"
        } else {
            "no robot is sampled that fast; is the time in minutes, or its unit in [log.time] wrong?"
        }
    )]
    Rate {
        /// Median interval, s.
        interval: f64,
    },
    /// The units contradict each other, or no robot moves like that.
    #[error(
        "{0}. Give the units and signs in the [log] table, or set accept_suspicious_units = true \
         there if they are right"
    )]
    Units(Suspicion),
    /// Nothing is left between gaps and jumps.
    #[error(
        "there is no stretch of {needed} s without gap, jump or missing torque; the longest is \
         {longest:.3} s{}{}{}",
        match left_out {
            0 => String::new(),
            count => format!(". {count} of the {rows} rows are left out because the configuration or \
                              --leave-out says so"),
        },
        jumps.as_ref().map_or(String::new(), |(column, count)| format!(
            ". `{column}` jumps {count} times: is its unit wrong (degrees taken for radians), or does \
             its sensor fail?"
        )),
        seen.iter().map(|finding| format!(". {finding}")).collect::<String>(),
        needed = number_text(*needed))]
    NoStretch {
        /// Needed, s.
        needed: f64,
        /// Longest, s.
        longest: f64,
        /// Rows.
        rows: usize,
        /// Those of them that were not to be read.
        left_out: usize,
        /// The column that jumps most, and how often.
        jumps: Option<(String, usize)>,
        /// What else is odd.
        seen: Vec<Finding>,
    },
}

fn header_place(line: Option<usize>) -> String {
    line.map_or_else(
        || "of the configuration".to_owned(),
        |line| format!("in line {line}"),
    )
}

fn delimiter_hint(suspected: Option<char>) -> String {
    let name = match suspected {
        Some('\t') => "a tab, written \"\\t\"".to_owned(),
        Some(other) => format!("`{other}`"),
        None => return "; at least time, angles and torque are needed, one column each".to_owned(),
    };
    format!("; it seems to use {name}: set delimiter in the [log] table of a configuration")
}

/// Why units or signs are suspected.
#[derive(Clone, Debug, PartialEq)]
pub enum Suspicion {
    /// The change of the tilt against the integral of its rate.
    TiltAgainstRate {
        /// Slope; 1 if both are in SI units with one sign.
        slope: f64,
        /// Column of the tilt.
        tilt: String,
        /// Column of the rate.
        rate: String,
    },
    /// No robot leans that far.
    LargeTilt {
        /// How many times it comes back from beyond the limit.
        returns: usize,
        /// The limit, rad from the middle.
        limit: f64,
        /// The column.
        column: String,
    },
}

impl fmt::Display for Suspicion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::LargeTilt {
                returns,
                limit,
                column,
            } => write!(
                f,
                "`{column}` goes more than {limit} rad from its middle and comes back {returns} \
                 times, and a robot that leans so far falls: it seems to be in degrees"
            ),
            Self::TiltAgainstRate { slope, tilt, rate } => {
                let degrees = 180.0 / std::f64::consts::PI;
                write!(
                    f,
                    "`{tilt}` changes by {} times the integral of `{rate}`, where 1 is right: ",
                    number(*slope)
                )?;
                let near = |value: f64| {
                    slope.signum() == value.signum() && {
                        let ratio = slope / value;
                        (0.7..1.4).contains(&ratio)
                    }
                };
                if near(-1.0) {
                    write!(f, "one of them has the other sign")
                } else if near(degrees) || near(-degrees) {
                    write!(f, "the tilt seems to be in degrees and the rate in rad/s")
                } else if near(1.0 / degrees) || near(-1.0 / degrees) {
                    write!(
                        f,
                        "the rate seems to be in degrees per second and the tilt in rad"
                    )
                } else {
                    write!(
                        f,
                        "the columns, their units, the unit of the time, or the axis do not belong \
                         together"
                    )
                }
            }
        }
    }
}
