//! What leaves the program: files, standard output, messages.

use crate::commands::CommandError;
use std::ffi::OsString;
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// A file that could not be written.
#[derive(Debug, thiserror::Error)]
#[error("cannot write {}: {source}", path.display())]
pub struct FileError {
    /// The file that was to be written.
    pub path: PathBuf,
    /// What the file system said.
    pub source: io::Error,
}

/// Writes every file under a temporary name beside its place, then renames them all. When one
/// cannot be written, none of the old files is touched and no temporary file stays behind.
/// Directories that are missing are made.
///
/// # Errors
/// The first file that could not be written or renamed.
pub fn write_files(files: &[(&Path, &[u8])]) -> Result<(), FileError> {
    let temporary: Vec<PathBuf> = files.iter().map(|(path, _)| temporary(path)).collect();
    let result = write_then_rename(files, &temporary);
    if result.is_err() {
        for path in &temporary {
            // It may not exist; the error to report is the one that led here.
            let _ = fs::remove_file(path);
        }
    }
    result
}

/// Removes files, those that are there.
///
/// # Errors
/// The first file that could not be removed.
pub fn remove_files(paths: impl IntoIterator<Item = PathBuf>) -> Result<(), FileError> {
    for path in paths {
        match fs::remove_file(&path) {
            Err(source) if source.kind() != io::ErrorKind::NotFound => {
                return Err(FileError { path, source });
            }
            _ => {}
        }
    }
    Ok(())
}

fn write_then_rename(files: &[(&Path, &[u8])], temporary: &[PathBuf]) -> Result<(), FileError> {
    let failed = |path: &Path| {
        let path = path.to_owned();
        move |source| FileError { path, source }
    };
    for ((path, content), temporary) in files.iter().zip(temporary) {
        if let Some(directory) = path.parent() {
            fs::create_dir_all(directory).map_err(failed(path))?;
        }
        if path.is_dir() {
            // Found out when renaming, it would be too late for the files before it.
            return Err(failed(path)(io::ErrorKind::IsADirectory.into()));
        }
        fs::write(temporary, content).map_err(failed(path))?;
    }
    for ((path, _), temporary) in files.iter().zip(temporary) {
        fs::rename(temporary, path).map_err(failed(path))?;
    }
    Ok(())
}

/// A name in the same directory, so that the renaming stays within one file system.
fn temporary(path: &Path) -> PathBuf {
    let mut name = OsString::from(".");
    name.push(path.file_name().unwrap_or_default());
    name.push(format!(".{}.part", std::process::id()));
    path.with_file_name(name)
}

/// Prints the text of a command that has done its work. A reader that has seen enough, such as
/// `head`, is no failure.
pub fn print(text: &str) -> ExitCode {
    let mut output = io::stdout().lock();
    let written = output.write_all(text.as_bytes());
    match written.and_then(|()| output.flush()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => ExitCode::SUCCESS,
        Err(error) => complain(&format!("cannot write to standard output: {error}")),
    }
}

/// Reports why a command has no result.
pub fn fail(error: &CommandError) -> ExitCode {
    let code = complain(&error.to_string());
    match error {
        CommandError::Usage(_) => ExitCode::from(2),
        _ => code,
    }
}

fn complain(message: &str) -> ExitCode {
    // Where standard error is closed there is nobody to tell.
    let _ = writeln!(io::stderr(), "error: {message}");
    ExitCode::FAILURE
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_changes_when_one_file_fails() {
        let folder = tempfile::tempdir().unwrap();
        let good = folder.path().join("good.svg");
        fs::write(&good, "old").unwrap();
        // A file stands where the directory should be.
        let bad = good.join("bad.svg");
        let error = write_files(&[(&good, b"new"), (&bad, b"new")]).unwrap_err();
        assert_eq!(error.path, bad);
        assert!(error.to_string().contains("bad.svg"), "{error}");
        assert_eq!(fs::read_to_string(&good).unwrap(), "old");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn nothing_changes_when_a_directory_is_in_the_way() {
        let folder = tempfile::tempdir().unwrap();
        let good = folder.path().join("good.svg");
        fs::write(&good, "old").unwrap();
        let bad = folder.path().join("bad.svg");
        fs::create_dir(&bad).unwrap();
        // It was once found when renaming, after the files before it had been replaced.
        let error = write_files(&[(&good, b"new"), (&bad, b"new")]).unwrap_err();
        assert_eq!(error.path, bad);
        assert_eq!(fs::read_to_string(&good).unwrap(), "old");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
    }

    #[test]
    fn files_are_replaced_and_nothing_else_is_left() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.svg");
        fs::write(&path, "old").unwrap();
        write_files(&[(&path, b"new")]).unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "new");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn missing_directories_are_made() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("runs").join("first").join("a.svg");
        write_files(&[(&path, b"new")]).unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "new");
    }
}
