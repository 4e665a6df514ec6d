//! The folder that a command writes its results to. A list in it says which files are this program's;
//! others are never touched.

use crate::output::{self, Draft, FileError};
use std::collections::BTreeSet;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// The list of a program's files, one path per line, relative to the folder.
fn list_of(program: &str) -> String {
    format!(".{program}-files")
}

/// A folder for results.
#[derive(Clone, Debug)]
pub struct ResultFolder {
    path: PathBuf,
    /// The program whose results they are.
    program: &'static str,
    /// What is in it that this program wrote.
    ours: BTreeSet<String>,
}

impl ResultFolder {
    /// The folder at `path`, there or not, for a run of `program` that may leave the files `names` in it.
    /// Nothing is made yet.
    ///
    /// # Errors
    /// Nothing can be written there, or one of these files is there and not this program's.
    pub fn open(program: &'static str, path: &Path, names: &[&str]) -> Result<Self, FileError> {
        let list = path.join(list_of(program));
        let ours = match fs::read_to_string(&list) {
            Ok(text) => text.lines().map(str::to_owned).collect(),
            Err(error) if error.kind() == io::ErrorKind::NotFound => BTreeSet::new(),
            // A file where the folder should be is found out below.
            Err(_) if !path.is_dir() => BTreeSet::new(),
            Err(error) => return Err(FileError::at(&list)(error)),
        };
        let folder = Self {
            path: path.to_owned(),
            program,
            ours,
        };
        output::check_writable(&list)?;
        for name in names {
            folder.check(name)?;
        }
        Ok(folder)
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Whether this program may write the file.
    fn check(&self, name: &str) -> Result<(), FileError> {
        let path = self.path.join(name);
        if path.is_dir() {
            return Err(FileError::at(&path)(io::ErrorKind::IsADirectory.into()));
        }
        // What a symbolic link names is for its owner to keep, whether it is there or not.
        if path.symlink_metadata().is_err() || self.ours.contains(name) {
            return Ok(());
        }
        Err(FileError::at(&path)(io::Error::new(
            io::ErrorKind::AlreadyExists,
            format!(
                "it is there, and {} beside it does not say that {} wrote it. Choose \
                 another folder with --out, or move the file away",
                list_of(self.program),
                self.program
            ),
        )))
    }

    /// Lists files of these names, which the program is about to write one by one.
    ///
    /// # Errors
    /// One of them is there and not this program's, or the list cannot be written.
    pub fn claim(&self, names: &[&str]) -> Result<(), FileError> {
        for name in names {
            self.check(name)?;
        }
        let mut list = self.ours.clone();
        list.extend(names.iter().map(|name| (*name).to_owned()));
        let path = self.path.join(list_of(self.program));
        output::write_files(&[(&path, lines(list.iter().map(String::as_str)).as_bytes())])
    }

    /// Writes all files or none, in place of what an earlier run left under `stale` names, and
    /// keeps the list.
    ///
    /// # Errors
    /// A file that is not this program's is in the way, or cannot be written or removed.
    pub fn write(&self, files: &[(String, Vec<u8>)], stale: &[&str]) -> Result<(), FileError> {
        self.write_with(Vec::new(), files, stale)
    }

    /// [`write`](Self::write), after drafts of files in the folder have taken their places.
    ///
    /// # Errors
    /// As [`write`](Self::write).
    pub fn write_with(
        &self,
        drafts: Vec<(&str, Draft)>,
        files: &[(String, Vec<u8>)],
        stale: &[&str],
    ) -> Result<(), FileError> {
        let names = files.iter().map(|(name, _)| name.as_str());
        let written: BTreeSet<&str> = names.chain(drafts.iter().map(|(name, _)| *name)).collect();
        for name in &written {
            self.check(name)?;
        }
        if !drafts.is_empty() {
            // What comes after them may fail, and they are this program's all the same.
            self.claim(&drafts.iter().map(|(name, _)| *name).collect::<Vec<_>>())?;
        }
        for (_, draft) in drafts {
            draft.commit()?;
        }
        let is_stale = |name: &str| stale.contains(&name) && !written.contains(name);
        let kept = self.ours.iter().map(String::as_str);
        let kept = kept
            .filter(|name| !is_stale(name))
            .chain(written.iter().copied());
        let list: BTreeSet<&str> = kept.collect();
        let list = lines(list.into_iter());
        let mut paths: Vec<PathBuf> = files.iter().map(|(name, _)| self.path.join(name)).collect();
        paths.push(self.path.join(list_of(self.program)));
        let contents = files.iter().map(|(_, content)| content.as_slice());
        let contents = contents.chain([list.as_bytes()]);
        let all: Vec<(&Path, &[u8])> = paths.iter().map(PathBuf::as_path).zip(contents).collect();
        output::write_files(&all)?;
        // What an earlier run of another kind left would be taken for this one's.
        for name in self.ours.iter().filter(|name| is_stale(name)) {
            let path = self.path.join(name);
            match fs::remove_file(&path) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => {
                    return Err(FileError::at(&path)(error));
                }
                _ => {}
            }
        }
        Ok(())
    }
}

