//! A recorded run as arrays.

use super::values::{column, plain, rows};
use crate::work::Watch;
use ballbot_scenario::{
    MotorSample, PhiReference, Prepared, Record, RunHooks, ScenarioError, words,
};
use ballbot_studies::recorded::{Metrics, log_csv, time};
use lpvmpc_sim::{LogRow, Recording, Termination, Trajectory};
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

/// Runs the closed loops.
pub fn record(prepared: &Prepared, watch: &Watch) -> Result<Record, ScenarioError> {
    watch.begin("simulating", prepared.total_samples());
    prepared.record(&RunHooks {
        clock: &watch.clock(),
        progress: &|done| watch.set(done),
    })
}

/// What was recorded, plane by plane.
pub fn to_python<'py>(
    py: Python<'py>,
    prepared: &Prepared,
    record: Record,
) -> PyResult<Bound<'py, PyDict>> {
    let run = PyDict::new(py);
    let (t_s, geometry) = (prepared.settings.t_s, &prepared.ballbot.geometry);
    run.set_item("title", &prepared.title)?;
    run.set_item("t_s", t_s)?;
    run.set_item("samples", prepared.samples)?;
    run.set_item("duration", time(prepared.samples as f64 * t_s))?;
    run.set_item("metres_per_rad", geometry.position(1.0))?;
    let standing = prepared.certificate.map(|standing| standing.to_string());
    run.set_item("certificate", standing)?;
    run.set_item("bounds", bounds(py, prepared)?)?;
    let limit = prepared.motors.map(|motors| motors.limits.motor);
    run.set_item("motor_limit", limit)?;

    let (trajectories, sensed): (Vec<_>, Vec<_>) = record
        .planes
        .into_iter()
        .map(|Recording { trajectory, log }| (trajectory, log))
        .unzip();
    let planes = PyList::empty(py);
    for ((plane, trajectory), log) in prepared.planes.iter().zip(&trajectories).zip(&sensed) {
        let recorded = of_plane(py, trajectory)?;
        let held = matches!(plane.reference, PhiReference::Steps(_));
        recorded.set_item("reference_is_held", held)?;
        let metrics = Metrics::new(prepared, plane, trajectory);
        recorded.set_item("metrics", plain(py, &metrics)?)?;
        recorded.set_item("lines", metrics.lines().to_vec())?;
        let seen = log.iter().map(|row| (row.t, row.observation));
        recorded.set_item("readings", words::readings(seen))?;
        recorded.set_item("log", of_log(py, log)?)?;
        recorded.set_item("log_csv", log_csv(log))?;
        planes.append(recorded)?;
    }
    run.set_item("planes", planes)?;
    let motors = record.motors;
    let motors = motors.unwrap_or_else(|| prepared.motors_of_planes(&trajectories));
    run.set_item("motors", of_motors(py, &motors)?)?;
    Ok(run)
}

/// Lower and upper bounds of the controller's problem by name.
fn bounds<'py>(py: Python<'py>, prepared: &Prepared) -> PyResult<Bound<'py, PyDict>> {
    let (x, u) = (&prepared.settings.x, &prepared.settings.u);
    let bounds = PyDict::new(py);
    for (i, name) in words::STATES.into_iter().enumerate() {
        bounds.set_item(name, (x.lower[i], x.upper[i]))?;
    }
    bounds.set_item("torque", (u.lower[0], u.upper[0]))?;
    Ok(bounds)
}

fn of_plane<'py>(py: Python<'py>, trajectory: &Trajectory<4, 1>) -> PyResult<Bound<'py, PyDict>> {
    let samples = &trajectory.samples;
    let plane = PyDict::new(py);
    let times = samples.iter().map(|sample| sample.t);
    let times = times.chain([trajectory.final_time]).map(time);
    plane.set_item("t", column(py, times))?;
    let states = trajectory.states().map(|x| (*x).into());
    plane.set_item("states", rows(py, states))?;
    let references = samples.iter().map(|sample| sample.x_ref);
    let references = references.chain([trajectory.final_reference]);
    plane.set_item("references", rows(py, references.map(Into::into)))?;
    let estimates = samples.iter().map(|sample| sample.estimate.into());
    plane.set_item("estimates", rows(py, estimates))?;
    let torques = samples.iter().map(|sample| sample.u[0]);
    plane.set_item("torques", column(py, torques))?;
    let costs = samples.iter().map(|sample| sample.cost);
    plane.set_item("costs", column(py, costs))?;
    let statuses = samples.iter().map(|sample| words::status(&sample.status));
    plane.set_item("statuses", statuses.collect::<Vec<_>>())?;
    let solved = samples.iter().map(|sample| sample.status.is_solved());
    plane.set_item("solved", PyArray1::from_iter(py, solved))?;
    let active = samples.iter().map(|sample| sample.active_bounds as i64);
    plane.set_item("active_bounds", PyArray1::from_iter(py, active))?;
    let step_times = samples.iter().map(|sample| sample.step_time.as_secs_f64());
    plane.set_item("step_times", column(py, step_times))?;
    let gaps = samples.iter().map(|sample| sample.gap.into());
    plane.set_item("gaps", rows(py, gaps))?;
    let guarantees = samples.iter().filter_map(|sample| sample.guarantee);
    let decisions = guarantees.clone().map(|one| one.decision.to_string());
    plane.set_item("decisions", decisions.collect::<Vec<_>>())?;
    let set_points = guarantees.map(|guarantee| guarantee.set_point);
    plane.set_item("set_points", column(py, set_points))?;
    let early = match &trajectory.termination {
        Termination::Complete => None,
        early => Some(words::termination(early)),
    };
    plane.set_item("ended_early", early)?;
    Ok(plane)
}

/// What the sensors delivered: NaN where a reading is missing.
fn of_log<'py>(py: Python<'py>, log: &[LogRow<4, 1>]) -> PyResult<Bound<'py, PyDict>> {
    let found = PyDict::new(py);
    found.set_item("t", column(py, log.iter().map(|row| time(row.t))))?;
    let value = |row: &LogRow<4, 1>| {
        row.readings
            .map(|one| one.map_or(f64::NAN, |one| one.value))
    };
    let readings: Bound<'py, PyArray2<f64>> = rows(py, log.iter().map(value));
    found.set_item("readings", readings)?;
    let commanded = log.iter().map(|row| row.commanded[0]);
    found.set_item("commanded", column(py, commanded))?;
    let applied = log.iter().map(|row| row.applied[0]);
    found.set_item("applied", column(py, applied))?;
    Ok(found)
}

/// The motors at the samples; `None` for one plane.
fn of_motors<'py>(py: Python<'py>, motors: &[MotorSample]) -> PyResult<Option<Bound<'py, PyDict>>> {
    if motors.is_empty() {
        return Ok(None);
    }
    let found = PyDict::new(py);
    found.set_item("t", column(py, motors.iter().map(|one| time(one.t))))?;
    let torques = motors.iter().map(|one| one.torques.into());
    found.set_item("torques", rows(py, torques))?;
    found.set_item("headings", column(py, motors.iter().map(|one| one.heading)))?;
    let targets = motors.iter().map(|one| one.target);
    found.set_item("heading_references", column(py, targets))?;
    Ok(Some(found))
}
