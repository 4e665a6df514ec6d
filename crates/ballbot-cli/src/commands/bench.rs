//! `ballbot bench`.

use super::CommandError;
use super::robot::ScenarioOptions;
use crate::json;
use crate::output;
use crate::progress::Progress;
use crate::table::Table;
use ballbot_studies::timing::{
    self, GuaranteedTimes, PROBLEMS, SEQUENCES, SequenceTimes, Stopwatch, Times,
};
use clap::Args;
use clap::builder::RangedU64ValueParser;
use serde_json::json;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Arguments of `ballbot bench`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  ballbot bench
  ballbot bench my.toml --parameters out/identification/parameters.toml
  ballbot bench --json times.json

Times the quadratic program alone (QP) and the controller's whole step on this machine, along closed
loops of the built-in scenarios; the quadratic program alone on sequences of larger problems, longer
horizons and many active bounds; and the guaranteed step against the plain one. Each sample is
repeated and its shortest time counts, so that all it needs is in the cache. What is called `cold` is
after a sweep of 48 MB, as when other work runs between two samples. A scenario of one's own must be
one without a guarantee and without [controller.torque_rate].")]
pub struct BenchArguments {
    /// A built-in scenario or a TOML file [default: four of the built-in ones, and problems of other sizes]
    pub scenario: Option<String>,
    /// What it is changed by.
    #[command(flatten)]
    pub options: ScenarioOptions,
    /// How often each sample is repeated, 1 to 100000 times; less is quicker, and other work disturbs more
    #[arg(long, value_name = "COUNT", default_value_t = Stopwatch::PASSES, value_parser = RangedU64ValueParser::<usize>::new().range(1..=100_000))]
    pub passes: usize,
    /// Also write the times to this file as JSON; - for standard output, in place of the table
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
}

/// Times all sequences.
///
/// # Errors
/// A scenario cannot be run, or the file cannot be written.
pub fn run(arguments: &BenchArguments) -> Result<String, CommandError> {
    let (names, problems) = match &arguments.scenario {
        Some(name) => (vec![name.as_str()], Vec::new()),
        None => (SEQUENCES.to_vec(), PROBLEMS.to_vec()),
    };
    let file = arguments.json.as_deref();
    let file = file.filter(|path| *path != Path::new("-"));
    if let Some(path) = file {
        let read = names.iter().map(|name| arguments.options.files(name));
        let read: Vec<_> = read.collect::<Result<_, _>>()?;
        output::check_separate(path, read.iter().flatten().map(PathBuf::as_path))?;
    }
    let start = Instant::now();
    let clock = || start.elapsed();
    let watch = Stopwatch {
        clock: &clock,
        passes: arguments.passes,
    };
    let count = names.len() + problems.len();
    let progress = Progress::new("timing", count + 1);
    let mut sequences: Vec<SequenceTimes> = Vec::with_capacity(count);
    for name in names {
        let prepared = arguments.options.prepare(name)?;
        sequences.push(timing::time(name, &prepared, watch)?);
        progress.set(sequences.len());
    }
    for name in problems {
        sequences.push(timing::time_problems(name, watch)?);
        progress.set(sequences.len());
    }
    let guaranteed = timing::time_guaranteed(watch)?;
    progress.set(sequences.len() + 1);
    let document = json::text(&json!({ "sequences": sequences, "guarded": guaranteed }));
    match file {
        Some(path) => output::write_files(&[(path, document.as_bytes())])?,
        None if arguments.json.is_some() => return Ok(document),
        None => {}
    }
    let mut table = Table::new([
        "times in us",
        "QP median",
        "p99",
        "max",
        "cold median",
        "max",
        "step median",
        "p99",
        "max",
        "cold median",
        "max",
        "active bounds",
    ]);
    for sequence in &sequences {
        let cells = |times: Times| [times.median, times.p99, times.max].map(|t| format!("{t:.2}"));
        let mut row = vec![sequence.name.clone()];
        for (warm, cold) in [
            (sequence.qp_us, sequence.qp_cold_us),
            (sequence.step_us, sequence.step_cold_us),
        ] {
            row.extend(cells(warm));
            let [median, _, max] = cells(cold);
            row.extend([median, max]);
        }
        row.push(sequence.max_active.to_string());
        table.row(row);
    }
    Ok(format!("{table}\n{}", guaranteed_table(&guaranteed)))
}

fn guaranteed_table(times: &GuaranteedTimes) -> Table {
    let mut table = Table::new(["far-setpoints, step in us", "median", "p99", "max"]);
    let rows = [
        ("plain, the same predictor, one program", times.plain_us),
        ("plain, descent", times.descent_us),
        ("plain, descent: feedback", times.feedback_us),
        ("plain, descent: feedback, cold", times.feedback_cold_us),
        ("plain, descent, 2.5 m at once", times.far_descent_us),
        ("guaranteed", times.guaranteed_us),
    ];
    for (name, times) in rows {
        let cells = [times.median, times.p99, times.max].map(|t| format!("{t:.2}"));
        table.row([vec![name.to_owned()], cells.to_vec()].concat());
    }
    table
}
