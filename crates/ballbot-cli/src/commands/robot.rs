//! Which robot: the option that all commands with a robot have.

use super::CommandError;
use crate::proofs::ProvedFiles;
use ballbot::Ballbot;
use ballbot_scenario::{Parameters, Prepared, Scenario};
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
            Some(path) => {
                let file = Parameters::File(path.clone());
                Ok(file.read("parameters", &Path::new("."))?.ballbot)
            }
            None => Ok(Ballbot::paper()),
        }
    }

    /// A built-in scenario or a scenario file with this robot, checked. Files that it names are
    /// looked for beside it; a certificate among them is proved, the first time.
    ///
    /// # Errors
    /// The scenario or the robot's file cannot be read or makes no sense.
    pub fn prepare(&self, scenario: &str) -> Result<Prepared, CommandError> {
        let (loaded, folder) = self.load(scenario)?;
        let files = ProvedFiles { folder: &folder };
        Ok(loaded.prepare(files)?)
    }

    /// A scenario with this robot, and the folder for files that it names; not checked yet.
    ///
    /// # Errors
    /// The scenario cannot be read.
    pub fn load(&self, scenario: &str) -> Result<(Scenario, PathBuf), CommandError> {
        let mut loaded = Scenario::load(scenario)?;
        if let Some(path) = &self.parameters {
            // Relative to where the command was given, not to the scenario.
            let path = std::path::absolute(path).unwrap_or_else(|_| path.clone());
            loaded.parameters = Parameters::File(path);
        }
        let folder = Path::new(scenario).parent().unwrap_or(Path::new("."));
        Ok((loaded, folder.to_owned()))
    }
}
