//! Values of the libraries as Python's, and back.

use crate::errors::scenario_value;
use numpy::ndarray::Array2;
use numpy::{PyArray1, PyArray2};
use pyo3::IntoPyObjectExt;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyList, PyString, PyTuple};
use serde::Serialize;
use serde_json::Value as Json;
use toml::Value as Toml;

/// A result as dictionaries, lists and numbers; what is no number is `None`.
pub fn plain<'py>(py: Python<'py>, result: &impl Serialize) -> PyResult<Bound<'py, PyAny>> {
    let json = serde_json::to_value(result);
    of_json(
        py,
        &json.map_err(|error| PyValueError::new_err(error.to_string()))?,
    )
}

fn of_json<'py>(py: Python<'py>, value: &Json) -> PyResult<Bound<'py, PyAny>> {
    match value {
        Json::Null => Ok(py.None().into_bound(py)),
        Json::Bool(value) => value.into_bound_py_any(py),
        Json::Number(value) => match value.as_i64() {
            Some(value) => value.into_bound_py_any(py),
            None => value.as_f64().into_bound_py_any(py),
        },
        Json::String(value) => value.into_bound_py_any(py),
        Json::Array(list) => {
            let list: PyResult<Vec<_>> = list.iter().map(|entry| of_json(py, entry)).collect();
            list?.into_bound_py_any(py)
        }
        Json::Object(table) => {
            let dict = PyDict::new(py);
            for (key, value) in table {
                dict.set_item(key, of_json(py, value)?)?;
            }
            Ok(dict.into_any())
        }
    }
}

/// A value of a scenario.
pub fn of_toml<'py>(py: Python<'py>, value: &Toml) -> PyResult<Bound<'py, PyAny>> {
    match value {
        Toml::Boolean(value) => value.into_bound_py_any(py),
        Toml::Integer(value) => value.into_bound_py_any(py),
        Toml::Float(value) => value.into_bound_py_any(py),
        Toml::String(value) => value.into_bound_py_any(py),
        Toml::Datetime(value) => value.to_string().into_bound_py_any(py),
        Toml::Array(list) => {
            let list: PyResult<Vec<_>> = list.iter().map(|entry| of_toml(py, entry)).collect();
            list?.into_bound_py_any(py)
        }
        Toml::Table(table) => {
            let dict = PyDict::new(py);
            for (key, value) in table {
                dict.set_item(key, of_toml(py, value)?)?;
            }
            Ok(dict.into_any())
        }
    }
}

/// What is to stand at `key` of a scenario.
///
/// # Errors
/// `ScenarioError`: TOML has no such value.
pub fn to_toml(key: &str, value: &Bound<'_, PyAny>) -> PyResult<Toml> {
    if let Ok(value) = value.cast::<PyBool>() {
        return Ok(Toml::Boolean(value.is_true()));
    }
    if value.is_instance_of::<PyInt>()
        && let Ok(value) = value.extract()
    {
        return Ok(Toml::Integer(value));
    }
    if value.is_instance_of::<PyFloat>() {
        return Ok(Toml::Float(value.extract()?));
    }
    if value.is_instance_of::<PyString>() {
        return Ok(Toml::String(value.extract()?));
    }
    if value.is_instance_of::<PyList>() || value.is_instance_of::<PyTuple>() {
        let list = value.try_iter()?.enumerate();
        let list = list.map(|(place, entry)| to_toml(&format!("{key}.{place}"), &entry?));
        return Ok(Toml::Array(list.collect::<PyResult<_>>()?));
    }
    if let Ok(dict) = value.cast::<PyDict>() {
        let mut table = toml::Table::new();
        for (name, entry) in dict {
            let name: String = name.str()?.extract()?;
            let entry = to_toml(&format!("{key}.{name}"), &entry)?;
            table.insert(name, entry);
        }
        return Ok(Toml::Table(table));
    }
    Err(scenario_value(
        key,
        &value.repr()?.to_string(),
        "it must be a number, a text, true or false, a list of these, or a table",
    ))
}

/// The text of a TOML file: a text as it is, or what a dictionary makes.
///
/// # Errors
/// As [`to_toml`].
pub fn toml_text(what: &str, content: &Bound<'_, PyAny>) -> PyResult<String> {
    if let Ok(text) = content.extract() {
        return Ok(text);
    }
    let Ok(table) = content.cast::<PyDict>() else {
        let expected = "it must be the text of a file, or a dictionary";
        return Err(scenario_value(what, &content.repr()?.to_string(), expected));
    };
    let mut values = toml::Table::new();
    for (key, value) in table {
        let key: String = key.str()?.extract()?;
        let value = to_toml(&key, &value)?;
        values.insert(key, value);
    }
    toml::to_string(&values).map_err(|error| PyValueError::new_err(error.to_string()))
}

/// A column of numbers.
pub fn column<'py>(
    py: Python<'py>,
    numbers: impl IntoIterator<Item = f64>,
) -> Bound<'py, PyArray1<f64>> {
    PyArray1::from_iter(py, numbers)
}

/// Rows of equally many numbers, (rows, N).
pub fn rows<'py, const N: usize>(
    py: Python<'py>,
    rows: impl IntoIterator<Item = [f64; N]>,
) -> Bound<'py, PyArray2<f64>> {
    let rows: Vec<[f64; N]> = rows.into_iter().collect();
    let array = Array2::from_shape_fn((rows.len(), N), |(i, j)| rows[i][j]);
    PyArray2::from_owned_array(py, array)
}
