//! Simulated worlds.

use crate::errors::{of_setting, of_simulation};
use crate::plant::Plant;
use lpvmpc_any::{Actuator, Push, Quantity, Sensor, Tolerances, WorldSettings};
use numpy::PyArray1;
use pyo3::prelude::*;

/// What a sensor measures: a row of the states, or an output by its name.
#[derive(FromPyObject)]
enum QuantityArgument {
    Output(String),
    Row(Vec<f64>),
}

/// A sensor: what it measures, noise, bias, resolution, dropout, every, late.
type SensorTuple = (QuantityArgument, f64, f64, f64, f64, usize, usize);
/// An actuator: limit, dead zone, lag.
type ActuatorTuple = (f64, f64, f64);

/// A push, as Python hands it over.
#[derive(FromPyObject)]
enum PushTuple {
    Load(f64, f64, Vec<f64>),
    Jump(f64, Vec<f64>),
}

impl From<PushTuple> for Push {
    fn from(push: PushTuple) -> Self {
        match push {
            PushTuple::Load(from, until, load) => Self::Load { from, until, load },
            PushTuple::Jump(time, change) => Self::Jump { time, change },
        }
    }
}

/// Settings, as Python hands them over: all keys are there.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Settings {
    period: f64,
    sensors: Option<Vec<SensorTuple>>,
    actuators: Option<Vec<ActuatorTuple>>,
    delay: f64,
    pushes: Vec<PushTuple>,
    seed: u64,
    relative_tolerance: f64,
    absolute_tolerance: f64,
}

impl From<Settings> for WorldSettings {
    fn from(settings: Settings) -> Self {
        let sensor = |(of, noise, bias, resolution, dropout, every, late): SensorTuple| Sensor {
            of: match of {
                QuantityArgument::Output(name) => Quantity::Output(name),
                QuantityArgument::Row(row) => Quantity::Row(row),
            },
            noise,
            bias,
            resolution,
            dropout,
            every,
            late,
        };
        let actuator = |(limit, dead_zone, lag): ActuatorTuple| Actuator {
            limit,
            dead_zone,
            lag,
        };
        Self {
            period: settings.period,
            sensors: settings
                .sensors
                .map(|all| all.into_iter().map(sensor).collect()),
            actuators: settings
                .actuators
                .map(|all| all.into_iter().map(actuator).collect()),
            delay: settings.delay,
            pushes: settings.pushes.into_iter().map(Into::into).collect(),
            seed: settings.seed,
            tolerances: Tolerances {
                relative: settings.relative_tolerance,
                absolute: settings.absolute_tolerance,
            },
        }
    }
}

/// A plant behind sensors, actuators and a delay.
#[pyclass(module = "lpvmpc._lpvmpc")]
pub struct World {
    inner: lpvmpc_any::World,
}

#[pymethods]
impl World {
    #[new]
    fn new(plant: &Plant, x: Vec<f64>, settings: Settings) -> PyResult<Self> {
        let inner = lpvmpc_any::World::new(&plant.inner, &x, &settings.into());
        Ok(Self {
            inner: inner.map_err(of_setting)?,
        })
    }

    #[getter]
    fn time(&self) -> f64 {
        self.inner.time()
    }

    #[getter]
    fn x<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.inner.state())
    }

    #[getter]
    fn applied<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.inner.applied())
    }

    /// Value and age in s of each reading.
    #[getter]
    fn readings(&self) -> Vec<Option<(f64, f64)>> {
        let readings = self.inner.readings().iter();
        readings
            .map(|reading| reading.map(|one| (one.value, one.age)))
            .collect()
    }

    fn command(&mut self, u: Vec<f64>) -> PyResult<()> {
        self.inner.command(&u).map_err(of_setting)
    }

    fn push(&mut self, push: PushTuple) -> PyResult<()> {
        self.inner.push(&push.into()).map_err(of_setting)
    }

    fn advance(&mut self, py: Python<'_>) -> PyResult<()> {
        let inner = &mut self.inner;
        py.detach(|| inner.advance()).map_err(of_simulation)
    }
}
