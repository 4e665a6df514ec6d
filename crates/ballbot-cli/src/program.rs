//! Which program this is, to the build.

use crate::input::InputError;
use sha2::{Digest, Sha256};
use std::path::PathBuf;
use std::{env, fs, io};

/// Version and the first half of the SHA-256 of the program's own file: two builds of one version may
/// compute differently.
///
/// # Errors
/// The program's own file cannot be read.
pub fn name() -> Result<String, InputError> {
    let unreadable = |path: PathBuf| move |source: io::Error| InputError::Read { path, source };
    let path = env::current_exe().map_err(unreadable("ballbot".into()))?;
    let content = fs::read(&path).map_err(unreadable(path))?;
    let digest = Sha256::digest(&content);
    let half: String = digest
        .iter()
        .take(16)
        .map(|byte| format!("{byte:02x}"))
        .collect();
    Ok(format!("ballbot {} {half}", env!("CARGO_PKG_VERSION")))
}
