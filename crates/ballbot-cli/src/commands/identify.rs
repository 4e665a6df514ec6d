//! `ballbot identify`.

use super::CommandError;
use crate::arguments::finite_list;
use crate::identification::{figures, published, report, summary};
use crate::input::{self, InputError};
use crate::json;
use crate::output::FileError;
use crate::progress::Progress;
use crate::results::ResultFolder;
use ballbot_identification::log::{self, LeftOut, Recording};
use ballbot_identification::{Config, ConfigError, IdentifiedRobot, USUAL_STEPS, identify};
use ballbot_scenario::words;
use clap::Args;
use std::path::{Path, PathBuf};

/// Arguments of `ballbot identify`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  ballbot identify log.csv                       a log in the format of `ballbot simulate --log`
  ballbot identify --example > my-robot.toml     columns, units, lengths, priors: a file to edit
  ballbot identify a.csv b.csv --config my-robot.toml --out results
  ballbot identify a.csv b.csv --leave-out 2:7.5,9            a push in the second log

Several logs are runs of one robot: of one plane, or of both where [log.y] names the second. Writes parameters.toml (for `ballbot lqr
--parameters` and for scenario files), report.html and the figures as SVG and PNG, and prints their
names. Where no robot explains the logs, it says why, writes the report without parameters.toml, and
exits with 1.")]
pub struct IdentifyArguments {
    /// CSV files with a header
    #[arg(value_name = "LOG.csv", required_unless_present = "example")]
    pub logs: Vec<PathBuf>,
    /// Columns, units, lengths, priors [default: the paper's lengths]
    #[arg(long, value_name = "FILE.toml")]
    pub config: Option<PathBuf>,
    /// Folder for the results
    #[arg(short, long, value_name = "DIR", default_value = "out/identification")]
    pub out: PathBuf,
    /// Leave out a part of a log, in seconds since its first row; 2:FROM,TO for the second log
    #[arg(long, value_name = "[LOG:]FROM,TO", value_parser = part)]
    pub leave_out: Vec<LeftOut>,
    /// Do not impose mechanics: see what the data alone say
    #[arg(long)]
    pub unphysical: bool,
    /// Show the published chain, too: p by linear regression, b by refinement
    #[arg(long, conflicts_with = "json")]
    pub published: bool,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
    /// Print a commented configuration and stop
    #[arg(long, conflicts_with_all = ["logs", "config", "unphysical", "published", "json"])]
    pub example: bool,
}

/// Reads, fits, judges and writes.
///
/// # Errors
/// A file cannot be used or written, or no robot explains the logs.
pub fn run(arguments: &IdentifyArguments) -> Result<String, CommandError> {
    if arguments.example {
        return Ok(Config::EXAMPLE.to_owned());
    }
    let mut config = configuration(arguments.config.as_deref())?;
    config.fit.physical &= !arguments.unphysical;
    let folder = open(&arguments.out)?;
    let recordings = read(arguments, &config)?;
    let choices = config
        .choices()
        .map_err(|error| InputError::Identification {
            path: arguments.config.clone().unwrap_or_default(),
            source: error,
        })?;
    let progress = Progress::new("fitting", USUAL_STEPS);
    let step = std::cell::Cell::new(0);
    let robot = identify(recordings, &config, choices, &|_| {
        step.set(step.get() + 1);
        progress.set(step.get().min(USUAL_STEPS - 1));
    })?;
    drop(progress);
    let parameters = robot.parameter_files();
    let files = write(&folder, &robot, parameters.as_deref().ok())?;
    if let Err(reasons) = parameters {
        let reasons = reasons.iter();
        let reasons = reasons.map(|reason| format!("\n- {}", robot.told(reason)));
        let mut old = PARAMETERS.into_iter().map(|name| arguments.out.join(name));
        let findings = robot.findings().into_iter();
        let seen = findings.flat_map(|(log, findings)| {
            let lines = findings.into_iter();
            lines.map(move |finding| format!("\n- {log}: {finding}"))
        });
        return Err(CommandError::NoRobot {
            reasons: reasons.collect(),
            seen: seen.collect(),
            report: arguments.out.join(REPORT),
            old: old.find(|path| path.exists()),
        });
    }
    Ok(if arguments.json {
        let mut document = serde_json::json!({});
        json::extend(&mut document, &robot.summary());
        document["folder"] = json::path(folder.path());
        document["files"] = serde_json::json!(files);
        json::text(&document)
    } else {
        said(arguments, &robot, &files)
    })
}

/// The result in words, with the names of the files.
fn said(arguments: &IdentifyArguments, robot: &IdentifiedRobot, files: &[String]) -> String {
    let lengths = match arguments.config {
        Some(_) => "",
        None => {
            "without --config the lengths are those of the paper's robot; if yours differ, nothing \
             below holds\n"
        }
    };
    let chain = if arguments.published {
        chains(robot)
    } else {
        String::new()
    };
    format!(
        "{lengths}{}{chain}\nwritten to {}: {}\n",
        summary::text(robot),
        arguments.out.display(),
        files.join(", ")
    )
}

