//! HyperQueue, which runs tasks on many machines, by its program `hq`.

use crate::commands::CommandError;
use crate::output::{self, FileError};
use clap::{Args, ValueEnum};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};
use std::{env, fs, thread};

/// From one question to the server to the next.
const LOOK: Duration = Duration::from_millis(500);
/// A server that is gone for longer than this does not come back.
const PATIENCE: Duration = Duration::from_secs(300);
/// What a task wrote can be seen so much later, by a file system that machines share.
const LATE: Duration = Duration::from_secs(10);

/// The file with the job's number, by which it is found again.
const JOB: &str = "hyperqueue-job";

/// Where parts are run.
#[derive(Clone, Debug, Args)]
pub struct ClusterOptions {
    /// Have the parts run by a cluster whose server runs
    #[arg(long, requires = "shards")]
    pub cluster: Option<Cluster>,
    /// Server directory of the cluster [default: that of its client]
    #[arg(long, value_name = "DIR", requires = "cluster")]
    pub server_dir: Option<PathBuf>,
}

/// A cluster.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum Cluster {
    /// HyperQueue, whose program `hq` must be in the PATH (or named by the variable HQ)
    Hyperqueue,
}

/// An array of tasks, each a command of this program.
pub(super) struct Tasks<'a> {
    /// What the job is called, by which it is known again.
    pub name: String,
    /// The tasks' numbers, rising.
    pub numbers: &'a [u32],
    /// How many there are with those that are done: a task gets the option `--shard NUMBER/OF`.
    pub of: u32,
    /// Threads of a task.
    pub threads: u16,
    /// The command's arguments; paths must be absolute.
    pub arguments: Vec<String>,
    /// The folder where the job's number and what tasks complain of are kept.
    pub folder: &'a Path,
}

/// The client of a server that runs.
pub(super) struct HyperQueue {
    program: PathBuf,
    server_dir: Option<PathBuf>,
}

/// A job's tasks, by what became of them.
#[derive(Clone, Copy, Debug, Default)]
struct Counts {
    open: u64,
    failed: u64,
}

