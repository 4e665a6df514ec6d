//! The journal of a tuning on the disk.

use crate::commands::CommandError;
use crate::output::{self, FileError};
use ballbot_tuning::Journal;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// Its name.
pub const JOURNAL: &str = "journal.jsonl";

/// A journal that one process writes to.
pub struct JournalFile {
    path: PathBuf,
    file: File,
}

impl JournalFile {
    /// Opens the journal in a folder, or begins one, and reads it.
    ///
    /// # Errors
    /// It is of another tuning, was changed, or another process writes to it.
    pub fn open(folder: &Path, fingerprint: &str) -> Result<(Self, Journal), CommandError> {
        let path = folder.join(JOURNAL);
        fs::create_dir_all(folder).map_err(FileError::at(folder))?;
        let mut options = OpenOptions::new();
        options.read(true).write(true).create(true).truncate(false);
        let mut file = options.open(&path).map_err(FileError::at(&path))?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                let problem = "another process is at this tuning; wait for it, or choose another \
                               folder with --out";
                return Err(FileError::at(&path)(std::io::Error::other(problem)).into());
            }
            Err(TryLockError::Error(error)) => return Err(FileError::at(&path)(error).into()),
        }
        let mut text = String::new();
        file.read_to_string(&mut text)
            .map_err(FileError::at(&path))?;
        let mut journal = Journal::read(&text, fingerprint)?;
        // The line that was being written when its process ended goes.
        let end = file.set_len(journal.length as u64);
        end.and_then(|()| file.seek(SeekFrom::End(0)))
            .map_err(FileError::at(&path))?;
        let opened = Self { path, file };
        if journal.length == 0 {
            let (empty, first) = Journal::new(fingerprint);
            opened.append(&first)?;
            journal = empty;
        }
        Ok((opened, journal))
    }

    /// Adds lines.
    ///
    /// # Errors
    /// The file system refuses.
    pub fn append(&self, text: &str) -> Result<(), CommandError> {
        match text {
            "" => Ok(()),
            text => Ok(output::append(&self.path, &self.file, text)?),
        }
    }
}
