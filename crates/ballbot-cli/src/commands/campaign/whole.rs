//! A whole campaign on this machine.

use super::{CampaignArguments, Own, report, room};
use crate::commands::CommandError;
use crate::output::{Draft, FileError};
use crate::progress::Progress;
use crate::results::ResultFolder;
use ballbot_campaign::{Row, RowWriter};
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

/// The files of all runs.
pub(super) const PARQUET: &str = "runs.parquet";
pub(super) const CSV: &str = "runs.csv";

/// Threads for the runs; one per core without a number.
pub(super) fn pool(arguments: &CampaignArguments) -> Result<ThreadPool, CommandError> {
    let threads = usize::from(arguments.threads.unwrap_or(0));
    let pool = ThreadPoolBuilder::new().num_threads(threads).build();
    Ok(pool.map_err(ballbot_campaign::CampaignError::from)?)
}

/// Counts runs on a bar, from any thread.
pub(super) fn counted(progress: &Progress) -> impl Fn() + Sync + '_ {
    let done = AtomicUsize::new(0);
    move || progress.set(done.fetch_add(1, Ordering::Relaxed) + 1)
}

/// Runs all runs, or as many as are needed, and writes their results.
pub(super) fn run(
    campaign: &Own<'_>,
    out: &Path,
    arguments: &CampaignArguments,
) -> Result<String, CommandError> {
    let pool = pool(arguments)?;
    if let Some(rare) = campaign.source().file().rare {
        return report::rare(campaign, &rare, &pool, (out, arguments.json));
    }
    let results = ResultFolder::open(crate::PROGRAM, out, &report::RESULTS)?;
    room::check(
        campaign.runs(),
        &campaign.columns(),
        true,
        (out, arguments.yes),
    )?;
    let rows = RowFiles::create(out)?;
    let progress = Progress::new("running", campaign.runs() as usize);
    let start = Instant::now();
    let mut writer = rows.writer(campaign)?;
    let (_, known) = pool.install(|| {
        campaign.run_all(&|| start.elapsed(), &counted(&progress), |row| {
            writer.push(row)
        })
    })?;
    writer.finish()?;
    drop(progress);
    pool.install(|| report::all(campaign, rows, &results, (known, arguments.json)))
}

/// The files of all rows, on their way.
pub(super) struct RowFiles {
    pub parquet: Draft,
    pub csv: Draft,
}

impl RowFiles {
    pub fn create(out: &Path) -> Result<Self, CommandError> {
        Ok(Self {
            parquet: Draft::create(&out.join(PARQUET))?,
            csv: Draft::create(&out.join(CSV))?,
        })
    }

    pub fn writer(&self, campaign: &Own<'_>) -> Result<RowsWriter<'_>, CommandError> {
        let mut csv = csv::Writer::from_writer(BufWriter::new(self.csv.file()));
        let columns = campaign.columns();
        let names = columns.iter().map(|column| column.name.as_str());
        csv.write_record(names)
            .map_err(|error| self.csv_error(error))?;
        let parquet = campaign.writer(self.parquet.file(), self.parquet.temporary())?;
        Ok(RowsWriter {
            files: self,
            parquet,
            csv,
        })
    }

    fn parquet_error(&self, error: &dyn std::fmt::Display) -> CommandError {
        FileError::at(self.parquet.temporary())(std::io::Error::other(error.to_string())).into()
    }

    fn csv_error(&self, error: impl Into<csv::Error>) -> CommandError {
        FileError::at(self.csv.temporary())(std::io::Error::other(error.into())).into()
    }
}

/// Writes each row into both files.
pub(super) struct RowsWriter<'a> {
    files: &'a RowFiles,
    parquet: RowWriter<&'a File>,
    csv: csv::Writer<BufWriter<&'a File>>,
}

impl RowsWriter<'_> {
    pub fn push(&mut self, row: Row) -> Result<(), CommandError> {
        let cells = row.iter().map(ballbot_campaign::Cell::text);
        self.csv
            .write_record(cells)
            .map_err(|error| self.files.csv_error(error))?;
        self.parquet
            .push(row)
            .map_err(|error| self.files.parquet_error(&error))
    }

    pub fn finish(mut self) -> Result<u64, CommandError> {
        self.csv
            .flush()
            .map_err(|error| self.files.csv_error(error))?;
        self.parquet
            .finish()
            .map_err(|error| self.files.parquet_error(&error))
    }
}
