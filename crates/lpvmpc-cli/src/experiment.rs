//! An experiment: a plant from a file, its controller, and what happens to it.

mod signals;
mod table;
mod world;

use crate::arguments::{Example, ExampleArguments};
use crate::describe::load;
use crate::error::CommandError;
use crate::estimator::EstimatorTable;
use lpvmpc_any::{
    EstimatorSettings, Iterations, LinearModels, MpcError, MpcSettings, StateBounds, Terminal,
    USUAL_NODES, WorldSettings,
};
use lpvmpc_plant::{Plant, Signal};
use lpvmpc_terminal::table::short;
use lpvmpc_words::{read_text, toml_message};
use nalgebra::{DMatrix, DVector};
use serde::Deserialize;
pub use signals::{check_name, components, names};
use signals::{limits, weights};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
pub use table::Table;
use world::World;

/// The files of the example.
pub fn example(arguments: &ExampleArguments) -> &'static str {
    match arguments.what {
        Example::Experiment => include_str!("example.toml"),
        Example::Plant => include_str!("../../../testdata/plants/cart-pole.json"),
    }
}

/// An experiment that was checked.
#[derive(Debug)]
pub struct Experiment {
    /// Its file.
    path: PathBuf,
    /// That of its plant.
    plant_file: PathBuf,
    /// Its name, which is that of the folder of its results.
    pub name: String,
    /// The plant that the controller knows.
    pub plant: Plant,
    /// The plant as it really is.
    pub real: Plant,
    /// The controller, without its certificate.
    pub settings: MpcSettings,
    /// The file of the certificate with which its loop is guaranteed.
    pub certificate: Option<PathBuf>,
    /// What is measured in place of the state.
    pub estimator: Option<EstimatorSettings>,
    /// The world around the plant.
    pub world: WorldSettings,
    /// The state at the start.
    pub x0: Vec<f64>,
    /// Samples of the run.
    pub samples: usize,
    /// References with the times in s from which on they hold, by time; empty for none.
    pub references: Vec<Reference>,
}

/// Where the plant is to be from a time on.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Reference {
    /// From when on, s.
    pub time: f64,
    /// The state.
    pub x: Vec<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    name: String,
    plant: String,
    x0: Vec<f64>,
    duration: f64,
    controller: Table<Controller>,
    #[serde(default)]
    reference: Vec<Table<Reference>>,
    #[serde(default)]
    world: Table<World>,
}

/// Bounds by name.
type Pairs = BTreeMap<String, Pair>;

/// Lower and upper bound.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(try_from = "Vec<f64>")]
struct Pair([f64; 2]);

impl TryFrom<Vec<f64>> for Pair {
    type Error = String;

