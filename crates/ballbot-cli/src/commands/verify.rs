//! `ballbot verify`.

use super::CommandError;
use super::certify::{STEPS, summary};
use crate::input::InputError;
use crate::progress::Progress;
use ballbot_scenario::TerminalCertificate;
use clap::Args;
use lpvmpc_design::MOST_BOXES;
use std::path::PathBuf;

/// Arguments of `ballbot verify`.
#[derive(Debug, Args)]
#[command(after_help = "\
Example:
  ballbot verify out/certificate/certificate.json

Proves every claim again from the numbers in the file, without an optimiser. Exits with 1 and
names the claim if one does not hold, or if the file is not as it was written.")]
pub struct VerifyArguments {
    /// A file written by `ballbot certify`
    pub certificate: PathBuf,
}

/// Proves the claims of a certificate again.
///
/// # Errors
/// The file cannot be read, a claim does not hold, or the file was changed.
pub fn run(arguments: &VerifyArguments) -> Result<String, CommandError> {
    let path = &arguments.certificate;
    let text = std::fs::read_to_string(path).map_err(|source| InputError::Read {
        path: path.clone(),
        source,
    })?;
    let certificate = TerminalCertificate::from_json(&text)?;
    let progress = Progress::new("verifying", STEPS);
    let proof = certificate.prove(&certificate.plant, MOST_BOXES, &|done| {
        progress.set((done * STEPS as f64) as usize);
    })?;
    // After the proof, so that a false claim is told by what it claims.
    TerminalCertificate::check_digest(&text)?;
    Ok(format!(
        "{}\nThe certificate holds.\n",
        summary(&certificate, &proof)
    ))
}
