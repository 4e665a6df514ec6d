//! From the information of a fit to the covariance of the parameters.

use lpvmpc_design::{ShootingFit, ShootingModel, ShootingProblem};
use nalgebra::DMatrix;

/// The covariance of the parameters from the information, and for coloured residuals: from the
/// scatter of the segments, but no variance below that of the information, in which coloured rows
/// count as the fewer white ones that they are worth. An error that repeats itself in every segment
/// does not scatter.
///
/// `jacobian` is the derivative of the parameters by the coordinates of the fit.
pub fn covariances<M: ShootingModel<4, 3>>(
    problem: &ShootingProblem<'_, M, 4, 3>,
    fit: &ShootingFit<4>,
    jacobian: &DMatrix<f64>,
) -> (DMatrix<f64>, DMatrix<f64>) {
    let reduced = problem.reduced(&fit.parameters, &fit.initial, &fit.reduced.indices);
    let n = reduced.indices.len();
    let inverse = inverse(&reduced.information);
    let mut meat = DMatrix::zeros(n, n);
    for score in &reduced.scores {
        meat += score * score.transpose();
    }
    // What the segments' scores lose to the parameters that were fitted to them.
    let segments = reduced.scores.len() as f64;
    let lost = segments / (segments - n as f64).max(1.0);
    // What was known beforehand scatters, too.
    let prior = problem.prior_information(&fit.parameters, &reduced.indices);
    let scatter = &inverse * (meat * lost + prior) * &inverse;
    let of = |covariance: &DMatrix<f64>| of_parameters(covariance, &reduced.indices, jacobian);
    let (white, scatter) = (of(&inverse), of(&scatter));
    let growth = white
        .diagonal()
        .zip_map(&scatter.diagonal(), |least, scatter| {
            if scatter < least && scatter > 0.0 {
                (least / scatter).sqrt()
            } else {
                1.0
            }
        });
    let growth = DMatrix::from_diagonal(&growth);
    (white, &growth * scatter * &growth)
}

/// The covariance of all parameters from that of the coordinates `indices`; zero for the others.
pub fn of_parameters(
    covariance: &DMatrix<f64>,
    indices: &[usize],
    jacobian: &DMatrix<f64>,
) -> DMatrix<f64> {
    let all = jacobian.ncols();
    let mut whole = DMatrix::zeros(all, all);
    for (i, row) in indices.iter().enumerate() {
        for (j, column) in indices.iter().enumerate() {
            whole[(*row, *column)] = covariance[(i, j)];
        }
    }
    jacobian * whole * jacobian.transpose()
}

/// Correlation of two; zero where one does not vary.
pub fn correlation(covariance: &DMatrix<f64>, i: usize, j: usize) -> f64 {
    let scale = (covariance[(i, i)] * covariance[(j, j)]).sqrt();
    if scale > 0.0 {
        covariance[(i, j)] / scale
    } else {
        0.0
    }
}

/// Inverse of an information matrix; infinite where it tells nothing.
pub fn inverse(information: &DMatrix<f64>) -> DMatrix<f64> {
    let n = information.nrows();
    let scale = information.diagonal().map(|entry| 1.0 / entry.sqrt());
    let scaled = DMatrix::from_fn(n, n, |i, j| information[(i, j)] * scale[i] * scale[j]);
    match scaled.cholesky() {
        Some(factor) => {
            let inverse = factor.inverse();
            DMatrix::from_fn(n, n, |i, j| inverse[(i, j)] * scale[i] * scale[j])
        }
        None => DMatrix::from_diagonal_element(n, n, f64::INFINITY),
    }
}
