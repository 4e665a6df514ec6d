//! From logs to a robot, and what to log.

use super::values::{column, plain, rows, toml_text};
use crate::arrays::to_numpy;
use crate::errors::{identification, setting};
use crate::work::{Report, work};
use ballbot_identification::log::{self, LeftOut};
use ballbot_identification::{
    Config, ConfigError, ExcitationTask, Identification, IdentifiedRobot, USUAL_STEPS,
    identified_parameters, identify as identify_robot,
};
use ballbot_scenario::words::{read_text, toml_message};
use nalgebra::Vector4;
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use std::path::{Path, PathBuf};

/// A commented configuration.
#[pyfunction]
pub fn identification_example() -> &'static str {
    Config::EXAMPLE
}

/// The robot that explains the logs. Left out are (log, from, to): the log counted from 1, or all; s.
#[pyfunction]
pub fn identify<'py>(
    py: Python<'py>,
    logs: Vec<PathBuf>,
    config: Option<(Bound<'py, PyAny>, String)>,
    left_out: Vec<(Option<usize>, f64, f64)>,
    unphysical: bool,
    report: Report<'py>,
) -> PyResult<Bound<'py, PyDict>> {
    let (mut config, place) = configuration(config)?;
    config.fit.physical &= !unphysical;
    let choices = config.choices().map_err(|error| in_file(&place, &error))?;
    let left_out: Vec<LeftOut> = left_out
        .into_iter()
        .map(|(log, from, to)| LeftOut {
            log,
            time: [from, to],
        })
        .collect();
    let robot = work(py, &report, |watch| {
        let recordings = log::recordings(&logs, &config.log, &left_out, &|done| {
            watch.set_part("reading", done);
        });
        let recordings = recordings.map_err(|error| error.to_string())?;
        watch.begin("fitting", USUAL_STEPS);
        let robot = identify_robot(recordings, &config, choices, &|_| watch.step());
        robot.map_err(|error| error.to_string())
    })?;
    of_robot(py, &robot.map_err(|error| identification(&error))?)
}

fn of_robot<'py>(py: Python<'py>, robot: &IdentifiedRobot) -> PyResult<Bound<'py, PyDict>> {
    let found = PyDict::new(py);
    found.set_item("summary", plain(py, &robot.summary())?)?;
    let verdicts = robot.verdicts();
    let verdicts = verdicts
        .iter()
        .map(|verdict| format!("{} {}", verdict.1.weight().mark(), robot.told(verdict)));
    found.set_item("verdicts", verdicts.collect::<Vec<_>>())?;
    let (files, refusals) = match robot.parameter_files() {
        Ok(files) => (files, Vec::new()),
        Err(refusals) => (
            Vec::new(),
            refusals.iter().map(|one| robot.told(one)).collect(),
        ),
    };
    found.set_item("files", files)?;
    found.set_item("refusals", refusals)?;
    let variables = robot.variables.all();
    let keys = variables.map(|(plane, parameter)| robot.key(plane, parameter));
    found.set_item("keys", keys.collect::<Vec<_>>())?;
    found.set_item("covariance", to_numpy(py, robot.covariance()))?;
    let planes = PyList::empty(py);
    for plane in &robot.planes {
        planes.append(of_fit(py, plane)?)?;
    }
    found.set_item("planes", planes)?;
    Ok(found)
}

/// Measured and simulated outputs of the segments, one after the other.
fn of_fit<'py>(py: Python<'py>, plane: &Identification) -> PyResult<Bound<'py, PyDict>> {
    let fit = PyDict::new(py);
    let segments = &plane.simulated;
    let times = segments.iter().flat_map(|one| one.time.iter().copied());
    fit.set_item("t", column(py, times))?;
    let measured = segments.iter().flat_map(|one| &one.measured);
    fit.set_item("measured", rows(py, measured.map(|one| (*one).into())))?;
    let simulated = segments.iter().flat_map(|one| &one.simulated);
    fit.set_item("simulated", rows(py, simulated.map(|one| (*one).into())))?;
    let torques = segments.iter().flat_map(|one| one.torque.iter().copied());
    fit.set_item("torque", column(py, torques))?;
    let segment = segments
        .iter()
        .enumerate()
        .flat_map(|(place, one)| std::iter::repeat_n(place as i64, one.time.len()));
    fit.set_item("segment", PyArray1::from_iter(py, segment))?;
    let log = segments
        .iter()
        .flat_map(|one| std::iter::repeat_n(one.run as i64, one.time.len()));
    fit.set_item("log", PyArray1::from_iter(py, log))?;
    Ok(fit)
}

