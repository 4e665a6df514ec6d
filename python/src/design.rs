//! The linear-quadratic regulator about a steady state.

use crate::arrays::{Matrix, Vector, entries, matrix, to_numpy};
use crate::errors::{of_plant, setting};
use crate::plant::{Plant, jacobian};
use lpvmpc_design::{lqr_discrete, zero_order_hold};
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
    if !(t_s > 0.0 && t_s.is_finite()) {
        return Err(setting(
            "t_s",
            &format!("it is {t_s} s; it must be a positive number of seconds"),
        ));
    }
    if let Some(period) = plant.inner.period()
        && t_s != period
    {
        let fault = format!("it is {t_s} s; the plant is in discrete time, with {period} s");
        return Err(setting("t_s", &fault));
    }
    let (x, u) = (entries(&x), entries(&u));
    let (a, b) = jacobian(&plant.inner, &x, &u).map_err(of_plant)?;
    let refused = |error: &dyn std::fmt::Display| setting("lqr", &error.to_string());
    let (a_d, b_d) = match plant.inner.period() {
        None => zero_order_hold(&a, &b, t_s).map_err(|error| refused(&error))?,
        Some(_) => (a, b),
    };
    let lqr =
        lqr_discrete(&a_d, &b_d, &matrix(&q), &matrix(&r)).map_err(|error| refused(&error))?;
    Ok((to_numpy(py, &lqr.k), to_numpy(py, &lqr.p)))
}
