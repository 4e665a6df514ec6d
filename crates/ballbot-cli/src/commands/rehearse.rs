//! `ballbot rehearse`: from an excitation to a controller, on a simulated robot.

use super::CommandError;
use super::simulate::{self, SimulateArguments, Simulated};
use crate::arguments::{Arguments, Command};
use crate::json;
use crate::output;
use crate::results::ResultFolder;
use crate::table::{Table, number};
use ballbot::Ballbot;
use ballbot_scenario::{Parameters, PhiReference, Plane};
use ballbot_studies::recorded;
use clap::{Args, Parser};
use lpvmpc_sim::Trajectory;
use serde::Serialize;
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Arguments of `ballbot rehearse`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  ballbot rehearse                      all stages, in out/rehearsal
  ballbot rehearse --out my-rehearsal   again with what was changed there

Designs an excitation for a robot of which only a drawing is known, records a log of the robot in a
simulated world, identifies it from the log, and controls it with what was identified: a push, a
metre in 4 s, a curve on the floor. The stages are commands of their own, which are shown; their
files (robot, drawing, scenarios) are written to the folder first. Those that are there already are
kept: change them and rehearse again.")]
pub struct RehearseArguments {
    /// Folder for files and results
    #[arg(short, long, value_name = "DIR", default_value = "out/rehearsal")]
    pub out: PathBuf,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

macro_rules! file {
    ($name:literal) => {
        (
            $name,
            include_str!(concat!("../../../../docs/examples/chain/", $name)),
        )
    };
}

/// What the stages need.
const FILES: [(&str, &str); 5] = [
    file!("true-robot.toml"),
    file!("my-robot.toml"),
    file!("record.toml"),
    file!("move.toml"),
    file!("lissajous.toml"),
];

/// What the stages write beside these; the rest is in folders of its own.
const LOOSE: [&str; 2] = ["excitation.csv", "log.csv"];

/// The stages as command lines; what begins with @ is in the folder.
const STAGES: [&[&str]; 5] = [
    &[
        "excite",
        "--config",
        "@my-robot.toml",
        "--amplitude",
        "2",
        "--out",
        "@excitation.csv",
    ],
    &[
        "simulate",
        "@record.toml",
        "--out",
        "@record",
        "--log",
        "@log.csv",
    ],
    &[
        "identify",
        "@log.csv",
        "--config",
        "@my-robot.toml",
        "--out",
        "@identification",
    ],
    &["simulate", "@move.toml", "--out", "@move"],
    &["simulate", "@lissajous.toml", "--out", "@lissajous"],
];

/// Runs all stages and sums up.
///
/// # Errors
/// A file cannot be written, or a stage has no result.
pub fn run(arguments: &RehearseArguments) -> Result<String, CommandError> {
    let folder = &arguments.out;
    let results = ResultFolder::open(crate::PROGRAM, folder, &LOOSE)?;
    let missing = FILES.map(|(name, text)| (folder.join(name), text));
    let missing: Vec<(&Path, &[u8])> = missing
        .iter()
        .filter(|(path, _)| !path.exists())
        .map(|(path, text)| (path.as_path(), text.as_bytes()))
        .collect();
    output::write_files(&missing)?;
    results.claim(&LOOSE)?;

    let mut text = String::new();
    let mut runs = Vec::new();
    for stage in STAGES {
        let words = stage.iter().map(|word| match word.strip_prefix('@') {
            Some(name) => folder.join(name).into_os_string(),
            None => (*word).into(),
        });
        let words: Vec<_> = std::iter::once("ballbot".into()).chain(words).collect();
        for word in &words {
            // Writing to a string cannot fail.
            let _ = write!(text, "{} ", word.display());
        }
        let line = Arguments::try_parse_from(words)
            .map_err(|error| CommandError::Usage(error.to_string()))?;
        let said = match line.command {
            Command::Simulate(arguments) => {
                check_log(&arguments)?;
                let run = simulate::complete(&arguments)?;
                let said = run.summary.clone();
                runs.push(run);
                said
            }
            command => crate::run(Arguments {
                command,
                quiet: false,
            })?,
        };
        let _ = writeln!(text, "\n{said}");
    }
    let robots = [
        robot(folder, "true-robot.toml")?,
        robot(folder, "identification/parameters.toml")?,
    ];
    let parameters = parameters(&robots);
    let errors: Vec<Error> = runs.iter().map(Error::of).collect();
    if arguments.json {
        let parameter = |(name, real, found): &(&str, f64, f64)| json!({ "name": name, "true": real, "identified": found });
        let parameters: Vec<Value> = parameters.iter().map(parameter).collect();
        let document =
            json!({ "folder": json::path(folder), "parameters": parameters, "runs": errors });
        return Ok(json::text(&document));
    }
    Ok(text + &parameter_table(&parameters).to_string() + &error_table(&errors).to_string())
}

/// The next stage reads one log: of a run with two planes there would be two, beside one of an earlier rehearsal.
fn check_log(arguments: &SimulateArguments) -> Result<(), CommandError> {
    let scenario = &arguments.scenario;
    if arguments.log.is_some() && arguments.options.prepare(scenario)?.planes.len() > 1 {
        return Err(CommandError::Impossible(format!(
            "{scenario}: its reference has two planes; a rehearsal identifies the robot from the log of one"
        )));
    }
    Ok(())
}

fn robot(folder: &Path, name: &str) -> Result<Ballbot<f64>, CommandError> {
    let file = Parameters::File(name.into());
    Ok(file.read("parameters", &folder)?.ballbot)
}

/// What there is beside what was found.
fn parameters([real, found]: &[Ballbot<f64>; 2]) -> [(&'static str, f64, f64); 7] {
    let gain = |robot: &Ballbot<f64>| robot.geometry.ball_radius / robot.geometry.wheel_radius;
    [
        ("b1 [m^2]", real.b1, found.b1),
        ("b2 [m^2]", real.b2, found.b2),
        ("b3 [m^2]", real.b3, found.b3),
        ("b4, rolling [m^2/s]", real.b4, found.b4),
        (
            "friction in the drive [m^2/s]",
            real.drive.viscous,
            found.drive.viscous,
        ),
        (
            "Coulomb friction [m^2/s^2]",
            real.drive.coulomb,
            found.drive.coulomb,
        ),
        ("torque to ball [1/kg]", gain(real), gain(found)),
    ]
}

fn parameter_table(parameters: &[(&str, f64, f64)]) -> Table {
    let mut table = Table::new(["parameter", "true", "identified", "off by"]);
    for &(name, real, found) in parameters {
        let off = 100.0 * (found / real - 1.0);
        let off = if off.is_finite() {
            format!("{off:.1} %")
        } else {
            String::new()
        };
        table.row([name.to_owned(), number(real), number(found), off]);
    }
    table
}

/// How far the controlled robot was from where it should be.
#[derive(Debug, Serialize)]
struct Error {
    run: String,
    /// The time that the distance is taken over, s: during a move if the reference is one, else the
    /// run.
    from_s: f64,
    until_s: f64,
    /// `None` where the run ends before it.
    rms_distance_mm: Option<f64>,
    largest_tilt_rad: f64,
}

impl Error {
    fn of(run: &Simulated) -> Self {
        let planes = || run.prepared.planes.iter().zip(&run.trajectories);
        let end = run.prepared.end();
        // The planes of a run have references of one kind.
        let [from_s, until_s] = window(run.prepared.planes.first(), end);
        let squares = planes().map(|(_, trajectory)| mean_square(trajectory, [from_s, until_s]));
        let geometry = &run.prepared.ballbot.geometry;
        let distance = squares.sum::<Option<f64>>();
        let distance = distance.map(|square| geometry.position(square.sqrt()));
        let tilts = planes().flat_map(|(_, trajectory)| trajectory.states());
        Self {
            run: run.prepared.title.clone(),
            from_s,
            until_s,
            rms_distance_mm: distance.map(|metres| 1000.0 * metres),
            largest_tilt_rad: tilts.fold(0.0_f64, |most, x| most.max(x[1].abs())),
        }
    }
}

fn error_table(errors: &[Error]) -> Table {
    let mut table = Table::new(["run", "rms distance [mm]", "over [s]", "largest tilt [rad]"]);
    for error in errors {
        table.row([
            error.run.clone(),
            error
                .rms_distance_mm
                .map_or("the run ends before".to_owned(), |mm| format!("{mm:.1}")),
            format!(
                "{} to {}",
                recorded::time(error.from_s),
                recorded::time(error.until_s)
            ),
            format!("{:.3}", error.largest_tilt_rad),
        ]);
    }
    table
}

/// The time of the plane's move, as far as the run goes on if it begins within it, else of the whole run up to `end`, s.
fn window(plane: Option<&Plane>, end: f64) -> [f64; 2] {
    match plane.map(|plane| &plane.reference) {
        Some(PhiReference::MinimumJerk(points)) => match (points.first(), points.last()) {
            (Some(first), Some(last)) if first.time_s < end => [first.time_s, last.time_s.min(end)],
            (Some(first), Some(last)) => [first.time_s, last.time_s],
            _ => [0.0, end],
        },
        _ => [0.0, end],
    }
}

/// Mean square of phi - phi_ref in a time window, rad^2; `None` without a sample in it.
fn mean_square(trajectory: &Trajectory<4, 1>, [from, until]: [f64; 2]) -> Option<f64> {
    let samples = trajectory.samples.iter();
    let samples = samples.filter(|sample| sample.t >= from && sample.t <= until);
    let errors: Vec<f64> = samples
        .map(|sample| sample.x[0] - sample.x_ref[0])
        .collect();
    let sum = errors.iter().map(|error| error * error).sum::<f64>();
    (!errors.is_empty()).then(|| sum / errors.len() as f64)
}
