//! A campaign on a cluster: the shards that are missing are tasks of one job, and come by the file
//! system that all machines share.

use super::shards::{folder, missing, prepare, put_together};
use super::{CampaignArguments, Own};
use crate::commands::CommandError;
use crate::commands::hyperqueue::{HyperQueue, Tasks, on_command_line, ranges};
use crate::progress::Progress;
use ballbot_campaign::Shard;
use std::path::Path;
use std::time::Duration;

/// From one look at the shards to the next.
const PAUSE: Duration = Duration::from_millis(500);

/// Has the shards run that are missing, waits, and merges.
pub(super) fn run(
    campaign: &Own<'_>,
    of: u32,
    out: &Path,
    arguments: &CampaignArguments,
) -> Result<String, CommandError> {
    let numbers = |shards: &[Shard]| shards.iter().map(|shard| shard.index()).collect();
    let to_run: Vec<u32> = numbers(&prepare(campaign, of, out, arguments)?);
    if !to_run.is_empty() {
        let file = on_command_line(campaign.source().path())?;
        let mut command = ["campaign", &file, "--out", &on_command_line(out)?]
            .map(str::to_owned)
            .to_vec();
        command.extend(arguments.yes.then(|| "--yes".to_owned()));
        let digest = campaign.fingerprint().get(..12).unwrap_or_default();
        let tasks = Tasks {
            name: format!("ballbot-{digest}"),
            numbers: &to_run,
            of,
            threads: arguments.threads.unwrap_or(1),
            arguments: command,
            folder: &folder(out),
        };
        let progress = Progress::new("HyperQueue", campaign.runs() as usize);
        let hq = HyperQueue::new(arguments.cluster.server_dir.as_deref())?;
        hq.run(&tasks, PAUSE, &mut || {
            let there = Shard::all(of).filter(|shard| folder(out).join(shard.file_name()).exists());
            let runs = there.map(|shard| shard.runs(campaign.runs()));
            let runs: u64 = runs.map(|(from, until)| until - from).sum();
            progress.set(runs as usize);
            runs == campaign.runs()
        })?;
    }
    let left = missing(campaign, of, out)?;
    if !left.is_empty() {
        return Err(CommandError::Cluster(format!(
            "the cluster's tasks are done, and the shards {} are not in {}: do its workers see this \
             folder?",
            ranges(&numbers(&left)),
            folder(out).display()
        )));
    }
    put_together(campaign, out, arguments.json)
}
