//! Whether the Runge-Kutta steps of a prediction are short enough for a plant.

use crate::error::MpcError;
use lpvmpc_design::poles;
use nalgebra::{Complex, DMatrix};

/// Growth in a step that rounding may make of none.
const ROUNDING: f64 = 1e-9;
/// More steps in a sample than this are none that are waited for.
const MOST: usize = 10_000;

/// Refuses a number of Runge-Kutta steps in a sample that is none, or more than are waited for.
pub(crate) fn check_count(substeps: usize) -> Result<(), MpcError> {
    if (1..=MOST).contains(&substeps) {
        return Ok(());
    }
    let fault =
        format!("there are {substeps} sub-steps in a sample; there must be from 1 to {MOST}");
    Err(MpcError::new("substeps", fault))
}

/// Refuses `substeps` of the `t_s` seconds of a sample under which the prediction of a mode that decays would grow. `a` is
/// the derivative of f where the plant stands; one that is not finite says nothing.
pub(crate) fn check_substeps(a: &DMatrix<f64>, t_s: f64, substeps: usize) -> Result<(), MpcError> {
    // Zero substeps and the like have a message of their own.
    let Ok(poles) = poles(a) else { return Ok(()) };
    let grows = |pole: &Complex<f64>, steps: usize| {
        pole.re < 0.0 && growth(*pole * (t_s / steps as f64)) > 1.0 + ROUNDING
    };
    let Some(fastest) = { poles.iter() }
        .filter(|pole| grows(pole, substeps.max(1)))
        .max_by(|one, other| one.norm().total_cmp(&other.norm()))
    else {
        return Ok(());
    };
    let needed = (substeps.max(1)..=MOST).find(|steps| !poles.iter().any(|p| grows(p, *steps)));
    let right = match needed {
        Some(steps) => format!("at least {steps} substeps are needed, and more for accuracy"),
        None => format!("more than {MOST} substeps would be needed: leave out what is so fast"),
    };
    let fault = format!(
        "with {substeps} in {t_s} s the prediction of what decays in {:.2e} s would grow without \
         bound; {right}",
        -1.0 / fastest.re
    );
    Err(MpcError::new("substeps", fault))
}

/// |R(z)| of the classical Runge-Kutta method of order four: how much a mode grows in a step, for z the step times its pole.
fn growth(z: Complex<f64>) -> f64 {
    let one = Complex::new(1.0, 0.0);
    (one + z * (one + z / 2.0 * (one + z / 3.0 * (one + z / 4.0)))).norm()
}
