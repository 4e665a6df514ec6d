//! Parts of a campaign that are run apart, and put together again.

use crate::campaign::{Campaign, Clock};
use crate::cell::{Cell, Row};
use crate::error::CampaignError;
use crate::results::{RowFile, RowWriter, hexadecimal};
use ballbot_scenario::Files;
use sha2::{Digest, Sha256};
use std::fmt;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Part `index` of `of`, from 1 on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Shard {
    index: u32,
    of: u32,
}

/// Shards of a campaign, at most.
pub const MOST_SHARDS: u32 = 100_000;

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts = text.split_once('/');
        let parts = parts.and_then(|(index, of)| Some((index.parse().ok()?, of.parse().ok()?)));
        match parts {
            Some((index, of)) if (1..=of).contains(&index) && of <= MOST_SHARDS => {
                Ok(Self { index, of })
            }
            _ => Err(format!(
                "`{text}` is not I/N with I from 1 to N and N at most {MOST_SHARDS}, such as 3/16"
            )),
        }
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.of)
    }
}

impl Shard {
    /// All parts of so many.
    pub fn all(of: u32) -> impl Iterator<Item = Self> {
        (1..=of).map(move |index| Self { index, of })
    }

    /// Its number, from 1 on.
    pub fn index(self) -> u32 {
        self.index
    }

    /// Into how many parts the campaign is divided.
    pub fn of(self) -> u32 {
        self.of
    }

    /// Its file's name.
    pub fn file_name(self) -> String {
        format!("shard-{:05}-of-{:05}.parquet", self.index, self.of)
    }

    /// Its runs: from the first to before the second.
    pub fn runs(self, all: u64) -> (u64, u64) {
        let at = |index: u32| (u128::from(all) * u128::from(index) / u128::from(self.of)) as u64;
        (at(self.index - 1), at(self.index))
    }
}

/// What a file of results says of itself.
const PROGRAM: &str = "ballbot.program";
const FINGERPRINT: &str = "ballbot.fingerprint";
const TITLE: &str = "ballbot.title";
const REFERENCE_RUN: &str = "ballbot.first_run_sha256";
const FROM: &str = "ballbot.from_run";
const UNTIL: &str = "ballbot.until_run";

