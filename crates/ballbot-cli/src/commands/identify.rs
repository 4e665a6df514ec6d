//! `ballbot identify`.

use super::CommandError;
use super::simulate::PNG_SCALE;
use crate::arguments::finite_list;
use crate::html::Drawing;
use crate::identification::{drawings, published, report, summary};
use crate::input::{self, InputError};
use crate::output;
use crate::progress::Progress;
use ballbot_identification::log::{self, Log, LogError};
use ballbot_identification::{Config, Identification, identify};
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

Several logs are runs of one plane of one robot. Writes parameters.toml (for `ballbot lqr
--parameters` and for scenario files), report.html and the figures as SVG and PNG. Where no robot
explains the logs, it says why, writes the report without parameters.toml, and exits with 1.")]
pub struct IdentifyArguments {
    /// CSV files with a header
    #[arg(value_name = "LOG.csv", required_unless_present = "example")]
    pub logs: Vec<PathBuf>,
    /// Columns, units, lengths, priors [default: the paper's lengths]
    #[arg(long, value_name = "FILE.toml")]
    pub config: Option<PathBuf>,
    /// Folder for the results
    #[arg(long, value_name = "DIR", default_value = "out/identification")]
    pub out: PathBuf,
    /// Leave out a part of a log, in seconds since its first row; of log 2 with 2:FROM,TO
    #[arg(long, value_name = "[LOG:]FROM,TO", value_parser = part)]
    pub leave_out: Vec<Part>,
    /// Do not impose mechanics: see what the data say alone
    #[arg(long)]
    pub unphysical: bool,
    /// Show the published chain, too: p by linear regression, b by refinement
    #[arg(long)]
    pub published: bool,
    /// Print a commented configuration and stop
    #[arg(long, conflicts_with_all = ["logs", "config", "unphysical", "published"])]
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
    let logs = read(arguments, &config)?;
    let choices = config
        .choices()
        .map_err(|error| InputError::Identification {
            path: arguments.config.clone().unwrap_or_default(),
            source: error,
        })?;
    let progress = Progress::new("fitting", EXPECTED_STEPS);
    let step = std::cell::Cell::new(0);
    let identification = identify(logs, &config, choices, &|_| {
        step.set(step.get() + 1);
        progress.set(step.get().min(EXPECTED_STEPS - 1));
    })?;
    drop(progress);
    let drawings = drawings::drawings(&identification);
    let parameters = identification.parameter_file();
    write(
        &arguments.out,
        &identification,
        &drawings,
        parameters.as_deref().ok(),
    )?;
    if let Err(reasons) = parameters {
        let reasons = reasons.iter().map(|reason| format!("\n- {reason}"));
        let old = arguments.out.join("parameters.toml");
        return Err(CommandError::NoRobot {
            reasons: reasons.collect(),
            report: arguments.out.join("report.html"),
            old: old.exists().then_some(old),
        });
    }
    let lengths = match arguments.config {
        Some(_) => "",
        None => {
            "without --config the lengths are those of the paper's robot; if yours differ, nothing \
             below holds\n"
        }
    };
    let chain = if arguments.published {
        format!(
            "\nThe published chain, to compare with\n{}{}\n",
            published::linear_parameters(&identification).on_screen(),
            published::refined(&identification)
        )
    } else {
        String::new()
    };
    Ok(format!(
        "{lengths}{}{chain}\nwritten to {}: parameters.toml, report.html, figures\n",
        summary::text(&identification),
        arguments.out.display()
    ))
}

/// A part of a log.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Part {
    /// Which log, counted from 1; all of them if none is said.
    log: Option<usize>,
    /// From when to when, s since the first row.
    time: [f64; 2],
}

/// `FROM,TO` or `LOG:FROM,TO`.
fn part(text: &str) -> Result<Part, String> {
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
        Ok(Part { log, time })
    } else {
        Err(format!("{} s is not after {} s", time[1], time[0]))
    }
}

fn read(arguments: &IdentifyArguments, config: &Config) -> Result<Vec<Log>, CommandError> {
    let paths = &arguments.logs;
    let most = arguments.leave_out.iter().filter_map(|part| part.log).max();
    if let Some(log) = most.filter(|log| *log > paths.len()) {
        let logs = paths.len();
        let message = format!("--leave-out {log}:... is of log {log}, and there are {logs}");
        return Err(CommandError::Usage(message));
    }
    let progress = Progress::new("reading", paths.len() * PARTS);
    let logs = paths.iter().enumerate().map(|(done, path)| {
        let report = |part: f64| progress.set(done * PARTS + (part * PARTS as f64) as usize);
        let mut columns = config.log.clone();
        let parts = arguments.leave_out.iter();
        let of_this = parts.filter(|part| part.log.is_none_or(|log| log == done + 1));
        columns.leave_out.extend(of_this.map(|part| part.time));
        log::read(path, &columns, &report)
    });
    Ok(logs.collect::<Result<_, LogError>>()?)
}

/// Steps of the progress per file.
const PARTS: usize = 100;

/// Steps of a usual identification: coarse fits of three starts, the fit with its noise, four
/// structures.
const EXPECTED_STEPS: usize = 60;

/// The configuration in a file; the defaults without one.
///
/// # Errors
/// The file cannot be read or makes no sense.
pub fn configuration(path: Option<&Path>) -> Result<Config, InputError> {
    let Some(path) = path else {
        return Ok(Config::default());
    };
    Config::parse(&input::read_text(path)?).map_err(|source| InputError::Identification {
        path: path.to_owned(),
        source,
    })
}

fn write(
    folder: &Path,
    identification: &Identification,
    drawings: &[Drawing],
    parameters: Option<&str>,
) -> Result<(), CommandError> {
    let mut files: Vec<(PathBuf, Vec<u8>)> = vec![(
        folder.join("report.html"),
        report::html(identification, drawings)?.into_bytes(),
    )];
    if let Some(parameters) = parameters {
        files.push((folder.join("parameters.toml"), parameters.into()));
    }
    for drawing in drawings {
        let path = folder.join("figures").join(drawing.name);
        let svg = drawing.figure.svg()?.into_bytes();
        files.push((path.with_extension("svg"), svg));
        files.push((path.with_extension("png"), drawing.figure.png(PNG_SCALE)?));
    }
    let files: Vec<(&Path, &[u8])> = files
        .iter()
        .map(|(path, content)| (path.as_path(), content.as_slice()))
        .collect();
    output::write_files(&files)?;
    Ok(())
}
