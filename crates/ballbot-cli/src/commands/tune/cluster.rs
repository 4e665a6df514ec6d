//! Closed loops of a tuning on a cluster: each batch is an array of tasks, which read it from a file
//! that all machines see and write what became of their parts beside it.

use super::Own;
use crate::commands::CommandError;
use crate::commands::hyperqueue::{HyperQueue, Tasks, on_command_line};
use crate::input::read_text;
use crate::output;
use ballbot_campaign::{MOST_SHARDS, Shard};
use ballbot_tuning::{Batch, Tried, TuningError, digest};
use clap::Args;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// From one look at the parts to the next: a batch is short.
const PAUSE: Duration = Duration::from_millis(20);

/// Arguments of `ballbot tune part`.
#[derive(Debug, Args)]
pub struct PartArguments {
    /// The tuning's TOML file
    pub file: PathBuf,
    /// The batch: a file in the folder `batches` of the results
    pub batch: PathBuf,
    /// Which part of it
    #[arg(long, value_name = "I/N")]
    pub shard: Shard,
    /// Threads [default: one per core]; the numbers do not depend on them
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
}

/// Runs a part of a batch, if that was not done, and writes what became of it beside it.
pub(super) fn run_part(
    tuning: &Own<'_>,
    path: &Path,
    shard: Shard,
) -> Result<String, CommandError> {
    let to = part_path(path, shard);
    if !to.exists() {
        let batch = read_text(path)?;
        let text = tuning.run_part(&batch, shard).map_err(named(path))?;
        output::write_files(&[(&to, text.as_bytes())])?;
    }
    Ok(format!("{}\n", to.display()))
}

/// Where a part of the batch at `path` is.
fn part_path(path: &Path, shard: Shard) -> PathBuf {
    let name = format!("-{:05}-of-{:05}.json", shard.index(), shard.of());
    let mut stem = path.with_extension("").into_os_string();
    stem.push(name);
    stem.into()
}

/// An error about a file of a batch.
fn named(path: &Path) -> impl Fn(TuningError) -> CommandError {
    move |error| match error {
        TuningError::Batch(problem) => {
            CommandError::Cluster(format!("{}: {problem}", path.display()))
        }
        error => error.into(),
    }
}

/// A cluster that runs batches.
pub(super) struct BatchRunner<'a> {
    tuning: &'a Own<'a>,
    hq: HyperQueue,
    /// Tasks of a batch, at most.
    shards: u32,
    threads: u16,
    folder: PathBuf,
    /// What this machine makes of the start.
    machine: String,
}

impl<'a> BatchRunner<'a> {
    /// A cluster whose server runs; batches go into a folder below `out`.
    pub fn new(
        tuning: &'a Own<'a>,
        (shards, threads): (u32, u16),
        server_dir: Option<&Path>,
        out: &Path,
    ) -> Result<Self, CommandError> {
        Ok(Self {
            hq: HyperQueue::new(server_dir)?,
            machine: tuning.machine()?,
            folder: out.join("batches"),
            tuning,
            shards,
            threads,
        })
    }

    /// Has a batch run. Parts that are there from an earlier call are not run again.
    pub fn run(&self, batch: &Batch) -> Result<Vec<Tried>, CommandError> {
        let text = self.tuning.batch_text(batch);
        let digest = digest(&text);
        let path = self.folder.join(format!("batch-{digest}.json"));
        let of = self.shards.min(batch.loops.len() as u32).max(1);
        let missing = || {
            let parts = Shard::all(of).filter(|shard| !part_path(&path, *shard).exists());
            parts.map(Shard::index).collect::<Vec<u32>>()
        };
        let to_run = missing();
        if !to_run.is_empty() {
            output::write_files(&[(&path, text.as_bytes())])?;
            let file = on_command_line(self.tuning.source().path())?;
            let tasks = Tasks {
                name: format!("ballbot-{digest}-{of}"),
                numbers: &to_run,
                of,
                threads: self.threads,
                arguments: ["tune", "part", &file, &on_command_line(&path)?]
                    .map(str::to_owned)
                    .to_vec(),
                folder: &self.folder,
            };
            self.hq.run(&tasks, PAUSE, &mut || missing().is_empty())?;
        }
        let mut all = Vec::with_capacity(batch.loops.len());
        for shard in Shard::all(of) {
            let part = part_path(&path, shard);
            if !part.exists() {
                return Err(CommandError::Cluster(format!(
                    "the cluster's tasks are done, and {} is not there: do its workers see this folder?",
                    part.display()
                )));
            }
            let read = self
                .tuning
                .read_part(&text, shard, &read_text(&part)?, &self.machine);
            all.extend(read.map_err(named(&part))?);
        }
        self.hq.forget(&self.folder);
        self.sweep();
        Ok(all)
    }

    /// Removes what is of no batch that is still wanted: the search never asks for one twice.
    fn sweep(&self) {
        for entry in fs::read_dir(&self.folder).into_iter().flatten().flatten() {
            let name = entry.file_name();
            let name = name.to_string_lossy();
            let ours = ["batch-", "task-"]
                .iter()
                .any(|start| name.starts_with(start));
            if ours {
                // One that stays harms nobody.
                let _ = fs::remove_file(entry.path());
            }
        }
        // Empty, it goes; with a user's file in it, it stays.
        let _ = fs::remove_dir(&self.folder);
    }
}

/// Tasks of a batch, at most.
pub(super) const MOST_TASKS: u32 = MOST_SHARDS;