impl<F: Files + Copy + Sync> Campaign<'_, F> {
    /// What a whole file says of itself: title, program, digest of what it is made of, and of what
    /// this machine makes of run 0. Mathematical functions may differ in the last bit between
    /// machines.
    fn notes(&self) -> Result<Vec<(&'static str, String)>, CampaignError> {
        let first = self.run(0, &|| std::time::Duration::ZERO)?;
        let mut bytes = Vec::new();
        first.iter().for_each(|cell| cell.bytes(&mut bytes));
        Ok(vec![
            (TITLE, self.source().file().title.clone()),
            (PROGRAM, self.program().to_owned()),
            (FINGERPRINT, self.fingerprint().to_owned()),
            (REFERENCE_RUN, hexadecimal(&Sha256::digest(&bytes))),
        ])
    }

    /// Opens the file of all runs, which gets its rows one after the other.
    ///
    /// # Errors
    /// `path` names the file in messages; it does not take what is written.
    pub fn writer<W: Write + Send>(
        &self,
        into: W,
        path: &Path,
    ) -> Result<RowWriter<W>, CampaignError> {
        let writer = RowWriter::new(into, &self.columns(), &self.notes()?);
        writer.map_err(CampaignError::unwritable(path))
    }

    /// Runs a shard and writes its rows.
    ///
    /// # Errors
    /// A run that makes no scenario; `path` names the file in messages, which cannot be written.
    pub fn write_shard<W: Write + Send>(
        &self,
        shard: Shard,
        (into, path): (W, &Path),
        clock: Clock<'_>,
        progress: &(dyn Fn() + Sync),
    ) -> Result<(), CampaignError> {
        let (from, until) = shard.runs(self.runs());
        let mut notes = self.notes()?;
        notes.extend([(FROM, from.to_string()), (UNTIL, until.to_string())]);
        let writer = RowWriter::new(into, &self.columns(), &notes);
        let mut writer = writer.map_err(CampaignError::unwritable(path))?;
        let each = |row: Row| writer.push(row).map_err(CampaignError::unwritable(path));
        self.for_each((from, until), clock, progress, each)?;
        writer.finish().map_err(CampaignError::unwritable(path))?;
        Ok(())
    }

    /// Whether a file is this campaign's shard, whole and by this program.
    ///
    /// # Errors
    /// It is there, and is not.
    pub fn has_shard(&self, folder: &Path, shard: Shard) -> Result<bool, CampaignError> {
        let path = folder.join(shard.file_name());
        if !path.exists() {
            return Ok(false);
        }
        let (file, range) = self.open(&path)?;
        match range == shard.runs(self.runs()) && file.rows() == range.1 - range.0 {
            true => Ok(true),
            false => Err(CampaignError::results(
                &path,
                "it has the runs of another shard; remove it",
            )),
        }
    }

    /// A shard's file that is of this campaign and program, and its runs.
    fn open(&self, path: &Path) -> Result<(RowFile, (u64, u64)), CampaignError> {
        let file = RowFile::open(path)?;
        let note = |key: &str| file.note(key).unwrap_or("(nothing)").to_owned();
        if note(PROGRAM) != self.program() {
            return Err(CampaignError::results(
                path,
                format!(
                    "it was written by {}, this is {}; run all shards with one program",
                    note(PROGRAM),
                    self.program()
                ),
            ));
        }
        if note(FINGERPRINT) != self.fingerprint() {
            return Err(CampaignError::results(
                path,
                "it is of another campaign, or the campaign, its scenario or a file that they name \
                 was changed since; remove it and run again",
            ));
        }
        let number = |key: &str| file.note(key).and_then(|text| text.parse::<u64>().ok());
        match (
            number(FROM),
            number(UNTIL),
            file.columns() == self.columns(),
        ) {
            (Some(from), Some(until), true) if from <= until => Ok((file, (from, until))),
            _ => Err(CampaignError::results(path, "it is no shard of a campaign")),
        }
    }

    /// The shards in a folder, in the order of their runs, which are all runs of the campaign, each
    /// once, and were computed alike.
    ///
    /// # Errors
    /// A file is cut off, of another campaign or program, or run on a machine that computes
    /// otherwise; runs are missing or there twice.
    pub fn shards(&self, folder: &Path) -> Result<Shards, CampaignError> {
        let mut files = Vec::new();
        for path in shard_files(folder)? {
            let (file, range) = self.open(&path)?;
            let first = file.note(REFERENCE_RUN).unwrap_or_default().to_owned();
            // Not the file itself: there may be more than a process can have open.
            files.push((range, file.rows(), first, path));
        }
        files.sort();
        let mut next = 0;
        let mut missing = Vec::new();
        for ((from, until), rows, _, path) in &files {
            if *from < next {
                return Err(CampaignError::Shards(format!(
                    "{}: the runs {from} to {} are there twice; one division into shards goes into \
                     one folder",
                    path.display(),
                    next.min(*until) - 1
                )));
            }
            if *rows != until - from {
                let problem = format!("it has {rows} of {} runs", until - from);
                return Err(CampaignError::results(path, problem));
            }
            missing.extend((*from > next).then(|| format!("{next} to {}", from - 1)));
            next = *until;
        }
        missing.extend((next < self.runs()).then(|| format!("{next} to {}", self.runs() - 1)));
        if !missing.is_empty() {
            return Err(CampaignError::Shards(format!(
                "{}: the runs {} are missing; run their shards, then merge again",
                folder.display(),
                missing.join(", ")
            )));
        }
        if let Some(pair) = files.windows(2).find(|pair| pair[0].2 != pair[1].2) {
            return Err(CampaignError::Shards(format!(
                "{} and {} were run on machines that make different numbers of run 0; run all \
                 shards on machines with the same processor features and mathematical library",
                pair[0].3.display(),
                pair[1].3.display()
            )));
        }
        let files = files.into_iter().map(|(_, _, _, path)| path).collect();
        Ok(Shards { files })
    }
}

/// The files of shards in a folder, in the order of their names.
///
/// # Errors
/// The folder cannot be read.
pub fn shard_files(folder: &Path) -> Result<Vec<PathBuf>, CampaignError> {
    let entries = fs::read_dir(folder).map_err(CampaignError::at(folder))?;
    let mut paths = Vec::new();
    for entry in entries {
        let path = entry.map_err(CampaignError::at(folder))?.path();
        let name = path
            .file_name()
            .and_then(|name| name.to_str())
            .unwrap_or_default();
        if name.starts_with("shard-") && name.ends_with(".parquet") {
            paths.push(path);
        }
    }
    paths.sort();
    Ok(paths)
}

/// Shards that make a whole.
pub struct Shards {
    files: Vec<PathBuf>,
}

impl Shards {
    /// Hands over all rows in their order, a group of them in memory at a time.
    ///
    /// # Errors
    /// A file was changed or cannot be read; what `each` says.
    pub fn for_each<E: From<CampaignError>>(
        &self,
        mut each: impl FnMut(Row) -> Result<(), E>,
    ) -> Result<(), E> {
        let mut next = 0;
        for path in &self.files {
            RowFile::open(path)?.for_each(|row| {
                if row.first() != Some(&Cell::Whole(next)) {
                    let problem = format!("run {next} is not where it should be");
                    return Err(CampaignError::results(path, problem).into());
                }
                next += 1;
                each(row)
            })?;
        }
        Ok(())
    }
}
