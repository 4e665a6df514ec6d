//! A campaign on a cluster, by HyperQueue: its program `hq` submits the shards that are missing as an
//! array of tasks and says how they fare; the shards come by the file system that all share.

use super::shards::{folder, missing, prepare, put_together, ranges};
use super::{CampaignArguments, Own};
use crate::commands::CommandError;
use crate::output::{self, FileError};
use crate::progress::Progress;
use ballbot_campaign::Shard;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};
use std::{env, fs, thread};

/// From one look at the cluster to the next.
const LOOK: Duration = Duration::from_millis(500);
/// A server that is gone for longer than this does not come back.
const PATIENCE: Duration = Duration::from_secs(300);
/// The file with the job's number, by which it is found again.
const JOB: &str = "hyperqueue-job";

/// Has the shards run that are missing, waits, and merges.
pub(super) fn run(
    campaign: &Own<'_>,
    of: u32,
    out: &Path,
    arguments: &CampaignArguments,
) -> Result<String, CommandError> {
    let missing_shards = prepare(campaign, of, out, arguments)?;
    if !missing_shards.is_empty() {
        let hq = HyperQueue::new(arguments.server_dir.as_deref())?;
        let job = match hq.running_job(out) {
            Some(job) => job,
            None => hq.submit(campaign, &missing_shards, of, (out, arguments))?,
        };
        hq.follow(job, campaign, of, out)?;
    }
    let left = missing(campaign, of, out)?;
    if !left.is_empty() {
        let numbers: Vec<u32> = left.iter().map(|shard| shard.index()).collect();
        return Err(CommandError::Cluster(format!(
            "the cluster's tasks are done, and the shards {} are not in {}: do its workers see this \
             folder?",
            ranges(&numbers),
            folder(out).display()
        )));
    }
    put_together(campaign, out, arguments.json)
}

/// The client of a server that runs.
struct HyperQueue {
    program: PathBuf,
    server_dir: Option<PathBuf>,
}

/// Tasks of a job, by what became of them.
#[derive(Clone, Copy, Debug, Default)]
struct Tasks {
    open: u64,
    failed: u64,
}

impl HyperQueue {
    fn new(server_dir: Option<&Path>) -> Result<Self, CommandError> {
        let hq = Self {
            program: env::var_os("HQ").map_or_else(|| "hq".into(), PathBuf::from),
            server_dir: server_dir.map(Path::to_owned),
        };
        hq.json(&["server", "info"]).map_err(|error| {
            let named = server_dir.map_or(String::new(), |dir| format!(" with {}", dir.display()));
            CommandError::Cluster(format!(
                "no HyperQueue server{named} answers: {error}\nstart one with `hq server start`, and \
                 workers with `hq worker start`"
            ))
        })?;
        Ok(hq)
    }

    /// What `hq` answers; in words what it complains about.
    fn json(&self, arguments: &[&str]) -> Result<Value, String> {
        let mut command = Command::new(&self.program);
        if let Some(dir) = &self.server_dir {
            command.arg("--server-dir").arg(dir);
        }
        let output = command
            .args(["--output-mode", "json"])
            .args(arguments)
            .output();
        let output = output.map_err(|error| format!("{}: {error}", self.program.display()))?;
        let text = String::from_utf8_lossy(&output.stdout);
        let answer: Result<Value, _> = serde_json::from_str(&text);
        match (output.status.success(), answer) {
            (true, Ok(answer)) => Ok(answer),
            (_, Ok(answer)) if answer["error"].is_string() => {
                Err(answer["error"].as_str().unwrap_or_default().to_owned())
            }
            _ => Err(format!("{text}{}", String::from_utf8_lossy(&output.stderr))
                .trim()
                .to_owned()),
        }
    }

    /// A job of an earlier call for this folder that has not ended.
    fn running_job(&self, out: &Path) -> Option<u64> {
        let text = fs::read_to_string(folder(out).join(JOB)).ok()?;
        let (job, name) = text.trim().split_once(' ')?;
        let job = job.parse().ok()?;
        let info = self.info(job).ok()?;
        // A new server begins to count anew.
        let same = info["info"]["name"].as_str() == Some(name);
        (same && tasks(&info).open > 0).then_some(job)
    }

    fn info(&self, job: u64) -> Result<Value, String> {
        let answer = self.json(&["job", "info", &job.to_string()])?;
        let job = answer.get(0).cloned();
        job.filter(|job| job["info"]["task_stats"].is_object())
            .ok_or_else(|| format!("the answer about a job is not understood: {answer}"))
    }

