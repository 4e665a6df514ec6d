//! `ballbot campaign`.

mod cluster;
mod guarantee;
mod replay;
mod report;
mod room;
mod shards;
mod whole;

use super::CommandError;
use super::hyperqueue::{Cluster, ClusterOptions};
use super::robot::ScenarioOptions;
use crate::input;
use crate::progress::ProofProgress;
use ballbot_campaign::{Campaign, MOST_SHARDS, Shard, Source};
use ballbot_scenario::proofs::ProvedFiles;
use clap::{Args, Subcommand};
use std::path::{Path, PathBuf};

/// Arguments of `ballbot campaign`.
#[derive(Debug, Args)]
#[command(
    args_conflicts_with_subcommands = true,
    after_help = "\
Examples:
  ballbot campaign                             10 000 closed loops, and 500 of each variant
  ballbot campaign --runs 200 --samples 60     a quick look
  ballbot campaign my.toml                     a loop of your own, certified by `ballbot certify`
  ballbot campaign example > my-campaign.toml  a campaign of your own: what varies, what is measured
  ballbot campaign my-campaign.toml            runs it
  ballbot campaign my-campaign.toml --shards 16 --cluster hyperqueue    on a cluster
  ballbot campaign replay my-campaign.toml --run 17      one of its runs, with a figure

A file with the key `scenario` is a campaign of your own: docs/campaigns.md. It writes runs.parquet,
runs.csv (one row per run), summary.json and figures; the same file gives the same rows on any number
of threads, shards and machines.

Without one, or with a scenario, the built-in campaign runs: each loop starts at random in the
certified set and gets random set points, up to 100 rad away, at random times. On the nominal plant,
integrated to 1e-12, the first columns must count nothing, whatever the set points and the horizon;
the exit code is 1 if they do. The other variants show where the guarantee ends: pushes, wrong
parameters, torque noise, delay; the paper's scheme is the negative control. The same seed gives the
same numbers on any number of threads. Writes campaign.csv (one row per run) and a figure."
)]
pub struct CampaignArguments {
    /// What to do with a campaign of your own; runs it when absent.
    #[command(subcommand)]
    pub action: Option<CampaignAction>,
    /// A campaign's TOML file; or, for the built-in campaign, a scenario with a certified terminal set
    #[arg(default_value = "far-setpoints")]
    pub file: String,
    /// What the built-in campaign's scenario is changed by.
    #[command(flatten)]
    pub options: ScenarioOptions,
    /// Built-in campaign: closed loops of the nominal plant [default: 10000]; every other variant has
    /// a twentieth of them
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub runs: Option<u32>,
    /// Built-in campaign: samples of each closed loop [default: 100]
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub samples: Option<u32>,
    /// Built-in campaign: seed of everything random [default: 1]
    #[arg(long)]
    pub seed: Option<u64>,
    /// Run only part I of N, into DIR/shards; to the bit what the whole campaign has
    #[arg(long, value_name = "I/N", conflicts_with_all = ["shards", "cluster"])]
    pub shard: Option<Shard>,
    /// Run in N parts, those that are done not again, and merge them
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST_SHARDS)))]
    pub shards: Option<u32>,
    /// Where the parts are run.
    #[command(flatten)]
    pub cluster: ClusterOptions,
    /// Write also what takes more than a gigabyte
    #[arg(long)]
    pub yes: bool,
    /// Threads [default: one per core]; the numbers do not depend on them
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Folder for the results [default: out/campaign; of your own: out/NAME of the file]
    #[arg(short, long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// What there is to do with a campaign of your own.
#[derive(Debug, Subcommand)]
pub enum CampaignAction {
    /// Print a commented campaign, to be changed
    Example,
    /// Run one run again and write its trajectory and figures
    Replay(replay::ReplayArguments),
    /// Put shards together, after checking that none is missing, double or of another program
    Merge(shards::MergeArguments),
    /// Say which shards are done
    Status(shards::StatusArguments),
}

/// Runs a campaign and writes its results.
///
/// # Errors
/// A value or a run makes no sense, a file cannot be written, or something happened in the built-in
/// campaign on the nominal plant that is guaranteed not to.
pub fn run(arguments: &CampaignArguments) -> Result<String, CommandError> {
    match &arguments.action {
        Some(CampaignAction::Example) => return Ok(EXAMPLE.to_owned()),
        Some(CampaignAction::Replay(arguments)) => return replay::run(arguments),
        Some(CampaignAction::Merge(arguments)) => return shards::merge(arguments),
        Some(CampaignAction::Status(arguments)) => return shards::status(arguments),
        None => {}
    }
    let path = Path::new(&arguments.file);
    if !is_campaign(path)? {
        arguments.check_built_in()?;
        return guarantee::run(arguments);
    }
    arguments.check_own()?;
    let source = Source::load(path)?;
    let proof = ProofProgress::default();
    let files = ProvedFiles {
        folder: source.folder(),
        progress: &|done| proof.set_part(done),
    };
    let campaign = Campaign::new(&source, files, &crate::program::name()?)?;
    let out = arguments.out.clone().unwrap_or_else(|| folder(path));
    match (arguments.shard, arguments.shards, arguments.cluster.cluster) {
        (Some(shard), _, _) => shards::run_one(&campaign, shard, &out, arguments),
        (None, Some(of), Some(Cluster::Hyperqueue)) => cluster::run(&campaign, of, &out, arguments),
        (None, Some(of), None) => shards::run_all(&campaign, of, &out, arguments),
        (None, None, _) => whole::run(&campaign, &out, arguments),
    }
}

/// A commented campaign.
const EXAMPLE: &str = include_str!("../../../../docs/examples/campaigns/delay-and-slope.toml");

/// A campaign of one's own, with the files of its scenario.
type Own<'a> = Campaign<'a, ProvedFiles<'a>>;

/// Where the results of a campaign go when nothing else is said.
fn folder(campaign: &Path) -> PathBuf {
    Path::new("out").join(campaign.file_stem().unwrap_or(campaign.as_os_str()))
}

/// Whether a file is a campaign rather than a scenario: it names one.
fn is_campaign(path: &Path) -> Result<bool, CommandError> {
    if !path.is_file() {
        return Ok(false);
    }
    let table = input::read_toml::<toml::Table>(path)?;
    Ok(table.contains_key("scenario"))
}

impl CampaignArguments {
    /// What is of no use to the built-in campaign.
    fn check_built_in(&self) -> Result<(), CommandError> {
        let own = [
            ("--shard", self.shard.is_some()),
            ("--shards", self.shards.is_some()),
        ];
        self.check(
            &own,
            "goes with a campaign of your own: `ballbot campaign example` shows one",
        )
    }

    /// What a campaign of one's own has in its file.
    fn check_own(&self) -> Result<(), CommandError> {
        let built_in = [
            ("--runs", self.runs.is_some()),
            ("--samples", self.samples.is_some()),
            ("--seed", self.seed.is_some()),
            ("--set", !self.options.set.is_empty()),
            ("--parameters", self.options.robot.parameters.is_some()),
        ];
        let expected = "is for the built-in campaign; one of your own has it in its file (runs, seed, \
                        [set])";
        self.check(&built_in, expected)
    }

    fn check(&self, options: &[(&str, bool)], expected: &str) -> Result<(), CommandError> {
        match options.iter().find(|(_, given)| *given) {
            Some((option, _)) => Err(CommandError::Usage(format!("{option} {expected}"))),
            None => Ok(()),
        }
    }
}