    /// A list that is as long as it must be: of a longer one the reader would leave out the rest.
    fn try_from(list: Vec<f64>) -> Result<Self, String> {
        let count = list.len();
        let pair = list.try_into();
        pair.map(Self)
            .map_err(|_| format!("there are {count} numbers; there must be two, [lower, upper]"))
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Controller {
    t_s: f64,
    horizon: usize,
    q: Vec<f64>,
    r: Vec<f64>,
    terminal: Option<TerminalName>,
    certificate: Option<PathBuf>,
    x_bounds: Option<Pairs>,
    u_bounds: Option<Pairs>,
    y_bounds: Option<Pairs>,
    du_bounds: Option<Pairs>,
    state_bounds: Option<Keeping>,
    output_bounds: Option<Keeping>,
    u_ref: Option<Vec<f64>>,
    q_y: Option<Vec<f64>>,
    r_du: Option<Vec<f64>>,
    substeps: Option<usize>,
    linear_models: Option<ModelsName>,
    nodes: Option<usize>,
    method: Option<Method>,
    max_programs: Option<usize>,
    first_programs: Option<usize>,
    tolerance: Option<f64>,
    estimator: Option<Table<EstimatorTable>>,
}

#[derive(Deserialize)]
#[serde(rename_all = "lowercase")]
enum TerminalName {
    Lqr,
    Equality,
}

#[derive(Deserialize)]
#[serde(rename_all = "lowercase")]
enum Keeping {
    Soft,
    Hard,
}

#[derive(Deserialize)]
#[serde(rename_all = "lowercase")]
enum ModelsName {
    Own,
    Motion,
    Ray,
}

#[derive(Deserialize, PartialEq)]
#[serde(rename_all = "lowercase")]
enum Method {
    Descent,
    Fixed,
}

/// The most samples of a run.
const MOST_SAMPLES: f64 = 1e6;

impl Experiment {
    /// Reads and checks the experiment at `path`, and its plant.
    ///
    /// # Errors
    /// The file cannot be read, is no TOML, has a key that is none, or a value that makes no sense.
    pub fn load(path: &Path) -> Result<Self, CommandError> {
        let text = read_text(path).map_err(|source| CommandError::Read {
            path: path.to_owned(),
            source,
        })?;
        let fault = |fault: String| CommandError::Experiment {
            path: path.to_owned(),
            fault,
        };
        let file: File = toml::from_str(&text).map_err(|error| {
            fault(format!(
                "it is no experiment:\n{}",
                toml_message(&error.to_string())
            ))
        })?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let plant = load(&folder.join(&file.plant))?;
        file.check(path, plant).map_err(fault)
    }
}

impl Experiment {
    /// The files that it was read from. That of its certificate is not among them: it is read for a guaranteed loop alone.
    pub fn sources(&self) -> [PathBuf; 2] {
        [self.path.clone(), self.plant_file.clone()]
    }

    /// What its controller or its world refuses, in words that name its file.
    pub fn refused(&self, part: &str, error: &MpcError) -> CommandError {
        let MpcError { place, fault } = error;
        CommandError::Experiment {
            path: self.path.clone(),
            fault: match place == part {
                true => format!("{part}: {fault}"),
                false => format!("{part}: {place}: {fault}"),
            },
        }
    }
}

impl File {
    fn check(self, path: &Path, plant: Plant) -> Result<Experiment, String> {
        let data = plant.data();
        let is_plain = |c: char| c.is_alphanumeric() || matches!(c, '-' | '_' | ' ' | '.');
        if !self.name.chars().all(is_plain) || self.name.trim_matches(['.', ' ']).is_empty() {
            return Err(format!(
                "name = {:?}: it names a folder; letters, digits, spaces, points, - and _ only",
                self.name
            ));
        }
        let (Table(controller), Table(world)) = (self.controller, self.world);
        let references: Vec<Reference> = { self.reference.into_iter() }
            .map(|Table(reference)| reference)
            .collect();
        let settings = controller.settings(&plant)?;
        let estimator = { controller.estimator.as_ref() }
            .map(|Table(estimator)| estimator.settings(data))
            .transpose()?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let certificate = controller.certificate.map(|file| folder.join(file));
        components("x0", &self.x0, &data.states)?;
        let given = limits("x0", &None, &data.states)?;
        let bounds = settings.x_bounds.as_ref().unwrap_or(&given);
        for (i, (state, value)) in data.states.iter().zip(&self.x0).enumerate() {
            if *value < bounds.lower[i] || *value > bounds.upper[i] {
                return Err(format!(
                    "x0: {} = {} is not from {} to {}, its bounds",
                    state.name,
                    short(*value),
                    short(bounds.lower[i]),
                    short(bounds.upper[i])
                ));
            }
        }
        if !(settings.t_s > 0.0 && settings.t_s.is_finite()) {
            let t_s = short(settings.t_s);
            return Err(format!(
                "controller: t_s: it is {t_s}; it must be a positive number of seconds"
            ));
        }
        let samples = (self.duration / settings.t_s - 1e-9).ceil();
        if !(1.0..=MOST_SAMPLES).contains(&samples) {
            return Err(format!(
                "duration = {}: it must be a positive number of seconds, with at least one sample and at most \
                 {MOST_SAMPLES}",
                short(self.duration)
            ));
        }
        let mut before = f64::NEG_INFINITY;
        for (i, reference) in references.iter().enumerate() {
            let place = format!("reference {}", i + 1);
            components(&format!("{place}, x"), &reference.x, &data.states)?;
            if !(reference.time.is_finite() && reference.time > before) {
                return Err(format!(
                    "{place}, time = {}: times must increase from one reference to the next",
                    short(reference.time)
                ));
            }
            before = reference.time;
        }
        if let Some(first) = references.first()
            && first.time > 0.0
        {
            let time = short(first.time);
            return Err(format!(
                "reference 1, time = {time}: the first one must hold from 0 on"
            ));
        }
        let mut real = plant.clone();
        for (name, value) in &world.parameters {
            let known = data.parameters.iter().map(|one| one.name.as_str());
            check_name("world.parameters", name, known)?;
            let set = real.set_parameter(name, *value);
            set.map_err(|error| format!("world.parameters: {error}"))?;
        }
        let measured = estimator.as_ref().map(|one| one.measured.as_slice());
        let world = world.settings(settings.t_s, &data.states, measured)?;
        Ok(Experiment {
            path: path.to_owned(),
            plant_file: path.parent().unwrap_or(Path::new("")).join(&self.plant),
            name: self.name,
            real,
            settings,
            certificate,
            estimator,
            world,
            x0: self.x0,
            samples: samples as usize,
            references,
            plant,
        })
    }
}

impl Controller {
    fn settings(&self, plant: &Plant) -> Result<MpcSettings, String> {
        let data = plant.data();
        let (states, inputs, outputs) = (&data.states, &data.inputs, &data.outputs);
        let place = |name: &str| format!("controller.{name}");
        if self.terminal.is_some() && self.certificate.is_some() {
            let fault = "a certificate stands in place of terminal; leave one of them out";
            return Err(format!("{}: {fault}", place("certificate")));
        }
        weights(&place("q"), &self.q, states)?;
        weights(&place("r"), &self.r, inputs)?;
        let usual = MpcSettings::new(self.t_s, self.horizon, &self.q, &self.r);
        let diagonal = |name, list: &Option<Vec<f64>>, signals: &[Signal]| match list {
            None => Ok(None),
            Some(list) => {
                weights(&place(name), list, signals)?;
                let entries = DVector::from_row_slice(list);
                Ok::<_, String>(Some(DMatrix::from_diagonal(&entries)))
            }
        };
        let bounds = |name, pairs: &Option<Pairs>, signals: &[Signal]| match pairs {
            None => Ok(None),
            Some(_) => limits(&place(name), pairs, signals).map(Some),
        };
        let keeping = |given: &Option<Keeping>| match given {
            Some(Keeping::Hard) => StateBounds::Hard,
            Some(Keeping::Soft) | None => StateBounds::Soft,
        };
        let changes: Vec<Signal> = inputs
            .iter()
            .map(|one| Signal::new(&one.name, &one.unit))
            .collect();
        if let Some(u_ref) = &self.u_ref {
            components(&place("u_ref"), u_ref, inputs)?;
        }
        Ok(MpcSettings {
            substeps: self.substeps.unwrap_or(usual.substeps),
            terminal: match self.terminal {
                Some(TerminalName::Lqr) | None => Terminal::Lqr,
                Some(TerminalName::Equality) => Terminal::Equality,
            },
            x_bounds: bounds("x_bounds", &self.x_bounds, states)?,
            u_bounds: bounds("u_bounds", &self.u_bounds, inputs)?,
            y_bounds: bounds("y_bounds", &self.y_bounds, outputs)?,
            du_bounds: bounds("du_bounds", &self.du_bounds, &changes)?,
            state_bounds: keeping(&self.state_bounds),
            output_bounds: keeping(&self.output_bounds),
            u_ref: { self.u_ref.as_ref() }.map(|u_ref| DVector::from_row_slice(u_ref)),
            q_y: diagonal("q_y", &self.q_y, outputs)?,
            r_du: diagonal("r_du", &self.r_du, inputs)?,
            linear_models: self.linear_models()?,
            iterations: self.iterations(usual.iterations)?,
            ..usual
        })
    }

    fn linear_models(&self) -> Result<LinearModels, String> {
        let ray = matches!(self.linear_models, Some(ModelsName::Ray));
        if self.nodes.is_some() && !ray {
            return Err("controller.nodes: it goes with linear_models = \"ray\" alone".to_owned());
        }
        Ok(match self.linear_models {
            None | Some(ModelsName::Own) => LinearModels::Own,
            Some(ModelsName::Motion) => LinearModels::AlongMotion,
            Some(ModelsName::Ray) => LinearModels::AlongRay {
                nodes: self.nodes.unwrap_or(USUAL_NODES),
            },
        })
    }

    fn iterations(&self, usual: Iterations<f64>) -> Result<Iterations<f64>, String> {
        if self.method == Some(Method::Fixed) {
            if self.first_programs.is_some() || self.tolerance.is_some() {
                let fault = "first_programs and tolerance go with method = \"descent\" alone";
                return Err(format!("controller: {fault}"));
            }
            let fault = "controller.max_programs: method = \"fixed\" needs their number";
            let most = self.max_programs.ok_or(fault)?;
            return Ok(Iterations::Fixed(most));
        }
        Ok(match usual {
            Iterations::Descent {
                tolerance,
                most,
                first,
            } => Iterations::Descent {
                tolerance: self.tolerance.unwrap_or(tolerance),
                most: self.max_programs.unwrap_or(most),
                first: self.first_programs.unwrap_or(first),
            },
            other => other,
        })
    }
}
