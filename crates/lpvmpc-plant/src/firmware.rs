//! A program for a microcontroller around a plant.

use crate::data::Signal;
use crate::error::PlantError;
use crate::operation::Operation;
use crate::plant::Plant;
use crate::source::{text, type_name};
use std::path::Path;

/// What the controller of a printed program is set to. All numbers are in the units of the plant.
#[derive(Debug, Clone, PartialEq)]
pub struct FirmwareSettings {
    /// Where the crate `lpvmpc` is, as it is to stand in the program's Cargo.toml.
    pub lpvmpc: String,
    /// Sampling time, s.
    pub t_s: f64,
    /// Samples of the horizon.
    pub horizon: usize,
    /// Weights of the states, the diagonal of Q.
    pub q: Vec<f64>,
    /// Weights of the inputs, the diagonal of R.
    pub r: Vec<f64>,
    /// Cost beyond the horizon, the rows of P.
    pub p: Vec<Vec<f64>>,
    /// Where the plant is to go.
    pub target: Vec<f64>,
    /// Where its demonstration begins.
    pub start: Vec<f64>,
    /// Samples of the demonstration.
    pub samples: usize,
}

/// The files of a program, by their paths in its folder.
pub type Files = Vec<(&'static str, String)>;

impl Plant {
    /// A program in `f32` for a Cortex-M4F that controls this plant: a whole crate, for `cargo build` and, on an
    /// emulated board, `cargo run`. The bounds are those of the plant, of states soft ones.
    ///
    /// # Errors
    /// A list of `settings` does not fit the plant, or a number has no place in an `f32`.
    pub fn to_firmware(&self, settings: &FirmwareSettings) -> Result<Files, PlantError> {
        let data = self.data();
        let (states, inputs) = (data.states.len(), data.inputs.len());
        if inputs == 0 {
            return Err(PlantError::new(
                "inputs",
                "there is none to control the plant with",
            ));
        }
        for (name, list, count) in [
            ("q", &settings.q, states),
            ("r", &settings.r, inputs),
            ("target", &settings.target, states),
            ("start", &settings.start, states),
        ] {
            fits(name, list, count)?;
        }
        does_not_vanish("q", &settings.q)?;
        does_not_vanish("r", &settings.r)?;
        if settings.p.len() != states {
            let fault = format!("{} rows for {states} states", settings.p.len());
            return Err(PlantError::new("p", fault));
        }
        for (i, row) in settings.p.iter().enumerate() {
            fits(&format!("p[{i}]"), row, states)?;
        }
        for (parameter, value) in data.parameters.iter().zip(self.parameters()) {
            fits(&format!("parameter {}", parameter.name), &[*value], 1)?;
        }
        for (i, operation) in data.operations.iter().enumerate() {
            if let Operation::Constant(value) = operation {
                fits(&format!("operations[{i}]"), &[*value], 1)?;
            }
        }
        fits("t_s", &[settings.t_s], 1)?;
        if settings.t_s as f32 <= 0.0 {
            let fault = format!("{:?} s is no time between samples", settings.t_s);
            return Err(PlantError::new("t_s", fault));
        }
        if let Some(period) = data.period
            && settings.t_s != period
        {
            let fault = format!("{} s, but the plant's period is {period} s", settings.t_s);
            return Err(PlantError::new("t_s", fault));
        }
        if settings.horizon == 0 {
            return Err(PlantError::new("horizon", "it has at least one sample"));
        }
        // With its module: the program has types of its own.
        let name = format!("plant::{}", type_name(&data.name));
        let (schedulings, model, make) = match &data.embedding {
            Some(embedding) => (
                embedding.scheduling.len(),
                name.clone(),
                format!("{name}::default()"),
            ),
            None => (
                states + inputs,
                format!("lpvmpc::AlongMotion<{name}, NS>"),
                format!("lpvmpc::AlongMotion({name}::default())"),
            ),
        };
        let [x_lower, x_upper] = bounds("states", &data.states)?;
        let [u_lower, u_upper] = bounds("inputs", &data.inputs)?;
        let bounded = { x_lower.iter() }
            .zip(&x_upper)
            .filter(|(lower, upper)| lower.is_finite() || upper.is_finite())
            .count();
        let soft = format!(
            ".soft_bounds(Bounds {{\n        lower: SVector::from([{}]),\n        upper: SVector::from([{}]),\n    }})",
            list(&x_lower),
            list(&x_upper),
        );
        let rows: Vec<String> = settings
            .p
            .iter()
            .map(|row| format!("        [{}],", list(row)))
            .collect();
        let values = [
            ("TEXT", text(&data.name)),
            ("NX", states.to_string()),
            ("NU", inputs.to_string()),
            ("NS", schedulings.to_string()),
            ("HORIZON", settings.horizon.to_string()),
            ("SAMPLES", settings.samples.to_string()),
            (
                "ACTIVE",
                (settings.horizon * (inputs + bounded) + states).to_string(),
            ),
            ("T_S", number(settings.t_s)),
            ("TARGET", list(&settings.target)),
            ("START", list(&settings.start)),
            ("MODEL", model),
            ("MAKE", make),
            ("Q", list(&settings.q)),
            ("R", list(&settings.r)),
            ("P", rows.join("\n")),
            ("U_LOWER", list(&u_lower)),
            ("U_UPPER", list(&u_upper)),
            ("X", if bounded > 0 { soft } else { String::new() }),
            ("CRATE", "plant-controller".to_owned()),
            ("LPVMPC", format!("{:?}", settings.lpvmpc)),
        ];
        let fill = |template: &str| {
            { values.iter() }.fold(template.to_owned(), |text, (key, value)| {
                text.replace(&format!("@{key}@"), value)
            })
        };
        Ok(vec![
            ("Cargo.toml", fill(include_str!("firmware/Cargo.toml.txt"))),
            (
                ".cargo/config.toml",
                include_str!("firmware/config.toml.txt").to_owned(),
            ),
            (
                "build.rs",
                // It has no examples.
                { include_str!("../../../firmware/build.rs").lines() }
                    .filter(|line| !line.contains("rustc-link-arg-examples"))
                    .map(|line| format!("{line}\n"))
                    .collect(),
            ),
            (
                "memory.x",
                include_str!("../../../firmware/board/memory.x").to_owned(),
            ),
            ("src/main.rs", fill(include_str!("firmware/main.rs.txt"))),
            (
                "src/failure.rs",
                include_str!("../../../firmware/src/bin/measure/failure.rs").to_owned(),
            ),
            ("src/plant.rs", self.to_rust()),
        ])
    }

    /// Writes the files of [`Self::to_firmware`] into a new `folder`.
    ///
    /// # Errors
    /// As that; or the folder is there already, or cannot be written.
    pub fn save_firmware(
        &self,
        settings: &FirmwareSettings,
        folder: impl AsRef<Path>,
    ) -> Result<(), PlantError> {
        let files = self.to_firmware(settings)?;
        let folder = folder.as_ref();
        if folder.symlink_metadata().is_ok() {
            let fault = "it is there already; a program goes into a new folder";
            return Err(PlantError::new(folder.display().to_string(), fault));
        }
        // Whole or not at all: written beside its place.
        let mut name = folder.file_name().unwrap_or_default().to_owned();
        name.push(format!(".{}.part", std::process::id()));
        let beside = folder.with_file_name(name);
        let written = write(&beside, &files).and_then(|()| {
            std::fs::rename(&beside, folder).map_err(|error| failed(folder, &error))
        });
        if written.is_err() {
            // What is left over is in nobody's way.
            let _ = std::fs::remove_dir_all(&beside);
        }
        written
    }
}

/// Writes the files into a new `folder`.
fn write(folder: &Path, files: &Files) -> Result<(), PlantError> {
    std::fs::create_dir(folder).map_err(|error| failed(folder, &error))?;
    for (path, content) in files {
        let path = folder.join(path);
        if let Some(parent) = path.parent() {
            std::fs::create_dir_all(parent).map_err(|error| failed(parent, &error))?;
        }
        std::fs::write(&path, content).map_err(|error| failed(&path, &error))?;
    }
    Ok(())
}

fn failed(path: &Path, error: &std::io::Error) -> PlantError {
    PlantError::new(path.display().to_string(), error.to_string())
}

/// `count` numbers that are finite in `f32`, too.
fn fits(place: &str, list: &[f64], count: usize) -> Result<(), PlantError> {
    if list.len() != count {
        let fault = format!("{} numbers where {count} are needed", list.len());
        return Err(PlantError::new(place, fault));
    }
    match list.iter().find(|value| !(**value as f32).is_finite()) {
        Some(value) => Err(PlantError::new(
            place,
            format!("{value:?} is no finite number in f32"),
        )),
        None => Ok(()),
    }
}

/// Weights that are not zero in `f32` either, to all its digits.
fn does_not_vanish(place: &str, weights: &[f64]) -> Result<(), PlantError> {
    let vanishes = |weight: &&f64| **weight != 0.0 && weight.abs() < f64::from(f32::MIN_POSITIVE);
    match weights.iter().find(vanishes) {
        Some(weight) => Err(PlantError::new(
            place,
            format!(
                "{weight:?} vanishes in f32, whose smallest number is {:e}; multiply all weights by a common factor, \
                 which changes nothing",
                f32::MIN_POSITIVE
            ),
        )),
        None => Ok(()),
    }
}

/// Lower and upper bounds, as `f32` has them: one that is beyond all its numbers is none, unless it
/// leaves nothing.
fn bounds(place: &str, signals: &[Signal]) -> Result<[Vec<f64>; 2], PlantError> {
    let (mut lower, mut upper) = (Vec::new(), Vec::new());
    for (i, signal) in signals.iter().enumerate() {
        let least = signal.lower.unwrap_or(f64::NEG_INFINITY);
        let most = signal.upper.unwrap_or(f64::INFINITY);
        if least as f32 == f32::INFINITY || most as f32 == f32::NEG_INFINITY {
            let place = format!("{place}[{i}] ({})", signal.name);
            let fault = format!("no number of f32 is from {least:?} to {most:?}, its bounds");
            return Err(PlantError::new(place, fault));
        }
        lower.push(f64::from(least as f32));
        upper.push(f64::from(most as f32));
    }
    Ok([lower, upper])
}

fn list(values: &[f64]) -> String {
    let values: Vec<String> = values.iter().map(|value| number(*value)).collect();
    values.join(", ")
}

/// As a literal of Rust.
fn number(value: f64) -> String {
    match value as f32 {
        f32::INFINITY => "f32::INFINITY".to_owned(),
        f32::NEG_INFINITY => "f32::NEG_INFINITY".to_owned(),
        value => format!("{value:?}"),
    }
}
