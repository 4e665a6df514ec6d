//! The linear-quadratic regulator about a steady state.

use crate::arrays::{Matrix, Vector, entries, matrix, to_numpy};
use crate::errors::of_setting;
use crate::plant::Plant;
use numpy::PyArray2;
use pyo3::prelude::*;

/// (K, P): u = u_eq - K (x - x_eq), and the cost to go (x - x_eq)'P (x - x_eq).
#[pyfunction]
#[expect(clippy::type_complexity, reason = "a pair of arrays")]
pub fn lqr<'py>(
    py: Python<'py>,
    plant: &Plant,
    t_s: f64,
    q: Matrix<'py>,
    r: Matrix<'py>,
    x: Vector<'py>,
    u: Vector<'py>,
) -> PyResult<(Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>)> {
    let weights = (&matrix(&q), &matrix(&r));
    let about = (&*entries(&x), &*entries(&u));
    let lqr = lpvmpc_any::lqr(&plant.inner, t_s, weights, about).map_err(of_setting)?;
    Ok((to_numpy(py, &lqr.k), to_numpy(py, &lqr.p)))
}
