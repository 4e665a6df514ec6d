//! The plant near a point, as matrices.

use crate::controller_settings::check_rest;
use crate::error::MpcError;
use crate::size::{MOST_INPUTS, MOST_STATES};
use lpvmpc::{AlongMotion, LpvModel};
use lpvmpc_design::{Lqr, lqr_discrete, zero_order_hold};
use lpvmpc_plant::{Plant, PlantError, SizedPlant};
use nalgebra::{DMatrix, DVector, SVector};

/// The derivatives A (n x n) and B (n x m) of f, or of F of a plant in discrete time, at the state `x` and the input `u`.
///
/// # Errors
/// The plant has more states or inputs than [`MOST_STATES`] and [`MOST_INPUTS`], or `x` or `u` has not its sizes.
pub fn jacobian(
    plant: &Plant,
    x: &[f64],
    u: &[f64],
) -> Result<(DMatrix<f64>, DMatrix<f64>), PlantError> {
    let (_, a, b) = tangent(plant, x, u)?;
    Ok((a, b))
}

/// f, A and B.
type Tangent = (DVector<f64>, DMatrix<f64>, DMatrix<f64>);

/// f and its derivatives.
fn tangent(plant: &Plant, x: &[f64], u: &[f64]) -> Result<Tangent, PlantError> {
    const BOTH: usize = MOST_STATES + MOST_INPUTS;
    // For its checks of the sizes.
    plant.output(x, u)?;
    let placed = SizedPlant::<MOST_STATES, MOST_INPUTS>::new(plant.clone())?;
    let filled = |values: &[f64], i: usize| values.get(i).copied().unwrap_or(0.0);
    let (f, a, b) = AlongMotion::<_, BOTH>(placed).tangent(
        &SVector::from_fn(|i, _| filled(x, i)),
        &SVector::from_fn(|i, _| filled(u, i)),
    );
    let (n, m) = (x.len(), u.len());
    Ok((
        DVector::from_fn(n, |i, _| f[i]),
        DMatrix::from_fn(n, n, |i, j| a[(i, j)]),
        DMatrix::from_fn(n, m, |i, j| b[(i, j)]),
    ))
}

/// The linear-quadratic regulator u = u_eq - K (x - x_eq) of the plant about (`x`, `u`), sampled every `t_s` seconds with
/// the input held; `q` (n x n) and `r` (m x m) weigh each sample.
///
/// # Errors
/// A sampling time or a size that does not fit the plant, the plant does not stand there (a state changes by more than
/// [`AT_REST`](crate::AT_REST) per second or period), or there is no such regulator.
pub fn lqr(
    plant: &Plant,
    t_s: f64,
    (q, r): (&DMatrix<f64>, &DMatrix<f64>),
    (x, u): (&[f64], &[f64]),
) -> Result<Lqr, MpcError> {
    if !(t_s > 0.0 && t_s.is_finite()) {
        let fault = format!("it is {t_s} s; it must be a positive number of seconds");
        return Err(MpcError::new("t_s", fault));
    }
    if let Some(period) = plant.period()
        && t_s != period
    {
        let fault = format!("it is {t_s} s; the plant is in discrete time, with {period} s");
        return Err(MpcError::new("t_s", fault));
    }
    let (mut change, a, b) = tangent(plant, x, u)?;
    let discrete = plant.period().is_some();
    if discrete {
        change -= DVector::from_row_slice(x);
    }
    check_rest(change.as_slice(), (x, u), discrete)
        .map_err(|fault| MpcError::new("x, u", fault))?;
    let refused = |error: &dyn std::fmt::Display| MpcError::new("lqr", error.to_string());
    let (a_d, b_d) = match plant.period() {
        None => zero_order_hold(&a, &b, t_s).map_err(|error| refused(&error))?,
        Some(_) => (a, b),
    };
    lqr_discrete(&a_d, &b_d, q, r).map_err(|error| refused(&error))
}
