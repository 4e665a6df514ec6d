//! `ballbot simulate`.

use super::CommandError;
use super::robot::ScenarioOptions;
use crate::json;
use crate::output::{self, FileError};
use crate::progress::Progress;
use crate::results::ResultFolder;
use crate::run_figures::{self, Shown};
use crate::table::Table;
use ballbot_scenario::{MotorSample, Prepared, Record, RunHooks, words};
use ballbot_studies::recorded::{self, Columns, Metrics};
use clap::Args;
use lpvmpc_figures::{Figure, Role};
use lpvmpc_sim::{LogRow, Termination, Trajectory};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Arguments of `ballbot simulate`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  ballbot simulate two-setpoints
  ballbot simulate lissajous --out results
  ballbot simulate my.toml               a file made by `ballbot scenario show NAME`
  ballbot simulate two-setpoints --set controller.horizon=30 --set bounds.torque_nm.1=1.0

Writes trajectory.csv (for two planes trajectory_x.csv, trajectory_y.csv and motors.csv) and a
figure as SVG and PNG, in place of those of an earlier run in the same folder; other files are not
touched, .ballbot-files says which are the program's. --log adds what the
sensors of `[world]` delivered. A run that ends early keeps what it recorded, and exits with 1. Pushes
and set points that it ends before are told on standard error.")]
pub struct SimulateArguments {
    /// A built-in scenario or a TOML file
    pub scenario: String,
    /// What it is changed by.
    #[command(flatten)]
    pub options: ScenarioOptions,
    /// Folder for the results [default: out/SCENARIO]
    #[arg(short, long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
    /// Write what the robot's sensors delivered, as CSV; of two planes log-x.csv and log-y.csv for log.csv. - for
    /// standard output, in place of the summary; for one plane only
    #[arg(long, value_name = "FILE")]
    pub log: Option<PathBuf>,
}

/// Runs a scenario and writes its results.
///
/// # Errors
/// The scenario is not valid, a file cannot be written, or the run ended early.
pub fn run(arguments: &SimulateArguments) -> Result<String, CommandError> {
    let simulated = complete(arguments)?;
    if let Some(log) = simulated.log {
        return Ok(log);
    }
    Ok(match arguments.json {
        true => json::text(&simulated.document),
        false => simulated.summary,
    })
}

/// A run that came to its end.
#[derive(Clone, Debug)]
pub struct Simulated {
    /// What was run.
    pub prepared: Prepared,
    /// What happened in each plane.
    pub trajectories: Vec<Trajectory<4, 1>>,
    /// Its numbers, for people.
    pub summary: String,
    /// The same for other programs.
    pub document: Value,
    /// What the sensors delivered, where it goes to standard output.
    pub log: Option<String>,
}