/// What is asked of an excitation, as Python hands it over: all keys are there, `None` for what is
/// usual.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Asked {
    band: Option<(f64, f64)>,
    harmonics: Option<usize>,
    amplitude: Option<f64>,
    length: Option<f64>,
    tilt_limit_deg: Option<f64>,
    rate: Option<f64>,
    gain: Option<[f64; 4]>,
}

/// A torque that tells the parameters.
#[pyfunction]
pub fn excite<'py>(
    py: Python<'py>,
    config: Option<(Bound<'py, PyAny>, String)>,
    parameters: Option<PathBuf>,
    asked: Asked,
) -> PyResult<Bound<'py, PyDict>> {
    let (config, place) = configuration(config)?;
    let identified = parameters.as_ref().map(|path| {
        identified_parameters(&text(path)?).map_err(|error| {
            in_file(
                &path.display().to_string(),
                &ConfigError::Syntax(toml_message(&error.to_string())),
            )
        })
    });
    let usual = ExcitationTask::of(&config, identified.transpose()?.as_ref());
    let usual = usual.map_err(|error| in_file(&place, &error))?;
    let limit = asked.tilt_limit_deg.map(f64::to_radians);
    let task = ExcitationTask {
        band: asked.band.unwrap_or(usual.band),
        harmonics: asked.harmonics.unwrap_or(usual.harmonics),
        amplitude: asked.amplitude.unwrap_or(usual.amplitude),
        duration: asked.length.unwrap_or(usual.duration),
        tilt_limit: limit.unwrap_or(usual.tilt_limit),
        rate: asked.rate.unwrap_or(usual.rate),
        gain: asked.gain.map(Vector4::from),
        ..usual
    };
    let excitation = work(py, &None, |_| task.design())?;
    let excitation = excitation.map_err(|error| identification(&error.to_string()))?;
    let found = PyDict::new(py);
    found.set_item("csv", excitation.csv())?;
    let expected = PyDict::new(py);
    for parameter in task.told() {
        let deviation = excitation.standard_deviations[parameter];
        let told = (task.robot[parameter], deviation, parameter.unit());
        expected.set_item(parameter.key(), told)?;
    }
    found.set_item("parameters", expected)?;
    found.set_item("t", column(py, excitation.time))?;
    found.set_item("torque", column(py, excitation.torque))?;
    found.set_item("frequencies", column(py, excitation.frequencies))?;
    found.set_item("gain", column(py, excitation.gain.iter().copied()))?;
    found.set_item("amplitude_asked", task.amplitude)?;
    found.set_item("amplitude", excitation.amplitude)?;
    found.set_item("largest_tilt", excitation.tilt)?;
    found.set_item("largest_torque", excitation.total_torque)?;
    found.set_item("largest_travel", excitation.travel)?;
    Ok(found)
}

/// A configuration, with what messages call it: the defaults without one.
fn configuration(given: Option<(Bound<'_, PyAny>, String)>) -> PyResult<(Config, String)> {
    let Some((content, place)) = given else {
        return Ok((Config::default(), "config".to_owned()));
    };
    match Config::parse(&toml_text("config", &content)?) {
        Ok(config) => Ok((config, place)),
        Err(ConfigError::Syntax(message)) => Err(in_file(
            &place,
            &ConfigError::Syntax(toml_message(&message)),
        )),
        Err(error) => Err(in_file(&place, &error)),
    }
}

fn text(path: &Path) -> PyResult<String> {
    read_text(path).map_err(|error| setting(&path.display().to_string(), &error.to_string()))
}

fn in_file(place: &str, error: &ConfigError) -> PyErr {
    setting(place, &error.to_string())
}
