//! Plants.

use crate::errors::{of_plant, of_setting};
use crate::mpc::Settings;
use lpvmpc_any::{Demonstration, jacobian};
use lpvmpc_plant::{PlantData, PlantError, Signal};
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use std::path::PathBuf;

/// A plant that was checked. It does not change: another value of a parameter makes another plant.
#[pyclass(module = "lpvmpc._lpvmpc", frozen)]
pub struct Plant {
    pub inner: lpvmpc_plant::Plant,
}

/// Name, unit, lower and upper bound.
type Column = (String, String, Option<f64>, Option<f64>);

fn columns(signals: &[Signal]) -> Vec<Column> {
    let signals = signals.iter();
    signals
        .map(|one| (one.name.clone(), one.unit.clone(), one.lower, one.upper))
        .collect()
}

impl Plant {
    fn data(&self) -> &PlantData {
        self.inner.data()
    }

    /// f(x, u): the derivative, or the state one period later.
    fn motion(&self, x: &[f64], u: &[f64]) -> Result<Vec<f64>, PlantError> {
        match self.inner.period() {
            None => self.inner.derivative(x, u),
            Some(_) => self.inner.next(x, u),
        }
    }
}

#[pymethods]
impl Plant {
    #[staticmethod]
    fn from_json(py: Python<'_>, text: &str) -> PyResult<Self> {
        let inner = py.detach(|| lpvmpc_plant::Plant::from_json(text));
        Ok(Self {
            inner: inner.map_err(of_plant)?,
        })
    }

    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let inner = py.detach(|| lpvmpc_plant::Plant::load(path));
        Ok(Self {
            inner: inner.map_err(of_plant)?,
        })
    }

    fn to_json(&self) -> String {
        self.inner.to_json()
    }

    /// The text of the file of the plant that it was made from, with the parameters of then.
    fn made_from(&self) -> PyResult<String> {
        let given = self.data().parameters.iter();
        let given: Vec<f64> = given.map(|parameter| parameter.value).collect();
        let mut plant = self.inner.clone();
        plant.set_parameters(&given).map_err(of_plant)?;
        Ok(plant.to_json())
    }

    fn to_rust(&self) -> String {
        self.inner.to_rust()
    }

    /// A program that controls it with these settings, from `start` to `target` for so many samples.
    fn save_firmware(
        &self,
        folder: PathBuf,
        settings: Settings<'_>,
        lpvmpc: String,
        start: Vec<f64>,
        target: Option<Vec<f64>>,
        samples: usize,
    ) -> PyResult<()> {
        let settings = settings.build(&self.inner)?;
        let shown = Demonstration {
            lpvmpc,
            start,
            target,
            samples,
        };
        let printed = lpvmpc_any::firmware(&self.inner, &settings, &shown);
        let (plant, printed) = printed.map_err(of_setting)?;
        plant.save_firmware(&printed, folder).map_err(of_plant)
    }

    fn with_parameters(&self, values: Vec<(String, f64)>) -> PyResult<Self> {
        let mut inner = self.inner.clone();
        for (name, value) in values {
            inner.set_parameter(&name, value).map_err(of_plant)?;
        }
        Ok(Self { inner })
    }

    fn f<'py>(
        &self,
        py: Python<'py>,
        x: Vec<f64>,
        u: Vec<f64>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let f = self.motion(&x, &u).map_err(of_plant)?;
        Ok(PyArray1::from_vec(py, f))
    }

    fn g<'py>(
        &self,
        py: Python<'py>,
        x: Vec<f64>,
        u: Vec<f64>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let y = self.inner.output(&x, &u).map_err(of_plant)?;
        Ok(PyArray1::from_vec(py, y))
    }

    #[expect(clippy::type_complexity, reason = "a pair of arrays")]
    fn jacobian<'py>(
        &self,
        py: Python<'py>,
        x: Vec<f64>,
        u: Vec<f64>,
    ) -> PyResult<(Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>)> {
        // For its checks of the sizes.
        self.motion(&x, &u).map_err(of_plant)?;
        let (a, b) = jacobian(&self.inner, &x, &u).map_err(of_plant)?;
        Ok((
            crate::arrays::to_numpy(py, &a),
            crate::arrays::to_numpy(py, &b),
        ))
    }

    #[expect(
        clippy::type_complexity,
        reason = "x, u, and whether x is the reference"
    )]
    fn steady_state<'py>(
        &self,
        py: Python<'py>,
        x_ref: Vec<f64>,
        weights: Vec<f64>,
    ) -> PyResult<(Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>, bool)> {
        let found = lpvmpc_any::steady_state(&self.inner, &x_ref, &weights).map_err(of_setting)?;
        Ok((
            PyArray1::from_vec(py, found.x),
            PyArray1::from_vec(py, found.u),
            found.reached,
        ))
    }

    #[getter]
    fn name(&self) -> &str {
        &self.data().name
    }

    #[getter]
    fn states(&self) -> Vec<Column> {
        columns(&self.data().states)
    }

    #[getter]
    fn inputs(&self) -> Vec<Column> {
        columns(&self.data().inputs)
    }

    #[getter]
    fn outputs(&self) -> Vec<Column> {
        columns(&self.data().outputs)
    }

    /// Name, unit and present value.
    #[getter]
    fn parameters(&self) -> Vec<(String, String, f64)> {
        let values = self.inner.parameters().iter();
        let parameters = self.data().parameters.iter().zip(values);
        parameters
            .map(|(one, value)| (one.name.clone(), one.unit.clone(), *value))
            .collect()
    }

    #[getter]
    fn equilibrium(&self) -> Option<(Vec<f64>, Vec<f64>)> {
        let equilibrium = self.inner.equilibrium()?;
        Some((equilibrium.x.clone(), equilibrium.u.clone()))
    }

    #[getter]
    fn period(&self) -> Option<f64> {
        self.inner.period()
    }

    #[getter]
    fn has_embedding(&self) -> bool {
        self.data().embedding.is_some()
    }

    #[getter]
    fn operations(&self) -> usize {
        self.data().operations.len()
    }

    fn __eq__(&self, other: &Self) -> bool {
        self.inner == other.inner
    }
}