/// [`run`] with all that is known of it.
///
/// # Errors
/// As [`run`].
pub fn complete(arguments: &SimulateArguments) -> Result<Simulated, CommandError> {
    let prepared = arguments.options.prepare(&arguments.scenario)?;
    tell_too_late(arguments, &prepared)?;
    let file = Path::new(&arguments.scenario);
    let name = file.file_stem().unwrap_or(file.as_os_str());
    let folder = match &arguments.out {
        Some(folder) => folder.clone(),
        None => Path::new("out").join(name),
    };
    let folder = ResultFolder::open(crate::PROGRAM, &folder, &RESULTS)?;
    let logs = match &arguments.log {
        Some(_) if arguments.logs_to_standard_output() => {
            check_alone(arguments.json, prepared.planes.len())?;
            Vec::new()
        }
        Some(path) => log_paths(path, prepared.planes.len()),
        None => Vec::new(),
    };
    let results = RESULTS.iter().map(|name| folder.path().join(name));
    let read = arguments.options.files(&arguments.scenario)?;
    // A result of an earlier run may be what this one follows.
    results
        .clone()
        .try_for_each(|path| output::check_separate(&path, read.iter().map(PathBuf::as_path)))?;
    let others: Vec<PathBuf> = results.chain(read).collect();
    logs.iter()
        .try_for_each(|path| output::check_separate(path, others.iter().map(PathBuf::as_path)))?;
    let Record { planes, motors, .. } = record(&prepared)?;
    let (trajectories, rows): (Vec<_>, Vec<_>) = planes
        .into_iter()
        .map(|recording| (recording.trajectory, recording.log))
        .unzip();
    let motors = motors.unwrap_or_else(|| prepared.motors_of_planes(&trajectories));
    write(&folder, &prepared, &trajectories, &motors)?;
    write_logs(&logs, &rows)?;

    let metrics: Vec<Metrics> = prepared
        .planes
        .iter()
        .zip(&trajectories)
        .map(|(plane, run)| Metrics::new(&prepared, plane, run))
        .collect();
    let summary = summary(&prepared, &metrics, folder.path()) + &readings(&rows);
    let document = json!({
        "title": prepared.title,
        "samples": prepared.samples,
        "t_s": prepared.settings.t_s,
        // All sums, means and largest values are over this time, from 0 s on.
        "window_s": prepared.end(),
        "planes": metrics,
        "folder": json::path(folder.path()),
    });
    let runs = match trajectories.len() {
        1 => ["run", ""],
        _ => ["run of the x plane", "run of the y plane"],
    };
    let shared = prepared.motors.is_some();
    let mut early = runs
        .into_iter()
        .zip(&trajectories)
        .zip(&prepared.planes)
        .filter(|((_, run), _)| run.termination != Termination::Complete);
    // Planes that share their motors end together; where one left its range, that is the one to tell of.
    let fell = early
        .clone()
        .find(|((_, run), plane)| !plane.world.range.contains(&run.final_state, 0.0));
    let early = match (shared, fell) {
        (true, None) => early.next().map(|((_, run), _)| ("run", run)),
        (true, Some((of_plane, _))) => Some(of_plane),
        (false, _) => early.next().map(|(of_plane, _)| of_plane),
    };
    let log = rows
        .first()
        .filter(|_| arguments.logs_to_standard_output())
        .map(|log| recorded::log_csv(log));
    match early {
        None => Ok(Simulated {
            prepared,
            trajectories,
            summary,
            document,
            log,
        }),
        Some((what, run)) => {
            // What was recorded is kept, wherever it goes to. That the run ended early is an error however this ends.
            let _ = log.map(|log| output::print(&log));
            Err(CommandError::EndedEarly {
                what,
                termination: words::termination(&run.termination),
                state: run.final_state.into(),
                folder: folder.path().to_owned(),
            })
        }
    }
}

/// Tells of pushes and set points that the run ends before.
fn tell_too_late(arguments: &SimulateArguments, prepared: &Prepared) -> Result<(), CommandError> {
    let (scenario, _) = arguments.options.load(&arguments.scenario)?;
    let end = recorded::time(prepared.end());
    for (key, time) in scenario.too_late(prepared) {
        let time = recorded::time(time);
        output::warn(&format!(
            "{key} = {time}: the run ends at {end} s and does not come to it"
        ));
    }
    Ok(())
}

/// Runs a scenario with a progress bar.
///
/// # Errors
/// The controller refuses its settings.
pub fn record(prepared: &Prepared) -> Result<Record, CommandError> {
    let progress = Progress::new("simulating", prepared.total_samples());
    let start = Instant::now();
    let hooks = RunHooks {
        clock: &|| start.elapsed(),
        progress: &|done| progress.set(done),
    };
    Ok(prepared.record(&hooks)?)
}

/// What was wrong with the readings of each plane, in a line each.
fn readings(logs: &[Vec<LogRow<4, 1>>]) -> String {
    let planes = match logs.len() {
        1 => ["", ""],
        _ => [" of the x plane", " of the y plane"],
    };
    let lines = planes.iter().zip(logs).map(|(plane, log)| {
        let seen = log.iter().map(|row| (row.t, row.observation));
        (plane, words::readings(seen))
    });
    lines
        .filter(|(_, told)| !told.is_empty())
        .map(|(plane, told)| format!("readings{plane}: {told}\n"))
        .collect()
}