fn lines<'a>(names: impl Iterator<Item = &'a str>) -> String {
    names.map(|name| format!("{name}\n")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(name: &str) -> (String, Vec<u8>) {
        (name.to_owned(), b"new".to_vec())
    }

    fn names(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).unwrap();
        let name = |entry: io::Result<fs::DirEntry>| entry.unwrap().file_name();
        let mut names: Vec<String> = entries
            .map(|entry| name(entry).into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn files_of_others_are_neither_replaced_nor_removed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path();
        fs::write(path.join("figure.svg"), "mine").unwrap();
        let error = ResultFolder::open("ballbot", path, &["a.csv", "figure.svg"]).unwrap_err();
        assert!(error.to_string().contains("figure.svg"), "{error}");
        assert!(error.to_string().contains("--out"), "{error}");
        // Where its name is not known before the run, it is found out before anything is written.
        let results = ResultFolder::open("ballbot", path, &["a.csv"]).unwrap();
        let files = [file("a.csv"), file("figure.svg")];
        assert!(results.write(&files, &[]).is_err());
        assert_eq!(names(path), ["figure.svg"]);
        // Its name is not enough to be removed.
        results.write(&[file("a.csv")], &["figure.svg"]).unwrap();
        assert_eq!(fs::read_to_string(path.join("figure.svg")).unwrap(), "mine");
    }

    #[test]
    fn what_is_listed_is_replaced_and_removed_when_stale() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("new");
        let all = ["a.csv", "b.csv", "c.csv"];
        let first = ResultFolder::open("ballbot", &path, &all).unwrap();
        assert!(!path.exists());
        first
            .write(&[file("a.csv"), file("b.csv"), file("other.csv")], &all)
            .unwrap();
        fs::write(path.join("c.csv.bak"), "mine").unwrap();
        let second = ResultFolder::open("ballbot", &path, &all).unwrap();
        second.write(&[file("a.csv"), file("c.csv")], &all).unwrap();
        let expected = [".ballbot-files", "a.csv", "c.csv", "c.csv.bak", "other.csv"];
        assert_eq!(names(&path), expected);
        let list = fs::read_to_string(path.join(".ballbot-files")).unwrap();
        assert_eq!(list, "a.csv\nc.csv\nother.csv\n");
    }

    /// The rows stood in their place and in no list, and the next run refused the folder as another's.
    #[test]
    fn an_end_that_fails_leaves_a_folder_that_can_be_used_again() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("new");
        let results = ResultFolder::open("ballbot", &path, &["rows"]).unwrap();
        let draft = Draft::create(&path.join("rows")).unwrap();
        fs::write(path.join("blocked"), "mine").unwrap();
        let files = [file("blocked/summary.json")];
        results
            .write_with(vec![("rows", draft)], &files, &[])
            .unwrap_err();
        let again = ResultFolder::open("ballbot", &path, &["rows"]).unwrap();
        let draft = Draft::create(&path.join("rows")).unwrap();
        again
            .write_with(vec![("rows", draft)], &[file("summary.json")], &[])
            .unwrap();
        assert_eq!(
            names(&path),
            [".ballbot-files", "blocked", "rows", "summary.json"]
        );
    }
}