    fn submit(
        &self,
        campaign: &Own<'_>,
        shards: &[Shard],
        of: u32,
        (out, arguments): (&Path, &CampaignArguments),
    ) -> Result<u64, CommandError> {
        let numbers: Vec<u32> = shards.iter().map(|shard| shard.index()).collect();
        let absolute = |path: &Path| std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
        let text = |path: PathBuf| {
            let refused = |path: std::ffi::OsString| {
                CommandError::Usage(format!(
                    "{} cannot be named on a command line",
                    path.display()
                ))
            };
            path.into_os_string().into_string().map_err(refused)
        };
        let program = env::current_exe().map_err(FileError::at(Path::new("ballbot")))?;
        let program = text(program)?;
        let file = text(absolute(campaign.source().path()))?;
        let results = text(absolute(out))?;
        let errors = text(absolute(&folder(out)))? + "/task-%{TASK_ID}.txt";
        let name = format!(
            "ballbot-{}",
            campaign.fingerprint().get(..12).unwrap_or_default()
        );
        let threads = arguments.threads.unwrap_or(1).to_string();
        // The task's number is known to the shell alone.
        let shard = format!("exec \"$0\" \"$@\" --shard \"$HQ_TASK_ID/{of}\"");
        let array = ranges(&numbers);
        let submit = [
            "submit",
            "--name",
            &name,
            "--array",
            &array,
            "--cpus",
            &threads,
            "--stdout",
            "none",
            "--stderr",
            &errors,
            "--crash-limit",
            "unlimited",
            "--",
            "sh",
            "-c",
            &shard,
            &program,
            "--quiet",
            "campaign",
            &file,
            "--out",
            &results,
            "--threads",
            &threads,
        ];
        let mut submit = submit.to_vec();
        submit.extend(arguments.yes.then_some("--yes"));
        let answer = self.json(&submit).map_err(CommandError::Cluster)?;
        let job = answer["id"].as_u64().ok_or_else(|| {
            CommandError::Cluster(format!("hq did not say the job's number: {answer}"))
        })?;
        let note = format!("{job} {name}\n");
        output::write_files(&[(&folder(out).join(JOB), note.as_bytes())])?;
        Ok(job)
    }

    /// Waits until all tasks of a job have ended.
    fn follow(
        &self,
        job: u64,
        campaign: &Own<'_>,
        of: u32,
        out: &Path,
    ) -> Result<(), CommandError> {
        let progress = Progress::new(format!("HyperQueue job {job}"), campaign.runs() as usize);
        let mut answered = Instant::now();
        loop {
            let there = Shard::all(of).filter(|shard| folder(out).join(shard.file_name()).exists());
            let runs = there
                .map(|shard| shard.runs(campaign.runs()))
                .map(|(from, until)| until - from);
            progress.set(runs.sum::<u64>() as usize);
            match self.info(job).as_ref().map(tasks) {
                Ok(Tasks { failed, .. }) if failed > 0 => {
                    return Err(self.failure(job, failed, out));
                }
                Ok(Tasks { open: 0, .. }) => return Ok(()),
                Ok(_) => answered = Instant::now(),
                // One that was killed is started again from its journal.
                Err(_) if answered.elapsed() < PATIENCE => {}
                Err(error) => {
                    return Err(CommandError::Cluster(format!(
                        "the HyperQueue server has not answered for {} s: {error}\nwith the server \
                         running again, the same command goes on",
                        PATIENCE.as_secs()
                    )));
                }
            }
            thread::sleep(LOOK);
        }
    }

    /// What failing tasks say; what others are left is not waited for.
    fn failure(&self, job: u64, failed: u64, out: &Path) -> CommandError {
        let _ = self.json(&["job", "cancel", &job.to_string()]);
        let mut said: Vec<(PathBuf, String)> = Vec::new();
        for entry in fs::read_dir(folder(out)).into_iter().flatten().flatten() {
            let path = entry.path();
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            if name.starts_with("task-") && name.ends_with(".txt") {
                let text = fs::read_to_string(&path).unwrap_or_default();
                if !text.trim().is_empty() {
                    said.push((path.clone(), text.trim().to_owned()));
                }
            }
        }
        said.sort();
        let first = said.first().map_or(String::new(), |(path, text)| {
            format!(", {}:\n{text}", path.display())
        });
        CommandError::Cluster(format!(
            "{failed} tasks of HyperQueue job {job} failed, the others were cancelled; shards that are \
             done are kept{first}"
        ))
    }
}

fn tasks(info: &Value) -> Tasks {
    let count = |name: &str| info["info"]["task_stats"][name].as_u64().unwrap_or(0);
    Tasks {
        open: count("running") + count("waiting"),
        failed: count("failed") + count("canceled") + count("aborted"),
    }
}
