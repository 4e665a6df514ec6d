//! `ballbot campaign replay`.

use crate::commands::{CommandError, simulate};
use crate::json;
use crate::progress::ProofProgress;
use crate::results::ResultFolder;
use crate::table::Table;
use ballbot_campaign::{Campaign, Cell, Source};
use ballbot_scenario::proofs::ProvedFiles;
use clap::Args;
use serde_json::{Map, Value, json};
use std::path::PathBuf;
use std::time::Instant;

/// Arguments of `ballbot campaign replay`.
#[derive(Debug, Args)]
pub struct ReplayArguments {
    /// The campaign
    pub file: PathBuf,
    /// Number of the run, as in its row
    #[arg(long)]
    pub run: u64,
    /// Folder for the results [default: out/NAME of the file/run-RUN]
    #[arg(short, long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// Runs one run again, and writes what `ballbot simulate` writes.
pub(super) fn run(arguments: &ReplayArguments) -> Result<String, CommandError> {
    let source = Source::load(&arguments.file)?;
    let proof = ProofProgress::default();
    let files = ProvedFiles {
        folder: source.folder(),
        progress: &|done| proof.set_part(done),
    };
    let campaign = Campaign::new(&source, files, &crate::program::name()?)?;
    let out = arguments.out.clone();
    let out = out
        .unwrap_or_else(|| super::folder(&arguments.file).join(format!("run-{}", arguments.run)));
    let folder = ResultFolder::open(crate::PROGRAM, &out, &simulate::RESULTS)?;
    let start = Instant::now();
    let replay = campaign.replay(arguments.run, &|| start.elapsed())?;
    simulate::write_record(&folder, &replay.prepared, &replay.record)?;
    let columns = campaign.columns();
    let cells = columns.iter().zip(&replay.row);
    if arguments.json {
        let cells = cells.map(|(column, cell)| (column.name.clone(), value(cell)));
        let mut document: Map<String, Value> = cells.collect();
        document.insert("folder".to_owned(), json::path(&out));
        return Ok(json::text(&Value::Object(document)));
    }
    let mut table = Table::new(["", "value"]);
    for (column, cell) in cells {
        table.row([column.name.clone(), cell.text()]);
    }
    Ok(format!(
        "{}\n{table}written to {}\n",
        campaign.source().file().title,
        out.display()
    ))
}

/// A cell in JSON.
fn value(cell: &Cell) -> Value {
    match cell {
        Cell::Missing => Value::Null,
        Cell::Real(number) => json!(number),
        Cell::Whole(number) => json!(number),
        Cell::Text(text) => json!(text),
        Cell::Flag(flag) => json!(flag),
    }
}
