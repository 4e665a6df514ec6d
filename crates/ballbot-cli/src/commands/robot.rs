//! Which robot, and which scenario: the options that all commands with one have.

use super::CommandError;
use crate::progress::ProofProgress;
use ballbot::Ballbot;
use ballbot_scenario::proofs::ProvedFiles;
use ballbot_scenario::{Parameters, Prepared, Scenario, read_robot};
use clap::Args;
use std::path::{Path, PathBuf};

/// The robot.
#[derive(Debug, Default, Args)]
pub struct RobotArguments {
    /// The robot: parameters.toml of `ballbot identify`, or any TOML file with a `[parameters]`
    /// table [default: that of the scenario; the paper's b* where there is none]
    #[arg(long, value_name = "FILE.toml")]
    pub parameters: Option<PathBuf>,
}

impl RobotArguments {
    /// The robot; the paper's where none was named.
    ///
    /// # Errors
    /// The file cannot be read or makes no sense.
    pub fn ballbot(&self) -> Result<Ballbot<f64>, CommandError> {
        match &self.parameters {
            Some(path) => Ok(read_robot(path)?.ballbot),
            None => Ok(Ballbot::paper()),
        }
    }
}

/// What a scenario is changed by.
#[derive(Debug, Default, Args)]
pub struct ScenarioOptions {
    /// The robot.
    #[command(flatten)]
    pub robot: RobotArguments,
    /// Set a key of the scenario, in place of what its file says; repeatable
    #[arg(long, value_name = "KEY=VALUE", value_parser = assignment)]
    pub set: Vec<(String, String)>,
}

fn assignment(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((key, value)) if !key.trim().is_empty() => {
            Ok((key.trim().to_owned(), value.trim().to_owned()))
        }
        _ => Err(format!(
            "`{text}` is not KEY=VALUE, such as controller.t_s=0.04"
        )),
    }
}

impl ScenarioOptions {
    /// A built-in scenario or a scenario file with these options, checked. Files that it names are
    /// looked for beside it; a certificate among them is proved, the first time.
    ///
    /// # Errors
    /// The scenario or the robot's file cannot be read or makes no sense.
    pub fn prepare(&self, scenario: &str) -> Result<Prepared, CommandError> {
        let (loaded, folder) = self.load(scenario)?;
        let proof = ProofProgress::default();
        let files = ProvedFiles {
            folder: &folder,
            progress: &|done| proof.set_part(done),
        };
        Ok(loaded.prepare(files)?)
    }

    /// The files that are read for a scenario with these options: its own, if it has one, and those that it names.
    ///
    /// # Errors
    /// As [`load`](Self::load).
    pub fn files(&self, scenario: &str) -> Result<Vec<PathBuf>, CommandError> {
        let (loaded, folder) = self.load(scenario)?;
        let named = loaded.files().map(|file| folder.join(file));
        Ok(named.chain([PathBuf::from(scenario)]).collect())
    }

    /// A scenario with these options, and the folder for files that it names; not checked yet.
    ///
    /// # Errors
    /// The scenario cannot be read, or a key of it cannot be set, or is to be set twice.
    pub fn load(&self, scenario: &str) -> Result<(Scenario, PathBuf), CommandError> {
        for (place, (key, value)) in self.set.iter().enumerate() {
            let mut before = self.set.iter().take(place);
            if let Some((_, other)) = before.find(|(earlier, _)| earlier == key) {
                return Err(CommandError::Usage(format!(
                    "--set {key} is there twice, with {other} and with {value}: keep one"
                )));
            }
        }
        let mut loaded = Scenario::load_with(scenario, &self.set)?;
        if let Some(path) = &self.robot.parameters {
            // Relative to where the command was given, not to the scenario.
            let path = std::path::absolute(path).unwrap_or_else(|_| path.clone());
            loaded.parameters = Parameters::File(path);
        }
        let folder = Path::new(scenario).parent().unwrap_or(Path::new("."));
        Ok((loaded, folder.to_owned()))
    }
}
