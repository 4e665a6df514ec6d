//! `lpvmpc firmware`: the controller as a program for a microcontroller.

use crate::arguments::FirmwareArguments;
use crate::error::CommandError;
use crate::experiment::Experiment;
use lpvmpc_any::{Demonstration, MpcError};
use lpvmpc_words::read_text;
use std::path::Path;

/// Prints the controller of an experiment; where it was written.
pub fn run(arguments: &FirmwareArguments) -> Result<String, CommandError> {
    let experiment = Experiment::load(&arguments.experiment)?;
    let shown = Demonstration {
        lpvmpc: crate_folder(&arguments.lpvmpc)?,
        start: experiment.x0.clone(),
        target: experiment.references.last().map(|last| last.x.clone()),
        samples: experiment.samples,
    };
    if experiment.certificate.is_some() {
        let place = "certificate".to_owned();
        let fault = "on a microcontroller it must be left out: there is no guaranteed loop".into();
        return Err(experiment.refused("controller", &MpcError { place, fault }));
    }
    if experiment.estimator.is_some() {
        let place = "estimator".to_owned();
        let fault = "on a microcontroller it must be left out".into();
        return Err(experiment.refused("controller", &MpcError { place, fault }));
    }
    let (plant, printed) = lpvmpc_any::firmware(&experiment.plant, &experiment.settings, &shown)
        .map_err(|error| experiment.refused("controller", &error))?;
    let out = &arguments.out;
    let written = plant.save_firmware(&printed, out);
    written.map_err(|error| CommandError::NoResult(error.to_string()))?;
    Ok(format!(
        "Written: {}, a crate for `cargo build --release` in it\n",
        out.display()
    ))
}

/// The absolute path of the crate lpvmpc, as a Cargo.toml elsewhere must have it.
fn crate_folder(given: &Path) -> Result<String, CommandError> {
    let manifest = given.join("Cargo.toml");
    let text = read_text(&manifest).map_err(|source| CommandError::Read {
        path: manifest.clone(),
        source,
    })?;
    if !text.lines().any(|line| line.trim() == "name = \"lpvmpc\"") {
        return Err(CommandError::NoResult(format!(
            "{} is not that of the crate lpvmpc; --lpvmpc takes the folder crates/lpvmpc of a checkout",
            manifest.display()
        )));
    }
    let whole = given.canonicalize().map_err(|source| CommandError::Read {
        path: given.to_owned(),
        source,
    })?;
    Ok(whole.display().to_string())
}
