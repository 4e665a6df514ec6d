//! Certificates of files: proved when a scenario that relies on one is loaded, once.
//!
//! What was proved is remembered as an empty file in the user's cache folder, whose name is the
//! SHA-256 of the certificate's content and of the program that proved it. So another certificate
//! cannot pass for a proved one. Whoever can write into that folder can claim a proof that was not
//! made; but then he can as well replace the user's files or programs. `ballbot verify` proves
//! whatever is remembered.

use crate::error::ScenarioError;
use crate::file::certificate::TerminalCertificate;
use crate::file::schema::{CsvTable, PointTable};
use crate::prepare::excitation::Excitation;
use crate::prepare::files::Files;
use crate::prepare::known_robot::KnownRobot;
use crate::prepare::standing::Standing;
use lpvmpc_certificate::{ClaimError, MOST_BOXES, PROOF_REVISION, Proof};
use sha2::{Digest, Sha256};
use std::env;
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

/// The files of a folder, with certificates that are proved.
#[derive(Clone, Copy)]
pub struct ProvedFiles<'a> {
    /// The folder that paths are relative to.
    pub folder: &'a Path,
    /// Called with the part of a proof that is done, where one is made.
    pub progress: &'a (dyn Fn(f64) + Sync),
}

impl Files for ProvedFiles<'_> {
    fn reference(&self, file: &CsvTable, duration: f64) -> Result<Vec<PointTable>, ScenarioError> {
        self.folder.reference(file, duration)
    }

    fn certificate(&self, file: Option<&str>) -> Result<TerminalCertificate, ScenarioError> {
        self.folder.certificate(file)
    }

    fn prove(
        &self,
        file: &str,
        certificate: &TerminalCertificate,
    ) -> Result<Standing, ScenarioError> {
        if is_remembered(certificate) {
            return Ok(Standing::Proved);
        }
        let proof = prove(certificate, self.progress);
        proof
            .map(|_| Standing::Proved)
            .map_err(|error| ScenarioError::Value {
                key: "controller.terminal.certified.certificate".to_owned(),
                value: file.to_owned(),
                expected: format!("the certificate {}: {error}", error.verdict()),
            })
    }

    fn robot(&self, file: &Path) -> Result<KnownRobot, ScenarioError> {
        self.folder.robot(file)
    }

    fn excitation(&self, file: &Path) -> Result<Excitation, ScenarioError> {
        self.folder.excitation(file)
    }
}

/// Proves a certificate, which takes minutes on all cores, and remembers that it did. `progress` is
/// called with the part that is done.
///
/// # Errors
/// The first claim that is false or could not be shown.
pub fn prove(
    certificate: &TerminalCertificate,
    progress: &dyn Fn(f64),
) -> Result<Proof<4>, ClaimError> {
    let proof = certificate.prove(&certificate.plant, MOST_BOXES, progress)?;
    remember(certificate);
    Ok(proof)
}

/// Remembers that this certificate was proved. Where that cannot be written, it is proved again next
/// time.
pub fn remember(certificate: &TerminalCertificate) {
    if let Some(path) = place(certificate) {
        let folder = path.parent().map_or(Ok(()), fs::create_dir_all);
        let _ = folder.and_then(|()| fs::write(path, ""));
    }
}

fn is_remembered(certificate: &TerminalCertificate) -> bool {
    place(certificate).is_some_and(|path| path.is_file())
}

/// Where it stands that a certificate was proved; `None` where nothing can be remembered.
fn place(certificate: &TerminalCertificate) -> Option<PathBuf> {
    let content = certificate.to_json().ok()?;
    let program = concat!("ballbot ", env!("CARGO_PKG_VERSION"));
    let mut hash = Sha256::new();
    hash.update(format!("{program}, proof {PROOF_REVISION}\n{content}"));
    let mut name = String::new();
    for byte in hash.finalize() {
        write!(name, "{byte:02x}").ok()?;
    }
    Some(cache_folder()?.join("proved").join(name))
}

/// The folder of the XDG base directory specification, in which a path that is not absolute counts
/// as none.
fn cache_folder() -> Option<PathBuf> {
    let absolute = |path: PathBuf| path.is_absolute().then_some(path);
    let named = |variable| env::var_os(variable).map(PathBuf::from).and_then(absolute);
    let folder = named("XDG_CACHE_HOME").or_else(|| Some(named("HOME")?.join(".cache")))?;
    Some(folder.join("ballbot"))
}