impl HyperQueue {
    /// The client of the server that is found there.
    ///
    /// # Errors
    /// None answers.
    pub fn new(server_dir: Option<&Path>) -> Result<Self, CommandError> {
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

    /// A job of this name of an earlier call for the folder, if it has not ended.
    fn running_job(&self, tasks: &Tasks<'_>) -> Option<u64> {
        let text = fs::read_to_string(tasks.folder.join(JOB)).ok()?;
        let (job, name) = text.trim().split_once(' ')?;
        let job = job.parse().ok()?;
        let info = self.info(job).ok()?;
        // A new server begins to count anew.
        let same = name == tasks.name && info["info"]["name"].as_str() == Some(name);
        (same && counts(&info).open > 0).then_some(job)
    }

    fn info(&self, job: u64) -> Result<Value, String> {
        let answer = self.json(&["job", "info", &job.to_string()])?;
        let job = answer.get(0).cloned();
        job.filter(|job| job["info"]["task_stats"].is_object())
            .ok_or_else(|| format!("the answer about a job is not understood: {answer}"))
    }

    /// Submits tasks, if an earlier call has not, and waits until `all_there` says that what they
    /// write is there, or all have ended.
    ///
    /// # Errors
    /// A task fails, or the server is gone for long.
    pub fn run(
        &self,
        tasks: &Tasks<'_>,
        pause: Duration,
        all_there: &mut dyn FnMut() -> bool,
    ) -> Result<(), CommandError> {
        let job = match self.running_job(tasks) {
            Some(job) => job,
            None => self.submit(tasks)?,
        };
        self.follow(job, tasks.folder, pause, all_there)
    }

    /// Has the server forget the last job of a folder, which is done.
    pub fn forget(&self, folder: &Path) {
        let note = folder.join(JOB);
        let text = fs::read_to_string(&note).unwrap_or_default();
        if let Some((job, _)) = text.split_once(' ') {
            // One that is kept takes a little memory of the server.
            let _ = self.json(&["job", "forget", job]);
            let _ = fs::remove_file(note);
        }
    }

    fn submit(&self, tasks: &Tasks<'_>) -> Result<u64, CommandError> {
        let program = env::current_exe().map_err(FileError::at(Path::new("ballbot")))?;
        let program = on_command_line(&program)?;
        let errors = on_command_line(tasks.folder)? + "/task-%{TASK_ID}.txt";
        let threads = tasks.threads.to_string();
        // The task's number is known to the shell alone.
        let shard = format!("exec \"$0\" \"$@\" --shard \"$HQ_TASK_ID/{}\"", tasks.of);
        let array = ranges(tasks.numbers);
        let submit = [
            "submit",
            "--name",
            &tasks.name,
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
        ];
        let mut submit = submit.to_vec();
        submit.extend(tasks.arguments.iter().map(String::as_str));
        submit.extend(["--threads", &threads]);
        let answer = self.json(&submit).map_err(CommandError::Cluster)?;
        let job = answer["id"].as_u64().ok_or_else(|| {
            CommandError::Cluster(format!("hq did not say the job's number: {answer}"))
        })?;
        let note = format!("{job} {}\n", tasks.name);
        output::write_files(&[(&tasks.folder.join(JOB), note.as_bytes())])?;
        Ok(job)
    }

    /// Waits, and looks every `pause`.
    fn follow(
        &self,
        job: u64,
        folder: &Path,
        pause: Duration,
        all_there: &mut dyn FnMut() -> bool,
    ) -> Result<(), CommandError> {
        let mut answered = Instant::now();
        let mut asked: Option<Instant> = None;
        let mut ended: Option<Instant> = None;
        while !all_there() && ended.is_none_or(|ended| ended.elapsed() < LATE) {
            if ended.is_none() && asked.is_none_or(|asked| asked.elapsed() >= LOOK) {
                asked = Some(Instant::now());
                match self.info(job).as_ref().map(counts) {
                    Ok(Counts { failed, .. }) if failed > 0 => {
                        return Err(self.failure(job, failed, folder));
                    }
                    Ok(Counts { open: 0, .. }) => ended = Some(Instant::now()),
                    Ok(_) => answered = Instant::now(),
                    // One that was killed is started again from its journal.
                    Err(_) if answered.elapsed() < PATIENCE => {}
                    Err(error) => {
                        return Err(CommandError::Cluster(format!(
                            "the HyperQueue server has not answered for {} s: {error}\nwith the \
                             server running again, the same command goes on",
                            PATIENCE.as_secs()
                        )));
                    }
                }
            }
            thread::sleep(pause);
        }
        Ok(())
    }

    /// What failing tasks say; what others are left is not waited for.
    fn failure(&self, job: u64, failed: u64, folder: &Path) -> CommandError {
        let _ = self.json(&["job", "cancel", &job.to_string()]);
        let mut said: Vec<(PathBuf, String)> = Vec::new();
        for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
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
            "{failed} tasks of HyperQueue job {job} failed, the others were cancelled; what is \
             done is kept{first}"
        ))
    }
}

fn counts(info: &Value) -> Counts {
    let count = |name: &str| info["info"]["task_stats"][name].as_u64().unwrap_or(0);
    Counts {
        open: count("running") + count("waiting"),
        failed: count("failed") + count("canceled") + count("aborted"),
    }
}

/// A path as an argument for a task, wherever it runs.
///
/// # Errors
/// It is no text.
pub(super) fn on_command_line(path: &Path) -> Result<String, CommandError> {
    let absolute = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    let refused = |path: std::ffi::OsString| {
        CommandError::Usage(format!(
            "{} cannot be named on a command line",
            path.display()
        ))
    };
    absolute.into_os_string().into_string().map_err(refused)
}

/// Rising numbers as ranges: 1,3-5.
pub(super) fn ranges(numbers: &[u32]) -> String {
    let groups = numbers.chunk_by(|a, b| a + 1 == *b);
    let words = groups.map(|group| match group {
        [first, .., last] => format!("{first}-{last}"),
        only => only.iter().map(u32::to_string).collect(),
    });
    words.collect::<Vec<_>>().join(",")
}

#[cfg(test)]
mod tests {
    use super::ranges;

    #[test]
    fn numbers_become_ranges() {
        assert_eq!(ranges(&[1, 3, 4, 5, 9]), "1,3-5,9");
        assert_eq!(ranges(&[7]), "7");
        assert_eq!(ranges(&[]), "");
    }
}
