//! The names of files in a scenario that is written to another folder.

use std::path::{Component, Path, PathBuf};

/// What a name of a file, relative to the folder `from`, is relative to the folder `to`; none where
/// there is no such file. Where one folder cannot be told from the other, the whole path.
pub fn name(name: &str, from: &Path, to: &Path) -> Option<String> {
    let path = from.join(name);
    if !path.is_file() || Path::new(name).is_absolute() {
        return None;
    }
    let file = path.canonicalize().ok()?;
    let found = to
        .canonicalize()
        .map_or_else(|_| file.clone(), |to| relative(&file, &to));
    Some(found.to_str()?.to_owned())
}

/// The path of `file` from the folder `from`; both are absolute and without links.
fn relative(file: &Path, from: &Path) -> PathBuf {
    let (file_parts, from_parts): (Vec<_>, Vec<_>) =
        (file.components().collect(), from.components().collect());
    let pairs = file_parts.iter().zip(&from_parts);
    let common = pairs.take_while(|(one, other)| one == other).count();
    if common == 0 {
        return file.to_owned();
    }
    let up = from_parts[common..].iter().map(|_| Component::ParentDir);
    up.chain(file_parts[common..].iter().copied()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn a_file_is_found_again_from_another_folder() {
        let folder = tempfile::tempdir().unwrap();
        let [from, to] = ["a/b", "a/c/d"].map(|name| folder.path().join(name));
        fs::create_dir_all(&from).unwrap();
        fs::create_dir_all(&to).unwrap();
        fs::write(from.join("robot.toml"), "").unwrap();
        let found = name("robot.toml", &from, &to).unwrap();
        assert_eq!(Path::new(&found), Path::new("../../b/robot.toml"));
        assert!(to.join(found).is_file());
        assert_eq!(name("lpv", &from, &to), None);
        let whole = from.join("robot.toml");
        assert_eq!(name(whole.to_str().unwrap(), &from, &to), None);
    }
}
