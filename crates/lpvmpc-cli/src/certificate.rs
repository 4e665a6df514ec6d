//! `lpvmpc certify` and `lpvmpc verify`.

use crate::arguments::{CertifyArguments, VerifyArguments};
use crate::describe::load;
use crate::error::CommandError;
use crate::experiment::Experiment;
use lpvmpc_any::{MpcSettings, Terminal};
use lpvmpc_certify::{Certificate, CertifySettings, Verified, verify_text};
use lpvmpc_plant::Plant;
use lpvmpc_terminal::output;
use lpvmpc_terminal::progress::ProofProgress;
use lpvmpc_terminal::table::short;
use lpvmpc_words::read_text;
use serde_json::json;
use std::path::{Path, PathBuf};

/// Finds and proves a certificate for the controller of an experiment; its text, or where it was written.
pub fn certify(arguments: &CertifyArguments) -> Result<String, CommandError> {
    let experiment = Experiment::load(&arguments.experiment)?;
    if let Some(out) = &arguments.out {
        output::check_separate(out, experiment.sources().iter().map(PathBuf::as_path))?;
    }
    let settings = &experiment.settings;
    let pair = |limits: &Option<lpvmpc_any::Limits>| {
        let pair = |limits: &lpvmpc_any::Limits| (limits.lower.clone(), limits.upper.clone());
        limits.as_ref().map(pair)
    };
    let asked = CertifySettings {
        q: settings.q.clone(),
        r: settings.r.clone(),
        x_bounds: pair(&settings.x_bounds),
        u_bounds: pair(&settings.u_bounds),
        ..CertifySettings::new(settings.t_s, &[], &[])
    };
    let bar = ProofProgress::default();
    let found = lpvmpc_certify::certify(&experiment.plant, &asked, &|done| bar.set_part(done))?;
    let text = found.to_json()?;
    match &arguments.out {
        None => Ok(text),
        Some(out) => {
            output::write_files(&[(out, text.as_bytes())])?;
            Ok(format!(
                "Proved on {} boxes: the set (x - x_eq)'P (x - x_eq) <= {}. Written: {}\n",
                found.record.boxes,
                short(found.level),
                out.display()
            ))
        }
    }
}

impl Experiment {
    /// The settings of its controller. Where it names a certificate, that is proved before it is relied upon.
    ///
    /// # Errors
    /// The file cannot be read, or what it claims is false, could not be shown, or is of another plant.
    pub fn proved_settings(&self) -> Result<MpcSettings, CommandError> {
        let mut settings = self.settings.clone();
        if let Some(path) = &self.certificate {
            let (certificate, _) = prove(path, &self.plant)?;
            let set = certificate.terminal_set(&self.plant)?;
            settings.terminal = Terminal::Certified(Box::new(set));
        }
        Ok(settings)
    }
}

/// Reads a certificate and proves what it claims.
fn prove(path: &Path, plant: &Plant) -> Result<(Certificate, Verified), CommandError> {
    let text = read_text(path).map_err(|source| CommandError::Read {
        path: path.to_owned(),
        source,
    })?;
    let bar = ProofProgress::default();
    verify_text(&text, plant, &|done| bar.set_part(done)).map_err(|source| {
        CommandError::Certificate {
            path: path.to_owned(),
            source,
        }
    })
}

/// Proves a certificate again.
pub fn verify(arguments: &VerifyArguments) -> Result<String, CommandError> {
    let plant = load(&arguments.plant)?;
    let (_, verified) = prove(&arguments.certificate, &plant)?;
    let states = plant.data().states.iter().zip(&verified.reach);
    if arguments.json {
        let reach = states.map(|(state, reach)| (state.name.clone(), json!(reach)));
        let reach: serde_json::Map<_, _> = reach.collect();
        let document = json!({ "verified": true, "boxes": verified.boxes, "reach": reach });
        return Ok(format!("{document:#}\n"));
    }
    let reach = states.map(|(state, reach)| {
        let text = format!(
            "|{} - x_eq| <= {} {}",
            state.name,
            short(*reach),
            state.unit
        );
        text.trim_end().to_owned()
    });
    let reach: Vec<String> = reach.collect();
    Ok(format!(
        "Proved on {} boxes. In the set {}\n",
        verified.boxes,
        reach.join(", ")
    ))
}
