//! `ballbot wheels`.

use super::CommandError;
use super::identify::configuration;
use crate::table::Table;
use ballbot_identification::log::{LogError, Problem, WheelEncoders, turned};
use ballbot_identification::{Push, WheelCheck, azimuths_seen};
use clap::{Args, Subcommand};
use std::fmt::Write as _;
use std::path::PathBuf;

/// Arguments of `ballbot wheels`.
#[derive(Debug, Args)]
pub struct WheelsArguments {
    /// What to do.
    #[command(subcommand)]
    pub command: WheelsCommand,
}

/// What can be done about wheels.
#[derive(Debug, Subcommand)]
pub enum WheelsCommand {
    /// Check by hand that the wheels' order, sense of rotation and azimuths match a configuration
    Check(CheckArguments),
}

/// Arguments of `ballbot wheels check`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  ballbot wheels check along-x.csv --config my-robot.toml
  ballbot wheels check along-x.csv --along-y along-y.csv --turn turn.csv --config my-robot.toml

Before power-on: hold the body, log the wheels' encoders, and roll the ball under it by half a turn, so
that the robot would move along +x (forward); for --along-y along +y (to the left of it); for --turn
turn the ball counter-clockwise, seen from above. One push tells some mistakes, all three tell all.")]
pub struct CheckArguments {
    /// The encoders' log of a push along +x
    #[arg(value_name = "LOG.csv")]
    pub along_x: PathBuf,
    /// The same of a push along +y
    #[arg(long, value_name = "LOG.csv")]
    pub along_y: Option<PathBuf>,
    /// The same of a turn about the vertical, counter-clockwise seen from above
    #[arg(long, value_name = "LOG.csv")]
    pub turn: Option<PathBuf>,
    /// Columns, units, azimuths: the table [log.wheels]. Logs of pushes are read whole: from_s, until_s and leave_out
    /// are of those of `ballbot identify`
    #[arg(long, value_name = "FILE.toml")]
    pub config: PathBuf,
}

/// Checks the wheels.
///
/// # Errors
/// A file cannot be used, or the wheels are not as the configuration says.
pub fn run(arguments: &WheelsArguments) -> Result<String, CommandError> {
    let WheelsCommand::Check(arguments) = &arguments.command;
    let columns = configuration(Some(&arguments.config))?.log;
    let located = |problem| LogError::at(&arguments.config, problem);
    let said = columns.wheels.as_ref();
    let said = said.ok_or_else(|| located(Problem::NoWheels))?;
    let pushes = [
        (Push::AlongX, Some(&arguments.along_x)),
        (Push::AlongY, arguments.along_y.as_ref()),
        (Push::Turn, arguments.turn.as_ref()),
    ];
    let mut seen = Vec::new();
    for (push, path) in pushes {
        if let Some(path) = path {
            seen.push((push, turned(path, &columns)?));
        }
    }
    let check = WheelCheck::new(said, &seen).map_err(located)?;
    let table = table(said, &seen, &check);
    if check.agrees() {
        let off = check.off_deg;
        let rest = if seen.len() == 3 { "" } else { TOLD_APART };
        return Ok(format!(
            "{table}\norder, sense and azimuths agree with [log.wheels]: {off:.1} degrees off{rest}\n"
        ));
    }
    Err(CommandError::Wheels(format!(
        "{table}\n{}",
        mistake(said, &seen, &check)
    )))
}

/// What a single push leaves open.
const TOLD_APART: &str = "\npushes along y and a turn (--along-y, --turn) tell what a push along x \
                          does not: wheels that show the same in it";

/// Encoder by encoder what was seen beside what was expected, of the largest in each push.
fn table(said: &WheelEncoders, seen: &[(Push, [f64; 3])], check: &WheelCheck) -> String {
    let headers = seen
        .iter()
        .flat_map(|(push, _)| [format!("{push}, seen"), format!("{push}, expected")]);
    let mut table = Table::new(["encoder".to_owned()].into_iter().chain(headers));
    let largest = |angles: &[f64; 3]| angles.iter().fold(0.0_f64, |most, a| most.max(a.abs()));
    for (wheel, channel) in said.encoders.iter().enumerate() {
        let pairs = seen.iter().zip(&check.expected);
        let cells = pairs.flat_map(|((_, angles), expected)| {
            [angles, expected].map(|of| format!("{:+.2}", of[wheel] / largest(of)))
        });
        table.row([channel.column.clone()].into_iter().chain(cells));
    }
    table.to_string()
}

/// What does not agree, and what would.
fn mistake(said: &WheelEncoders, seen: &[(Push, [f64; 3])], check: &WheelCheck) -> String {
    let off = check.off_deg;
    let mut text = format!("the wheels are not as [log.wheels] says: {off:.0} degrees off");
    for wheel in &check.still {
        let column = &said.encoders[*wheel].column;
        write!(
            text,
            "\nthe angle of wheel {} (`{column}`) hardly moves while others turn: is the encoder connected? What follows \
             holds only if it is",
            wheel + 1
        )
        .ok();
    }
    if check.instead.is_empty() {
        text += "\nno order, sense or quarter turn of these azimuths agrees";
    } else {
        text += "\nit would agree if";
        for (i, arrangement) in check.instead.iter().enumerate() {
            let or = if i > 0 { "or " } else { "" };
            write!(text, "\n  {or}{arrangement}").ok();
        }
        if check.instead.len() > 1 {
            text += TOLD_APART;
        }
    }
    if let [(_, along_x), (Push::AlongY, along_y), ..] = seen {
        let azimuths = azimuths_seen(along_x, along_y).map(|azimuth| format!("{azimuth:.0}"));
        let [a, b, c] = azimuths;
        write!(
            text,
            "\nthe encoders show azimuths of {a}, {b} and {c} degrees, of a reversed wheel plus 180"
        )
        .ok();
    }
    text
}
