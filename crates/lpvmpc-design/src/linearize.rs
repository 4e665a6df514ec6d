//! Linearisation of x_dot = f(x, u), or x+ = f(x, u), from values of f alone.

use crate::number_text;
use nalgebra::{SMatrix, SVector};
use thiserror::Error;

/// f(x, u) + A dx + B du: the linear model of f at a point.
#[derive(Debug, Clone, PartialEq)]
pub struct Linearization<const NX: usize, const NU: usize> {
    /// df/dx, NX x NX.
    pub a: SMatrix<f64, NX, NX>,
    /// df/du, NX x NU.
    pub b: SMatrix<f64, NX, NU>,
    /// f(x, u) at the point itself: zero exactly when (x, u) is an equilibrium of x_dot = f. It is
    /// the constant term of the linear model, so look at it before leaving it out.
    pub defect: SVector<f64, NX>,
    /// The largest estimated absolute error of an entry of A or B.
    pub error_estimate: f64,
}

/// The function cannot be differentiated at the point.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum LinearizeError {
    /// f is NaN or infinite at the point.
    #[error(
        "f(x, u)[{row}] is {value} at the point of linearisation: it must be finite",
        value = number_text(*value)
    )]
    NonFinite {
        /// Component of f, counted from 0.
        row: usize,
        /// Its value.
        value: f64,
    },
    /// f is NaN or infinite however near the point is approached.
    #[error(
        "f is not finite beside the point of linearisation when {variable} is moved \
         by {step:e} up and down"
    )]
    NotDifferentiable {
        /// The state or input that was moved.
        variable: Variable,
        /// The smallest step tried.
        step: f64,
    },
}

/// A component of the point of linearisation, counted from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Variable {
    /// The state with this number.
    State(usize),
    /// The input with this number.
    Input(usize),
}

impl std::fmt::Display for Variable {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::State(index) => write!(f, "x[{index}]"),
            Self::Input(index) => write!(f, "u[{index}]"),
        }
    }
}

/// The largest step, relative to max(1, |x_i|).
const FIRST_STEP: f64 = 1.0 / 16.0;

/// Step sizes tried, each half of the one before: down to 3e-5 relative, where rounding of the
/// difference (1e-16 / 3e-5) has long overtaken the extrapolated truncation.
const LEVELS: usize = 12;

/// Linearises `f` at (`x`, `u`), in whatever units f has.
///
/// Each column is a central difference at halving steps, extrapolated to step zero (Richardson;
/// the tableau and the choice of its best entry are Ridders', Adv. Eng. Softw. 4 (1982)). For a
/// smooth f the error is near 1e-12 relative to the size of f; `error_estimate` says what was
/// reached. Steps at which f is not finite are left out. At a kink of f the slope is the mean of
/// the slopes on both sides, and nothing warns of it.
///
/// # Errors
/// f is not finite at the point, or near it along some variable.
pub fn linearize<const NX: usize, const NU: usize>(
    f: impl Fn(&SVector<f64, NX>, &SVector<f64, NU>) -> SVector<f64, NX>,
    x: &SVector<f64, NX>,
    u: &SVector<f64, NU>,
) -> Result<Linearization<NX, NU>, LinearizeError> {
    let defect = f(x, u);
    if let Some(row) = defect.iter().position(|value| !value.is_finite()) {
        return Err(LinearizeError::NonFinite {
            row,
            value: defect[row],
        });
    }
    let mut linearization = Linearization {
        a: SMatrix::zeros(),
        b: SMatrix::zeros(),
        defect,
        error_estimate: 0.0,
    };
    for column in 0..NX {
        let along = |moved| {
            let mut state = *x;
            state[column] = moved;
            f(&state, u)
        };
        let (slope, error) = derivative(along, x[column], Variable::State(column))?;
        linearization.a.set_column(column, &slope);
        linearization.error_estimate = linearization.error_estimate.max(error);
    }
    for column in 0..NU {
        let along = |moved| {
            let mut input = *u;
            input[column] = moved;
            f(x, &input)
        };
        let (slope, error) = derivative(along, u[column], Variable::Input(column))?;
        linearization.b.set_column(column, &slope);
        linearization.error_estimate = linearization.error_estimate.max(error);
    }
    Ok(linearization)
}

/// dg/dx at `at` and the largest estimated error of its entries.
fn derivative<const NX: usize>(
    g: impl Fn(f64) -> SVector<f64, NX>,
    at: f64,
    variable: Variable,
) -> Result<(SVector<f64, NX>, f64), LinearizeError> {
    let mut step = FIRST_STEP * at.abs().max(1.0);
    let mut best: Option<(SVector<f64, NX>, SVector<f64, NX>)> = None;
    let mut row: Vec<SVector<f64, NX>> = Vec::with_capacity(LEVELS);
    for level in 0..LEVELS {
        if level > 0 {
            step *= 0.5;
        }
        // The distance between the rounded arguments, not twice the step, divides the difference.
        let (above, below) = (at + step, at - step);
        let (up, down) = (g(above), g(below));
        let difference = (up - down) / (above - below);
        if !difference.iter().all(|value| value.is_finite()) {
            row.clear();
            continue;
        }
        let next = extrapolated(difference, &row);
        let rounding = (up.abs() + down.abs()) * (f64::EPSILON / (above - below));
        best = improved(best, &next, &row, &rounding);
        row = next;
    }
    let (slope, error) = best.ok_or(LinearizeError::NotDifferentiable { variable, step })?;
    Ok((slope, error.max()))
}

/// The next row of the tableau: entry j has the error terms up to step^(2j) removed.
fn extrapolated<const NX: usize>(
    difference: SVector<f64, NX>,
    previous: &[SVector<f64, NX>],
) -> Vec<SVector<f64, NX>> {
    let mut row = vec![difference];
    let mut factor = 1.0;
    let mut entry = difference;
    for coarser in previous {
        factor *= 4.0;
        entry += (entry - coarser) / (factor - 1.0);
        row.push(entry);
    }
    row
}

/// Component by component, the entry with the least error: what it differs from its two parents
/// in the tableau, and no less than the `rounding` of the row's difference quotient, for parents
/// may agree by chance.
fn improved<const NX: usize>(
    best: Option<(SVector<f64, NX>, SVector<f64, NX>)>,
    row: &[SVector<f64, NX>],
    previous: &[SVector<f64, NX>],
    rounding: &SVector<f64, NX>,
) -> Option<(SVector<f64, NX>, SVector<f64, NX>)> {
    let mut best = best;
    for (parents, entry) in row.iter().zip(previous).zip(row.iter().skip(1)) {
        let (finer, coarser) = parents;
        let (slope, error) = best.get_or_insert((*entry, SVector::repeat(f64::INFINITY)));
        for i in 0..NX {
            let disagreement = (entry[i] - finer[i])
                .abs()
                .max((entry[i] - coarser[i]).abs());
            let new_error = disagreement.max(rounding[i]);
            if new_error < error[i] {
                slope[i] = entry[i];
                error[i] = new_error;
            }
        }
    }
    best
}
