//! Files that are written whole, or not at all.

use std::ffi::OsString;
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// A file that could not be written.
#[derive(Debug, thiserror::Error)]
#[error("cannot write {}: {source}", path.display())]
pub struct FileError {
    /// The file that was to be written.
    pub path: PathBuf,
    /// What the file system said.
    pub source: io::Error,
}

impl FileError {
    /// For `map_err`, with the path.
    pub fn at(path: &Path) -> impl Fn(io::Error) -> Self {
        move |source| Self {
            path: path.to_owned(),
            source,
        }
    }
}

/// What is on its way to the disk. Who writes files holds it, so that an interrupt comes before or
/// after.
static WRITES: Mutex<Writes> = Mutex::new(Writes {
    temporary: Vec::new(),
    drafts: Vec::new(),
    draft_folders: Vec::new(),
    folders: Vec::new(),
    done: Vec::new(),
});

pub(super) struct Writes {
    /// Files under temporary names.
    temporary: Vec<PathBuf>,
    /// Drafts under temporary names.
    pub(super) drafts: Vec<PathBuf>,
    /// Folders made for drafts, the outer ones first.
    draft_folders: Vec<PathBuf>,
    /// Folders made for the other files, the outer ones first.
    folders: Vec<PathBuf>,
    /// Files that are in their places.
    pub(super) done: Vec<PathBuf>,
}

impl Writes {
    pub(super) fn lock() -> MutexGuard<'static, Self> {
        // A list of paths is as good after a panic as before it.
        WRITES.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Begins a draft under its temporary name.
    pub(super) fn begin(&mut self, file: &Path, temporary: &Path) -> io::Result<fs::File> {
        if let Some(folder) = file.parent() {
            make(folder, &mut self.draft_folders)?;
        }
        let opened = fs::File::create(temporary)?;
        self.drafts.push(temporary.to_owned());
        Ok(opened)
    }

    /// Takes away the folders that were made for drafts and hold nothing.
    pub(super) fn leave_drafts(&mut self) {
        let made = std::mem::take(&mut self.draft_folders).into_iter().rev();
        let kept = made.filter(|folder| fs::remove_dir(folder).is_err());
        let kept: Vec<PathBuf> = kept.collect();
        if !self.drafts.is_empty() {
            self.draft_folders = kept.into_iter().rev().collect();
        }
    }

    /// Takes away what is not in its place, and the folders that were made for it alone.
    fn take_back(&mut self) {
        for file in self.temporary.drain(..) {
            // It may not exist; what is reported is what led here.
            let _ = fs::remove_file(file);
        }
        for folder in self.folders.drain(..).rev() {
            // One with something in it stays.
            let _ = fs::remove_dir(folder);
        }
    }
}

/// Makes the folder and those above it that are missing, and adds them to those that were `made`.
fn make(folder: &Path, made: &mut Vec<PathBuf>) -> io::Result<()> {
    let missing = folder
        .ancestors()
        .take_while(|above| !above.as_os_str().is_empty() && above.symlink_metadata().is_err());
    let missing: Vec<PathBuf> = missing.map(Path::to_owned).collect();
    made.extend(missing.into_iter().rev());
    fs::create_dir_all(folder)
}

/// Ends all writing, for a program that is about to end: what is half-written goes. Returns the files
/// that were written.
pub fn abandon() -> Vec<PathBuf> {
    let mut writes = Writes::lock();
    let drafts = std::mem::take(&mut writes.drafts);
    writes.temporary.extend(drafts);
    let folders = std::mem::take(&mut writes.draft_folders);
    writes.folders.extend(folders);
    writes.take_back();
    let done = std::mem::take(&mut writes.done);
    // Nothing is written from here on.
    std::mem::forget(writes);
    done
}

/// Adds to the end of a file that grows while a command works, on the disk: an interrupt comes before
/// or after.
///
/// # Errors
/// The file system refuses.
pub fn append(path: &Path, mut file: &fs::File, text: &str) -> Result<(), FileError> {
    let mut writes = Writes::lock();
    let written = file.write_all(text.as_bytes());
    written
        .and_then(|()| file.sync_data())
        .map_err(FileError::at(path))?;
    if !writes.done.iter().any(|done| done == path) {
        writes.done.push(path.to_owned());
    }
    Ok(())
}

