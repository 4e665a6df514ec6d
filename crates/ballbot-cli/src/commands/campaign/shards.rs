//! Parts of a campaign: run, counted and put together.

use super::whole::{PARQUET, RowFiles, counted, pool};
use super::{CampaignArguments, Own, report, room};
use crate::commands::CommandError;
use crate::commands::hyperqueue::ranges;
use crate::json;
use crate::output::{self, Draft, FileError};
use crate::progress::{Progress, ProofProgress};
use crate::results::ResultFolder;
use ballbot_campaign::{Campaign, CampaignError, Shard, Source};
use ballbot_scenario::proofs::ProvedFiles;
use ballbot_scenario::words;
use clap::Args;
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Arguments of `ballbot campaign merge`.
#[derive(Debug, Args)]
pub struct MergeArguments {
    /// The results' folder, with the shards below it
    pub dir: PathBuf,
    /// Write also what takes more than a gigabyte
    #[arg(long)]
    pub yes: bool,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `ballbot campaign status`.
#[derive(Debug, Args)]
pub struct StatusArguments {
    /// The results' folder, with the shards below it
    pub dir: PathBuf,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// What the shards of a folder belong to: a file beside them.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Plan {
    /// The campaign's file.
    campaign: PathBuf,
    /// Into how many shards it is divided.
    pub shards: u32,
    /// What it is made of, and by which program.
    fingerprint: String,
    program: String,
}

/// The folder of the shards below that of the results.
pub(super) fn folder(out: &Path) -> PathBuf {
    out.join("shards")
}

const PLAN: &str = "plan.json";

impl Plan {
    fn read(out: &Path) -> Result<Option<Self>, CommandError> {
        let path = folder(out).join(PLAN);
        if !path.exists() {
            return Ok(None);
        }
        let text = words::read_text(&path).map_err(FileError::at(&path))?;
        let plan = serde_json::from_str(&text);
        plan.map(Some).map_err(|error| {
            CommandError::Impossible(format!("{} is no plan of shards: {error}", path.display()))
        })
    }

    /// The plan of a folder that has one.
    fn of(out: &Path) -> Result<Self, CommandError> {
        Self::read(out)?.ok_or_else(|| {
            CommandError::Impossible(format!(
                "{} has no shards: `ballbot campaign FILE --shard 1/16 --out {}` runs the first of 16",
                out.display(),
                out.display()
            ))
        })
    }

