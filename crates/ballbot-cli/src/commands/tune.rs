//! `ballbot tune`.

mod cluster;
mod journal_file;
mod moved;
mod report;

use super::CommandError;
use super::hyperqueue::ClusterOptions;
use crate::progress::{Progress, ProofProgress};
use crate::results::ResultFolder;
use ballbot_campaign::CampaignError;
use ballbot_scenario::proofs::ProvedFiles;
use ballbot_tuning::{Batch, Found, Hooks, Ran, State, Tuning, TuningSource};
use clap::{Args, Subcommand};
use cluster::{BatchRunner, MOST_TASKS, PartArguments};
use journal_file::JournalFile;
use rayon::ThreadPoolBuilder;
use std::path::{Path, PathBuf};

/// Arguments of `ballbot tune`.
#[derive(Debug, Args)]
#[command(
    args_conflicts_with_subcommands = true,
    after_help = "\
Examples:
  ballbot tune example > my-tuning.toml      a commented tuning, to be changed
  ballbot tune my-tuning.toml                searches; results in out/my-tuning
  ballbot tune my-tuning.toml                after an interrupt: goes on where it was
  ballbot tune my-tuning.toml --candidate 71 with another one, of the Pareto front
  ballbot tune my-tuning.toml --shards 16 --cluster hyperqueue    on a cluster

Searches over keys of a scenario (weights, horizon, sampling time, drifts of the estimator) for goals
and within limits that are measured in the same worlds for every candidate: docs/tuning.md. Writes
tuned.toml, a scenario with what was found; report.html, with before and after in worlds that the
search has not seen; candidates.csv, summary.json and figures. The same file gives the same result on
any number of threads and machines, interrupted or not."
)]
pub struct TuneArguments {
    /// What to do; searches when absent.
    #[command(subcommand)]
    pub action: Option<TuneAction>,
    /// A tuning's TOML file
    #[arg(required = true)]
    pub file: Option<PathBuf>,
    /// Take this candidate instead of the best one under equal weights of the goals
    #[arg(long, value_name = "NUMBER")]
    pub candidate: Option<usize>,
    /// Divide what is run at once into so many tasks of the cluster
    #[arg(long, value_name = "N", requires = "cluster",
        value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST_TASKS)))]
    pub shards: Option<u32>,
    /// Where the parts are run.
    #[command(flatten)]
    pub cluster: ClusterOptions,
    /// Threads [default: one per core; of a cluster's task, one]; the numbers do not depend on them
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Folder for the results [default: out/NAME of the file]
    #[arg(short, long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// What else there is to do.
#[derive(Debug, Subcommand)]
pub enum TuneAction {
    /// Print a commented tuning, to be changed
    Example,
    /// Run a part of a batch of closed loops: what a cluster's tasks do
    Part(PartArguments),
}

/// A commented tuning.
const EXAMPLE: &str = include_str!("../../../../docs/examples/tuning/paper.toml");

/// A tuning with the files of its scenario.
type Own<'a> = Tuning<'a, ProvedFiles<'a>>;

/// What the worlds that the search has not seen say, of the start and of the result.
struct HeldOut {
    before: Vec<Ran>,
    after: Vec<Ran>,
}

/// Searches, and writes what was found.
///
/// # Errors
/// A value makes no sense, the journal is of another tuning, no candidate keeps all limits, or a file
/// cannot be written.
pub fn run(arguments: &TuneArguments) -> Result<String, CommandError> {
    let (path, threads) = match (&arguments.action, &arguments.file) {
        (Some(TuneAction::Part(part)), _) => (&part.file, part.threads),
        (None, Some(path)) => (path, arguments.threads),
        (Some(TuneAction::Example), _) | (None, None) => return Ok(EXAMPLE.to_owned()),
    };
    let source = TuningSource::load(path)?;
    let proof = ProofProgress::default();
    let files = ProvedFiles {
        folder: source.folder(),
        progress: &|done| proof.set_part(done),
    };
    let tuning = Tuning::new(&source, files, &crate::program::name()?)?;
    let threads = usize::from(threads.unwrap_or(0));
    let pool = ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = pool.map_err(CampaignError::from)?;
    pool.install(|| match &arguments.action {
        Some(TuneAction::Part(part)) => cluster::run_part(&tuning, &part.batch, part.shard),
        _ => tune(&tuning, path, arguments),
    })
}

fn tune(tuning: &Own<'_>, path: &Path, arguments: &TuneArguments) -> Result<String, CommandError> {
    // Found out now rather than after the search.
    tuning.document(tuning.start())?;
    let out = arguments.out.clone().unwrap_or_else(|| folder(path));
    let results = ResultFolder::open(crate::PROGRAM, &out, &report::RESULTS)?;
    let (file, journal) = JournalFile::open(&out, tuning.fingerprint())?;
    let cluster = match arguments.shards {
        Some(shards) => {
            let size = (shards, arguments.threads.unwrap_or(1));
            let server_dir = arguments.cluster.server_dir.as_deref();
            Some(BatchRunner::new(tuning, size, server_dir, &out)?)
        }
        None => None,
    };
    let mut run = |batch: &Batch| match &cluster {
        Some(cluster) => cluster.run(batch),
        None => Ok(tuning.run(batch)?),
    };
    let before = tuning.held_out(tuning.start(), &mut run)?;
    let most = tuning.source().file().search.evaluations;
    let progress = Progress::new("searching", most as usize);
    let hooks = Hooks {
        run: &mut run,
        append: &mut |text| file.append(text),
        progress: &|done| progress.set(done as usize),
    };
    let mut found = tuning.search::<CommandError>(journal, hooks)?;
    drop(progress);
    choose(tuning, &mut found, arguments.candidate)?;
    let values = tuning.values(&found.candidates[found.chosen]);
    let after = match found.chosen {
        0 => before.clone(),
        _ => tuning.held_out(&values, &mut run)?,
    };
    let held_out = HeldOut { before, after };
    report::write(tuning, &found, &held_out, &results, arguments.json)
}

/// Takes the candidate that is asked for.
fn choose(
    tuning: &Own<'_>,
    found: &mut Found,
    candidate: Option<usize>,
) -> Result<(), CommandError> {
    let Some(wanted) = candidate else {
        return Ok(());
    };
    let refused = |problem: &str| {
        let front = found
            .front
            .iter()
            .map(usize::to_string)
            .collect::<Vec<_>>()
            .join(", ");
        Err(CommandError::Usage(format!(
            "--candidate {wanted}: {problem}; those of the Pareto front are {front}"
        )))
    };
    match found.candidates.get(wanted) {
        None => refused(&format!(
            "there are the candidates 0 to {}",
            found.candidates.len() - 1
        )),
        Some(entry) if entry.state != State::Whole => refused("it was not run in all worlds"),
        Some(entry) if found.outcomes[wanted].violation > 0.0 => {
            let words = tuning.judge().words(&entry.judged());
            refused(&format!("it does not keep all limits: {words}"))
        }
        Some(_) => {
            found.chosen = wanted;
            Ok(())
        }
    }
}

/// Where the results of a tuning go when nothing else is said.
fn folder(tuning: &Path) -> PathBuf {
    Path::new("out").join(tuning.file_stem().unwrap_or(tuning.as_os_str()))
}