impl SimulateArguments {
    /// Whether the log is what is printed.
    pub fn logs_to_standard_output(&self) -> bool {
        self.log.as_deref() == Some(Path::new("-"))
    }
}

/// Standard output takes one text.
fn check_alone(json: bool, planes: usize) -> Result<(), CommandError> {
    let other = match (json, planes) {
        (true, _) => "--json goes there, too",
        (_, 2) => "there are two logs, one per plane",
        _ => return Ok(()),
    };
    Err(CommandError::Usage(format!(
        "--log - does not go: {other}. Name a file"
    )))
}

/// The files of the planes' logs.
fn log_paths(path: &Path, planes: usize) -> Vec<PathBuf> {
    match planes {
        1 => vec![path.to_owned()],
        _ => ["x", "y"].map(|plane| with_suffix(path, plane)).to_vec(),
    }
}

/// Writes one log per plane to each of the paths.
fn write_logs(paths: &[PathBuf], logs: &[Vec<LogRow<4, 1>>]) -> Result<(), FileError> {
    let texts: Vec<String> = logs.iter().map(|log| recorded::log_csv(log)).collect();
    let files: Vec<(&Path, &[u8])> = paths
        .iter()
        .zip(&texts)
        .map(|(path, text)| (path.as_path(), text.as_bytes()))
        .collect();
    output::write_files(&files)
}

/// `log.csv` and `x` make `log-x.csv`.
fn with_suffix(path: &Path, suffix: &str) -> PathBuf {
    let mut name = path.file_stem().unwrap_or_default().to_owned();
    name.push("-");
    name.push(suffix);
    if let Some(extension) = path.extension() {
        name.push(".");
        name.push(extension);
    }
    path.with_file_name(name)
}

/// The names of the planes' files.
fn file_names(planes: usize) -> &'static [&'static str] {
    match planes {
        1 => &["trajectory.csv"],
        _ => &["trajectory_x.csv", "trajectory_y.csv"],
    }
}

/// Writes trajectories and figures of a record, as [`run`] does.
///
/// # Errors
/// A file cannot be written.
pub(super) fn write_record(
    folder: &ResultFolder,
    prepared: &Prepared,
    record: &Record,
) -> Result<(), CommandError> {
    let planes = record.planes.iter();
    let trajectories: Vec<_> = planes.map(|plane| plane.trajectory.clone()).collect();
    let motors = record.motors.clone();
    let motors = motors.unwrap_or_else(|| prepared.motors_of_planes(&trajectories));
    write(folder, prepared, &trajectories, &motors)
}

fn write(
    folder: &ResultFolder,
    prepared: &Prepared,
    trajectories: &[Trajectory<4, 1>],
    motors: &[MotorSample],
) -> Result<(), CommandError> {
    let mut files: Vec<(String, Vec<u8>)> = file_names(trajectories.len())
        .iter()
        .zip(trajectories)
        .map(|(name, run)| {
            let text = recorded::trajectory_csv(run);
            ((*name).to_owned(), text.into_bytes())
        })
        .collect();
    if trajectories.len() == 2 {
        let text = recorded::motors_csv(motors);
        files.push(("motors.csv".to_owned(), text.into_bytes()));
    }
    for (name, figure) in figures(prepared, trajectories, motors) {
        // What happened is worth keeping without its picture.
        match figure.files(name) {
            Ok(pair) => files.extend(pair),
            Err(error) => output::warn(&format!("{name} could not be drawn: {error}")),
        }
    }
    Ok(folder.write(&files, &RESULTS)?)
}

