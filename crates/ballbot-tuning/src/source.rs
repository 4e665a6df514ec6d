//! A tuning's file with the scenario that it names, as the campaigns that it runs.

use crate::error::TuningError;
use crate::file::TuningFile;
use ballbot_campaign::{CampaignFile, OnRefused, Source, named_seed};
use ballbot_scenario::words;
use std::path::{Path, PathBuf};
use toml::Value;

/// A tuning's file with the scenario that it names.
#[derive(Clone, Debug)]
pub struct TuningSource {
    path: PathBuf,
    file: TuningFile,
    /// The worlds of the candidates.
    pub(crate) worlds: Source,
    /// The worlds of the comparison.
    pub(crate) held_out: Source,
}

impl TuningSource {
    /// Reads a tuning, and the scenario it names, which is built in or a file beside it.
    ///
    /// # Errors
    /// A file cannot be read, or is no tuning or no scenario.
    pub fn load(path: &Path) -> Result<Self, TuningError> {
        let text = words::read_text(path).map_err(|source| TuningError::File {
            path: path.to_owned(),
            source,
        })?;
        let file: TuningFile = words::from_toml(&text).map_err(|error| TuningError::Syntax {
            path: path.to_owned(),
            message: words::toml_message(&error.to_string()),
        })?;
        let lists = file
            .parameters
            .values()
            .filter_map(|table| table.list.clone());
        let lists: Vec<Value> = lists.map(Value::Array).collect();
        let source = |campaign| Source::of(path, text.clone(), campaign, lists.clone());
        Ok(Self {
            worlds: source(worlds(&file))?,
            held_out: source(held_out(&file)?)?,
            path: path.to_owned(),
            file,
        })
    }

    /// Where the tuning is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What stands in it.
    pub fn file(&self) -> &TuningFile {
        &self.file
    }

    /// The folder that the scenario's paths are relative to.
    pub fn folder(&self) -> &Path {
        self.worlds.folder()
    }

    /// The scenario's text.
    pub fn scenario(&self) -> &str {
        self.worlds.scenario().text()
    }
}

/// The worlds of a candidate as a campaign.
fn worlds(file: &TuningFile) -> CampaignFile {
    let worlds = &file.worlds;
    let one = worlds.vary.is_empty().then_some(1);
    CampaignFile {
        title: file.title.clone(),
        scenario: file.scenario.clone(),
        runs: worlds.runs.or(one),
        seed: worlds.seed,
        design: worlds.design,
        same_noise: worlds.same_noise,
        refused: OnRefused::Stop,
        set: worlds.set.clone(),
        vary: worlds.vary.clone(),
        // All that is no time of this machine.
        measure: None,
        success: worlds.success.clone(),
        stop: None,
        rare: None,
    }
}

/// Worlds of the same kind with another seed.
fn held_out(file: &TuningFile) -> Result<CampaignFile, TuningError> {
    let seen = file.worlds.seed;
    let seed = match file.held_out.seed {
        Some(seed) if seed == seen => {
            let expected = "it must differ from that of [worlds], which the search has seen";
            return Err(TuningError::value(
                "held_out.seed",
                seed.to_string(),
                expected,
            ));
        }
        Some(seed) => seed,
        None => named_seed(seen, "held out"),
    };
    let worlds = worlds(file);
    Ok(CampaignFile {
        runs: file.held_out.runs.or(worlds.runs),
        seed,
        ..worlds
    })
}
