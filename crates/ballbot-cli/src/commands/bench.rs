//! `ballbot bench`.

use super::CommandError;
use crate::benchmark::{self, SEQUENCES, SequenceTimes, Times};
use crate::output;
use crate::progress::Progress;
use crate::table::Table;
use clap::Args;
use serde_json::json;
use std::path::PathBuf;

/// Arguments of `ballbot bench`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  ballbot bench
  ballbot bench --json times.json

Times the quadratic program alone and the controller's whole step on this machine, along closed
loops of the built-in scenarios. Each sample is repeated and its shortest time counts.")]
pub struct BenchArguments {
    /// Write the times to this file as JSON, too
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
}

/// Times all sequences.
///
/// # Errors
/// The file cannot be written.
pub fn run(arguments: &BenchArguments) -> Result<String, CommandError> {
    let progress = Progress::new("timing", SEQUENCES.len());
    let mut sequences: Vec<SequenceTimes> = Vec::with_capacity(SEQUENCES.len());
    for name in SEQUENCES {
        sequences.push(benchmark::time(name)?);
        progress.set(sequences.len());
    }
    if let Some(path) = &arguments.json {
        let document = format!("{:#}\n", json!({ "sequences": sequences }));
        output::write_files(&[(path, document.as_bytes())])?;
    }
    let mut table = Table::new([
        "times in us",
        "QP median",
        "p99",
        "max",
        "step median",
        "p99",
        "max",
        "active bounds",
    ]);
    for sequence in &sequences {
        let cells = |times: Times| [times.median, times.p99, times.max].map(|t| format!("{t:.2}"));
        let mut row = vec![sequence.name.to_owned()];
        row.extend(cells(sequence.qp_us));
        row.extend(cells(sequence.step_us));
        row.push(sequence.max_active.to_string());
        table.row(row);
    }
    Ok(table.to_string())
}