/// All files that a run can leave in its folder.
pub(super) const RESULTS: [&str; 16] = [
    "trajectory.csv",
    "trajectory_x.csv",
    "trajectory_y.csv",
    "motors.csv",
    "figure.svg",
    "figure.png",
    "path.svg",
    "path.png",
    "motors.svg",
    "motors.png",
    "plans.svg",
    "plans.png",
    "plans_x.svg",
    "plans_x.png",
    "plans_y.svg",
    "plans_y.png",
];

/// The figures with their names; none when a plane has no sample to draw.
fn figures(
    prepared: &Prepared,
    trajectories: &[Trajectory<4, 1>],
    motors: &[MotorSample],
) -> Vec<(&'static str, Figure)> {
    if trajectories.iter().any(|run| run.samples.is_empty()) {
        return Vec::new();
    }
    let title = &prepared.title;
    let columns: Vec<Columns> = trajectories.iter().map(Columns::from).collect();
    let shown = |columns| Shown {
        label: "ballbot",
        role: Role::Lpv,
        columns,
    };
    match columns.as_slice() {
        [x, y] => {
            let torques: Vec<_> = motors.iter().map(|sample| sample.torques).collect();
            let planes = [shown(x), shown(y)];
            let mut figures = vec![
                ("figure", run_figures::both_planes(title, prepared, planes)),
                ("path", run_figures::path(title, prepared, [x, y])),
                (
                    "motors",
                    run_figures::motors("Motor torques", prepared, x, &torques),
                ),
            ];
            let plans = [
                ("plans_x", run_figures::plans("Plans of the x plane", x)),
                ("plans_y", run_figures::plans("Plans of the y plane", y)),
            ];
            let shown = plans
                .into_iter()
                .filter_map(|(name, plan)| Some((name, plan?)));
            figures.extend(shown);
            figures
        }
        runs => {
            let shown: Vec<Shown<'_>> = runs.iter().map(shown).collect();
            let mut figures = vec![("figure", run_figures::one_plane(title, prepared, &shown))];
            let plans = columns
                .first()
                .and_then(|run| run_figures::plans("Plans", run));
            figures.extend(plans.map(|plans| ("plans", plans)));
            figures
        }
    }
}

/// Where a plane's shaped reference was still on its way, a line each: the robot follows it, and is not there.
fn unreached(prepared: &Prepared, metrics: &[Metrics]) -> String {
    let planes = match metrics.len() {
        1 => ["", ""],
        _ => [" of the x plane", " of the y plane"],
    };
    let lines = planes.iter().zip(metrics).filter_map(|(plane, metrics)| {
        let set_point = metrics.unreached_set_point_rad?;
        Some(format!(
            "the set point{plane} of {set_point:.4} rad is not reached by the end of the run: the shaped reference ends at \
             {:.4} rad; lengthen duration_s ({} s), or allow more in [controller.shaping]\n",
            metrics.final_reference_rad,
            recorded::time(prepared.end())
        ))
    });
    lines.collect()
}

fn summary(prepared: &Prepared, metrics: &[Metrics], folder: &Path) -> String {
    let planes: &[&str] = if metrics.len() == 1 {
        &["value"]
    } else {
        &["x plane", "y plane"]
    };
    let mut table = Table::new(std::iter::once("").chain(planes.iter().copied()));
    let lines: Vec<_> = metrics.iter().map(Metrics::lines).collect();
    for row in 0..lines.first().map_or(0, |lines| lines.len()) {
        let cells = lines.iter().map(|lines| lines[row].1.clone());
        table.row(std::iter::once(lines[0][row].0.to_owned()).chain(cells));
    }
    let certificate = prepared.certificate.map_or(String::new(), |standing| {
        format!("terminal certificate: {standing}\n")
    });
    format!(
        "{}: {} samples of {} s; costs, rms and largest values from 0 s to {} s\n\
         {table}{}{certificate}written to {}\n",
        prepared.title,
        prepared.samples,
        prepared.settings.t_s,
        recorded::time(prepared.end()),
        unreached(prepared, metrics),
        folder.display()
    )
}