/// Writes every file under a temporary name beside its place, then renames them all. When one
/// cannot be written, none of the old files is touched and no temporary file stays behind.
/// Directories that are missing are made. A symbolic link stays, and the file that it names is
/// written; what is neither a file nor a directory (a pipe, a device) is written into, before any
/// file is renamed.
///
/// # Errors
/// The first file that could not be written or renamed.
pub fn write_files(files: &[(&Path, &[u8])]) -> Result<(), FileError> {
    let places = files.iter().map(|(path, _)| Place::of(path));
    let places = places.collect::<Result<Vec<_>, _>>()?;
    // Before the lock is taken: a pipe may wait for its reader, and must not keep an interrupt waiting.
    for ((path, content), place) in files.iter().zip(&places) {
        if let Place::Special = place {
            let opened = fs::OpenOptions::new().write(true).open(path);
            let written = opened.and_then(|mut special| special.write_all(content));
            written.map_err(FileError::at(path))?;
            Writes::lock().done.push(path.to_path_buf());
        }
    }
    let mut writes = Writes::lock();
    let result = write_then_rename(files, &places, &mut writes);
    writes.take_back();
    result
}

/// Whether a file could be written, as far as can be told without leaving anything behind.
///
/// # Errors
/// A directory is in its place, or a file in that of a directory above it; or nothing can be
/// written there.
pub fn check_writable(path: &Path) -> Result<(), FileError> {
    let Place::File { file, temporary } = Place::of(path)? else {
        return Ok(());
    };
    let above = file.ancestors().skip(1);
    let folder = above
        .map(|folder| match folder {
            folder if folder.as_os_str().is_empty() => Path::new("."),
            folder => folder,
        })
        .find(|folder| folder.symlink_metadata().is_ok());
    let folder = folder.unwrap_or(Path::new("."));
    let attempt = folder.join(temporary.file_name().unwrap_or_default());
    let _writes = Writes::lock();
    let tried = fs::write(&attempt, "").and_then(|()| fs::remove_file(&attempt));
    tried.map_err(FileError::at(path))
}

/// The same of a file that is none of `others`: those that the command reads, or writes besides.
///
/// # Errors
/// As [`check_writable`]; or it is one of them, which would be lost.
pub fn check_separate<'a>(
    path: &Path,
    others: impl IntoIterator<Item = &'a Path>,
) -> Result<(), FileError> {
    // One that is not there yet has no other name by which it could be there, the folders above it apart.
    let place = |path: &Path| {
        let whole = std::path::absolute(path).ok()?;
        let mut missing = Vec::new();
        for above in whole.ancestors() {
            if let Ok(real) = above.canonicalize() {
                return Some(
                    missing
                        .into_iter()
                        .rev()
                        .fold(real, |path, name| path.join(name)),
                );
            }
            missing.push(above.file_name()?);
        }
        None
    };
    let there = place(path);
    if there.is_some() && others.into_iter().any(|other| place(other) == there) {
        let problem = "this command reads or writes it as something else, which would be lost";
        return Err(FileError::at(path)(io::Error::other(problem)));
    }
    check_writable(path)
}

/// Where a path leads.
pub(super) enum Place {
    /// To a file, there or not, which is replaced by one written beside it.
    File { file: PathBuf, temporary: PathBuf },
    /// To a pipe or a device.
    Special,
}

/// Symbolic links followed, one after the other, before it must be a circle.
const MOST_LINKS: usize = 40;

impl Place {
    pub(super) fn of(path: &Path) -> Result<Self, FileError> {
        let mut file = path.to_owned();
        for _ in 0..MOST_LINKS {
            match fs::read_link(&file) {
                Ok(target) => file = file.parent().unwrap_or(Path::new("")).join(target),
                Err(_) => {
                    return match fs::metadata(&file) {
                        Ok(found) if found.is_dir() => {
                            Err(FileError::at(path)(io::ErrorKind::IsADirectory.into()))
                        }
                        Ok(found) if !found.is_file() => Ok(Self::Special),
                        _ => {
                            let temporary = temporary(&file);
                            Ok(Self::File { file, temporary })
                        }
                    };
                }
            }
        }
        Err(FileError::at(path)(io::Error::other(
            "its symbolic links lead in a circle",
        )))
    }
}

