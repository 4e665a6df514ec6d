//! `ballbot verify`.

use super::CommandError;
use super::certify::{document, summary};
use crate::input::InputError;
use crate::json;
use crate::progress::Progress;
use ballbot_scenario::{TerminalCertificate, proofs};
use clap::Args;
use lpvmpc_certificate::read_certificate;
use std::path::PathBuf;

/// Arguments of `ballbot verify`.
#[derive(Debug, Args)]
#[command(after_help = "\
Example:
  ballbot verify out/certificate/certificate.json

Proves every claim again from the numbers in the file, without an optimiser: for the model with
these numbers, the exact state and no delay. Exits with 1 and names the claim if one is false
(with a state that shows it), if one could not be shown (it may be true all the same), or if the file
is not as it was written.")]
pub struct VerifyArguments {
    /// A file written by `ballbot certify`
    pub certificate: PathBuf,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// Proves the claims of a certificate again.
///
/// # Errors
/// The file cannot be read, a claim is false or could not be shown, or the file was changed.
pub fn run(arguments: &VerifyArguments) -> Result<String, CommandError> {
    let path = &arguments.certificate;
    let text = read_certificate(path).map_err(|source| InputError::Read {
        path: path.clone(),
        source,
    })?;
    let refused = |source| InputError::Certificate {
        path: path.clone(),
        source,
    };
    let certificate = TerminalCertificate::from_json(&text).map_err(refused)?;
    let bar = Progress::of_parts("verifying");
    let proof = proofs::prove(&certificate, &|done| bar.set_part(done))?;
    drop(bar);
    // After the proof, so that a false claim is told by what it claims.
    TerminalCertificate::check_digest(&text).map_err(refused)?;
    if arguments.json {
        return Ok(json::text(&document(&certificate, &proof)));
    }
    Ok(format!(
        "{}\nThe certificate holds, for the model, the exact state and no delay.\n",
        summary(&certificate, &proof)
    ))
}
