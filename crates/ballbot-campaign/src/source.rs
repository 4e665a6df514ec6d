//! A campaign as it stands in its file, with the scenario that it names.

use crate::error::CampaignError;
use crate::file::CampaignFile;
use crate::fixed::fixed;
use ballbot_scenario::{Document, words};
use std::path::{Path, PathBuf};
use toml::Value;

/// A campaign's file with the scenario that it names.
#[derive(Clone, Debug)]
pub struct Source {
    path: PathBuf,
    text: String,
    file: CampaignFile,
    scenario: Document,
    /// Where files are looked for that the scenario names.
    folder: PathBuf,
    /// Values from elsewhere that may name files.
    also: Vec<Value>,
}

impl Source {
    /// Reads a campaign, and the scenario it names, which is built in or a file beside it.
    ///
    /// # Errors
    /// A file cannot be read, or is no campaign or no scenario.
    pub fn load(path: &Path) -> Result<Self, CampaignError> {
        Self::parse(
            words::read_text(path).map_err(CampaignError::at(path))?,
            path,
        )
    }

    /// A campaign's text, as if it stood in the file `path`.
    ///
    /// # Errors
    /// As [`load`](Self::load).
    pub fn parse(text: String, path: &Path) -> Result<Self, CampaignError> {
        let file: CampaignFile =
            words::from_toml(&text).map_err(|error| CampaignError::Syntax {
                path: path.to_owned(),
                message: words::toml_message(&error.to_string()),
            })?;
        Self::of(path, text, file, Vec::new())
    }

    /// A campaign that stands in a file of another kind at `path`, whose whole text is `text`; `also`
    /// are values in it that may name files, beside those of the campaign. Reads the scenario.
    ///
    /// # Errors
    /// The scenario cannot be read, or is none.
    pub fn of(
        path: &Path,
        text: String,
        file: CampaignFile,
        also: Vec<Value>,
    ) -> Result<Self, CampaignError> {
        let folder = path.parent().unwrap_or(Path::new(""));
        let beside = folder.join(&file.scenario);
        let named = match beside.is_file() {
            true => beside.to_string_lossy().into_owned(),
            false => file.scenario.clone(),
        };
        let scenario = Document::load(&named)?;
        // A built-in scenario is nowhere: what it is given stands beside the campaign.
        let file_of_scenario = Some(Path::new(&named)).filter(|path| path.is_file());
        let folder = file_of_scenario.and_then(Path::parent).unwrap_or(folder);
        Ok(Self {
            path: path.to_owned(),
            text,
            file,
            scenario,
            folder: folder.to_owned(),
            also,
        })
    }

    /// Where the campaign is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Its text.
    pub(crate) fn text(&self) -> &str {
        &self.text
    }

    /// What stands in it.
    pub fn file(&self) -> &CampaignFile {
        &self.file
    }

    /// The scenario.
    pub fn scenario(&self) -> &Document {
        &self.scenario
    }

    /// The keys of the scenario that are the same in all runs: those of `[set]`, tables in it as keys with
    /// dots.
    pub fn fixed(&self) -> Vec<(String, Value)> {
        fixed(&self.scenario, &self.file.set)
    }

    /// Values from elsewhere that may name files.
    pub(crate) fn also(&self) -> &[Value] {
        &self.also
    }

    /// The folder that the scenario's paths are relative to.
    pub fn folder(&self) -> &Path {
        &self.folder
    }
}