fn write_then_rename(
    files: &[(&Path, &[u8])],
    places: &[Place],
    writes: &mut Writes,
) -> Result<(), FileError> {
    for ((path, content), place) in files.iter().zip(places) {
        if let Place::File { file, temporary } = place {
            if let Some(directory) = file.parent() {
                make(directory, &mut writes.folders).map_err(FileError::at(path))?;
            }
            writes.temporary.push(temporary.clone());
            fs::write(temporary, content).map_err(FileError::at(path))?;
            if let Ok(old) = fs::metadata(file) {
                fs::set_permissions(temporary, old.permissions()).map_err(FileError::at(path))?;
            }
        }
    }
    for ((path, _), place) in files.iter().zip(places) {
        if let Place::File { file, temporary } = place {
            fs::rename(temporary, file).map_err(FileError::at(path))?;
            writes.done.push(path.to_path_buf());
        }
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
    fn folders_that_were_made_in_vain_are_taken_away() {
        let folder = tempfile::tempdir().unwrap();
        let good = folder.path().join("new").join("deep").join("good.svg");
        let full = folder.path().join("file");
        fs::write(&full, "mine").unwrap();
        assert!(write_files(&[(&good, b"new"), (&full.join("bad.svg"), b"new")]).is_err());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
        write_files(&[(&good, b"new")]).unwrap();
        assert_eq!(fs::read_to_string(&good).unwrap(), "new");
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

    #[cfg(unix)]
    #[test]
    fn links_stay_links_and_special_files_are_written_into() {
        use std::os::unix::fs::{PermissionsExt, symlink};
        let folder = tempfile::tempdir().unwrap();
        let (target, link) = (folder.path().join("target"), folder.path().join("link"));
        fs::write(&target, "old").unwrap();
        fs::set_permissions(&target, fs::Permissions::from_mode(0o600)).unwrap();
        symlink("target", &link).unwrap();
        write_files(&[(&link, b"new")]).unwrap();
        assert!(link.is_symlink());
        assert_eq!(fs::read_to_string(&target).unwrap(), "new");
        let mode = fs::metadata(&target).unwrap().permissions().mode();
        assert_eq!(mode & 0o777, 0o600);

        let dangling = folder.path().join("dangling");
        symlink("later", &dangling).unwrap();
        write_files(&[(&dangling, b"new")]).unwrap();
        assert!(dangling.is_symlink());
        assert!(folder.path().join("later").is_file());

        let circle = folder.path().join("circle");
        symlink("circle", &circle).unwrap();
        assert!(write_files(&[(&circle, b"new")]).is_err());

        // A file system is not asked to rename over a device.
        let null = Path::new("/dev/null");
        write_files(&[(null, b"new")]).unwrap();
        assert!(!fs::metadata(null).unwrap().is_file());
        let full = folder.path().join("full");
        symlink("/dev/full", &full).unwrap();
        let error = write_files(&[(&full, b"new")]).unwrap_err();
        assert_eq!(error.source.kind(), io::ErrorKind::StorageFull);
        assert!(full.is_symlink());
    }

    #[test]
    fn a_check_leaves_nothing_behind() {
        let folder = tempfile::tempdir().unwrap();
        check_writable(&folder.path().join("a").join("b").join("c.csv")).unwrap();
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
        let file = folder.path().join("file");
        fs::write(&file, "mine").unwrap();
        check_writable(&file).unwrap();
        assert_eq!(fs::read_to_string(&file).unwrap(), "mine");
        assert!(check_writable(&file.join("below.csv")).is_err());
        assert!(check_writable(folder.path()).is_err());
    }

    #[test]
    fn a_file_that_is_read_is_not_written() {
        let folder = tempfile::tempdir().unwrap();
        let (file, above) = (folder.path().join("in.toml"), folder.path().join("a"));
        fs::write(&file, "mine").unwrap();
        fs::create_dir(&above).unwrap();
        let roundabout = above.join("..").join("in.toml");
        let error = check_separate(&roundabout, [file.as_path()]).unwrap_err();
        assert!(error.to_string().contains("would be lost"), "{error}");
        let (new, same) = (folder.path().join("out"), above.join("..").join("out"));
        assert!(check_separate(&new, [same.as_path()]).is_err());
        // In a folder that is still to be made.
        let below = folder.path().join("new").join("log.csv");
        assert!(check_separate(&below, [below.as_path()]).is_err());
        check_separate(&new, [file.as_path(), Path::new("single-setpoint")]).unwrap();
        check_separate(&file, [new.as_path()]).unwrap();
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
