//! A file that is written bit by bit.

use super::files::{FileError, Place, Writes};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// A file that is written bit by bit, and takes its place when it is whole. One that is dropped before
/// leaves nothing behind, nor a folder that was made for it.
#[derive(Debug)]
pub struct Draft {
    path: PathBuf,
    /// Where it is until then.
    temporary: PathBuf,
    file: fs::File,
}

impl Draft {
    /// A draft of the file at `path`. Directories that are missing are made.
    ///
    /// # Errors
    /// Nothing can be written there, or a directory is in its place.
    pub fn create(path: &Path) -> Result<Self, FileError> {
        let (file, temporary) = match Place::of(path)? {
            Place::File { file, temporary } => (file, temporary),
            Place::Special => {
                let problem = "it is no file, and what stands there cannot be replaced";
                return Err(FileError::at(path)(io::Error::other(problem)));
            }
        };
        let mut writes = Writes::lock();
        match writes.begin(&file, &temporary) {
            Ok(opened) => Ok(Self {
                path: file,
                temporary,
                file: opened,
            }),
            Err(error) => {
                writes.leave_drafts();
                Err(FileError::at(path)(error))
            }
        }
    }

    /// What is written into.
    pub fn file(&self) -> &fs::File {
        &self.file
    }

    /// Where it is until it takes its place.
    pub fn temporary(&self) -> &Path {
        &self.temporary
    }

    /// Puts it into its place, on the disk.
    ///
    /// # Errors
    /// The file system refuses.
    pub fn commit(self) -> Result<(), FileError> {
        self.file.sync_all().map_err(FileError::at(&self.path))?;
        let mut writes = Writes::lock();
        fs::rename(&self.temporary, &self.path).map_err(FileError::at(&self.path))?;
        writes.done.push(self.path.clone());
        Ok(())
    }
}

impl Drop for Draft {
    fn drop(&mut self) {
        let mut writes = Writes::lock();
        writes.drafts.retain(|draft| *draft != self.temporary);
        // Of one that has taken its place there is none.
        let _ = fs::remove_file(&self.temporary);
        writes.leave_drafts();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    #[test]
    fn a_draft_takes_its_place_when_it_is_whole() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("new").join("rows");
        let draft = Draft::create(&path).unwrap();
        (&mut draft.file()).write_all(b"half").unwrap();
        assert!(!path.exists());
        // A folder that was made for drafts alone goes with the last of them.
        let other = Draft::create(&folder.path().join("new").join("deep").join("more")).unwrap();
        drop(draft);
        drop(other);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
        let draft = Draft::create(&path).unwrap();
        (&mut draft.file()).write_all(b"whole").unwrap();
        draft.commit().unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "whole");
        assert!(Draft::create(folder.path()).is_err());
        assert!(Draft::create(Path::new("/dev/null")).is_err());
    }
}