/// The published chain, plane by plane.
fn chains(robot: &IdentifiedRobot) -> String {
    let planes = robot.planes.iter().enumerate();
    planes
        .map(|(place, plane)| {
            let name = robot.plane_name(place);
            let name = name.map(|name| format!(" (plane {name})"));
            format!(
                "\nThe published chain, to compare with{}\n{}{}\n",
                name.unwrap_or_default(),
                published::linear_parameters(plane).on_screen(),
                published::refined(plane)
            )
        })
        .collect()
}

/// `FROM,TO` or `LOG:FROM,TO`.
fn part(text: &str) -> Result<LeftOut, String> {
    let (log, times) = match text.split_once(':') {
        Some((log, times)) => {
            let log = log.parse::<usize>().ok().filter(|log| *log > 0);
            let log = log.ok_or_else(|| format!("`{text}`: logs are counted from 1"))?;
            (Some(log), times)
        }
        None => (None, text),
    };
    let time: [f64; 2] = finite_list(times)?;
    if time[0] < time[1] {
        Ok(LeftOut { log, time })
    } else {
        Err(format!("{} s is not after {} s", time[1], time[0]))
    }
}

fn read(arguments: &IdentifyArguments, config: &Config) -> Result<Vec<Recording>, CommandError> {
    let paths = &arguments.logs;
    let most = arguments.leave_out.iter().filter_map(|part| part.log).max();
    if let Some(log) = most.filter(|log| *log > paths.len()) {
        let logs = paths.len();
        let message = format!("--leave-out {log}:... is of log {log}, and there are {logs}");
        return Err(CommandError::Usage(message));
    }
    let progress = Progress::of_parts("reading");
    let report = |part: f64| progress.set_part(part);
    Ok(log::recordings(
        paths,
        &config.log,
        &arguments.leave_out,
        &report,
    )?)
}

/// The configuration in a file; the defaults without one.
///
/// # Errors
/// The file cannot be read or makes no sense.
pub fn configuration(path: Option<&Path>) -> Result<Config, InputError> {
    let Some(path) = path else {
        return Ok(Config::default());
    };
    let error = match Config::parse(&input::read_text(path)?) {
        Ok(config) => return Ok(config),
        Err(ConfigError::Syntax(message)) => ConfigError::Syntax(words::toml_message(&message)),
        Err(error) => error,
    };
    Err(InputError::Identification {
        path: path.to_owned(),
        source: error,
    })
}

/// Of one plane or a symmetric body, and of the planes of another.
const PARAMETERS: [&str; 3] = ["parameters.toml", "parameters_x.toml", "parameters_y.toml"];
const REPORT: &str = "report.html";

/// The figure `name` in the folder of the results, without the endings of its files.
fn figure_path(name: &str) -> String {
    format!("figures/{name}")
}

/// The files of all figures that there can be.
fn all_figure_files() -> Vec<String> {
    figures::NAMES
        .into_iter()
        .flatten()
        .flat_map(|name| ["svg", "png"].map(|kind| format!("{}.{kind}", figure_path(name))))
        .collect()
}

/// The folder for the results, if all of them can be written there.
fn open(path: &Path) -> Result<ResultFolder, FileError> {
    let figures = all_figure_files();
    let figures = figures.iter().map(String::as_str);
    let names = PARAMETERS.into_iter().chain([REPORT]).chain(figures);
    ResultFolder::open(crate::PROGRAM, path, &names.collect::<Vec<_>>())
}

/// Writes what there is, parameters only of a robot, and returns the names of the files.
fn write(
    folder: &ResultFolder,
    robot: &IdentifiedRobot,
    parameters: Option<&[(String, String)]>,
) -> Result<Vec<String>, CommandError> {
    let figures = figures::figures(robot);
    let report = report::html(robot, &figures)?;
    let texts = parameters.unwrap_or_default().iter().cloned();
    let texts = texts.map(|(name, text)| (name, text.into_bytes()));
    let mut files: Vec<(String, Vec<u8>)> = texts.collect();
    files.push((REPORT.to_owned(), report.into_bytes()));
    for figure in &figures {
        files.extend(figure.figure.files(&figure_path(figure.name))?);
    }
    // Figures of an earlier run that this one has not, and parameters in place of which there are
    // others now. Where there are none, they are kept, and told of.
    let all = all_figure_files();
    let mut stale: Vec<&str> = all.iter().map(String::as_str).collect();
    if parameters.is_some() {
        stale.extend(PARAMETERS);
    }
    folder.write(&files, &stale)?;
    Ok(files.into_iter().map(|(name, _)| name).collect())
}