    /// Makes the plan of a folder, or sees that what stands there is the same.
    pub fn keep(campaign: &Own<'_>, shards: u32, out: &Path) -> Result<(), CommandError> {
        let file = campaign.source().path();
        let plan = Self {
            campaign: std::path::absolute(file).unwrap_or_else(|_| file.to_owned()),
            shards,
            fingerprint: campaign.fingerprint().to_owned(),
            program: campaign.program().to_owned(),
        };
        let path = folder(out).join(PLAN);
        let Some(there) = Self::read(out)? else {
            let text = json::text(&json!(plan));
            return Ok(output::write_files(&[(&path, text.as_bytes())])?);
        };
        let differs = if there.program != plan.program {
            format!("were begun by {}, this is {}", there.program, plan.program)
        } else if there.fingerprint != plan.fingerprint {
            "are of another campaign, or it was changed since".to_owned()
        } else if there.shards != shards {
            format!("are {} in number, not {shards}", there.shards)
        } else {
            return Ok(());
        };
        Err(CommandError::Impossible(format!(
            "the shards in {} {differs}; remove that folder or choose another one with --out",
            folder(out).display()
        )))
    }
}

/// What is not run in parts.
pub(super) fn check_divisible(campaign: &Own<'_>) -> Result<(), CommandError> {
    let file = campaign.source().file();
    let whole = match (file.rare.is_some(), file.stop.is_some()) {
        (true, _) => "[rare]: each level of a rare failure follows from the one before",
        (_, true) => "[stop]: when to stop follows from all runs before",
        _ => return Ok(()),
    };
    Err(CommandError::Usage(format!(
        "{whole}, so it runs in one piece; leave out --shard and --shards"
    )))
}

/// Runs one shard.
pub(super) fn run_one(
    campaign: &Own<'_>,
    shard: Shard,
    out: &Path,
    arguments: &CampaignArguments,
) -> Result<String, CommandError> {
    check_divisible(campaign)?;
    let (from, until) = shard.runs(campaign.runs());
    room::check(
        until - from,
        &campaign.columns(),
        false,
        (out, arguments.yes),
    )?;
    let pool = pool(arguments)?;
    Plan::keep(campaign, shard.of(), out)?;
    let folder = folder(out);
    if campaign.has_shard(&folder, shard)? {
        return Ok(format!(
            "shard {shard} is done: {}\n",
            folder.join(shard.file_name()).display()
        ));
    }
    let progress = Progress::new(format!("shard {shard}"), (until - from) as usize);
    pool.install(|| write(campaign, shard, &folder, &counted(&progress)))?;
    Ok(format!(
        "shard {shard}: runs {from} to {} in {}\n",
        until as i64 - 1,
        folder.join(shard.file_name()).display()
    ))
}

fn write(
    campaign: &Own<'_>,
    shard: Shard,
    folder: &Path,
    progress: &(dyn Fn() + Sync),
) -> Result<(), CommandError> {
    let draft = Draft::create(&folder.join(shard.file_name()))?;
    let start = Instant::now();
    let into = (draft.file(), draft.temporary());
    campaign.write_shard(shard, into, &|| start.elapsed(), progress)?;
    Ok(draft.commit()?)
}

/// Runs the shards that are missing on this machine, and merges.
pub(super) fn run_all(
    campaign: &Own<'_>,
    of: u32,
    out: &Path,
    arguments: &CampaignArguments,
) -> Result<String, CommandError> {
    let missing = prepare(campaign, of, out, arguments)?;
    let pool = pool(arguments)?;
    let runs = missing.iter().map(|shard| shard.runs(campaign.runs()));
    let runs: u64 = runs.map(|(from, until)| until - from).sum();
    let progress = Progress::new("running", runs as usize);
    let count = counted(&progress);
    for shard in missing {
        pool.install(|| write(campaign, shard, &folder(out), &count))?;
    }
    drop(count);
    drop(progress);
    pool.install(|| put_together(campaign, out, arguments.json))
}

/// Checks that a campaign can be run in parts in the folder, and says which are missing.
pub(super) fn prepare(
    campaign: &Own<'_>,
    of: u32,
    out: &Path,
    arguments: &CampaignArguments,
) -> Result<Vec<Shard>, CommandError> {
    check_divisible(campaign)?;
    ResultFolder::open(crate::PROGRAM, out, &report::RESULTS)?;
    // The shards, and what they are merged into.
    room::check(
        2 * campaign.runs(),
        &campaign.columns(),
        true,
        (out, arguments.yes),
    )?;
    Plan::keep(campaign, of, out)?;
    Ok(missing(campaign, of, out)?)
}

/// The shards that are not there yet.
pub(super) fn missing(
    campaign: &Own<'_>,
    of: u32,
    out: &Path,
) -> Result<Vec<Shard>, CampaignError> {
    let mut missing = Vec::new();
    for shard in Shard::all(of) {
        if !campaign.has_shard(&folder(out), shard)? {
            missing.push(shard);
        }
    }
    Ok(missing)
}

/// Puts the shards of a folder together.
pub(super) fn merge(arguments: &MergeArguments) -> Result<String, CommandError> {
    let plan = Plan::of(&arguments.dir)?;
    let source = Source::load(&plan.campaign)?;
    let proof = ProofProgress::default();
    let files = ProvedFiles {
        folder: source.folder(),
        progress: &|done| proof.set_part(done),
    };
    let campaign = Campaign::new(&source, files, &crate::program::name()?)?;
    let out = &arguments.dir;
    Plan::keep(&campaign, plan.shards, out)?;
    room::check(
        campaign.runs(),
        &campaign.columns(),
        true,
        (out, arguments.yes),
    )?;
    put_together(&campaign, out, arguments.json)
}

pub(super) fn put_together(
    campaign: &Own<'_>,
    out: &Path,
    json: bool,
) -> Result<String, CommandError> {
    let results = ResultFolder::open(crate::PROGRAM, out, &report::RESULTS)?;
    let shards = campaign.shards(&folder(out))?;
    let rows = RowFiles::create(out)?;
    let progress = Progress::new("merging", campaign.runs() as usize);
    let count = counted(&progress);
    let mut writer = rows.writer(campaign)?;
    shards.for_each(|row| {
        count();
        writer.push(row)
    })?;
    writer.finish()?;
    drop(count);
    drop(progress);
    let text = report::all(campaign, rows, &results, (true, json))?;
    sweep(&folder(out));
    Ok(text)
}

/// Removes what processes that were killed have left of shards: all shards are there.
fn sweep(folder: &Path) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let name = name.to_string_lossy();
        if name.starts_with(".shard-") && name.ends_with(".part") {
            // One that stays harms nobody.
            let _ = fs::remove_file(entry.path());
        }
    }
}

/// Says which shards are done.
pub(super) fn status(arguments: &StatusArguments) -> Result<String, CommandError> {
    let out = &arguments.dir;
    let plan = Plan::of(out)?;
    let source = Source::load(&plan.campaign)?;
    let proof = ProofProgress::default();
    let files = ProvedFiles {
        folder: source.folder(),
        progress: &|done| proof.set_part(done),
    };
    let campaign = Campaign::new(&source, files, &crate::program::name()?)?;
    let mut broken = Vec::new();
    let mut missing = Vec::new();
    for shard in Shard::all(plan.shards) {
        match campaign.has_shard(&folder(out), shard) {
            Ok(true) => {}
            Ok(false) => missing.push(shard),
            Err(error) => broken.push(error.to_string()),
        }
    }
    let done = plan.shards as usize - missing.len() - broken.len();
    let numbers: Vec<u32> = missing.iter().map(|shard| shard.index()).collect();
    if arguments.json {
        return Ok(json::text(&json!({
            "campaign": plan.campaign,
            "shards": plan.shards,
            "done": done,
            "missing": numbers,
            "broken": broken,
        })));
    }
    let mut text = format!(
        "{}: {done} of {} shards are done\n",
        source.file().title,
        plan.shards
    );
    if !missing.is_empty() {
        text += &format!("missing: {}\n", ranges(&numbers));
    }
    broken
        .iter()
        .for_each(|problem| text += &format!("broken: {problem}\n"));
    if done == plan.shards as usize {
        let already = match out.join(PARQUET).exists() {
            true => "results are there already; again, ",
            false => "",
        };
        text += &format!(
            "{already}put them together with `ballbot campaign merge {}`\n",
            out.display()
        );
    }
    Ok(text)
}
