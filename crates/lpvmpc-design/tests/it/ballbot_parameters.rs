//! The refinement of the ballbot's parameters, section IV-A of the paper.

use lpvmpc_design::{
    Fit, LeastSquaresError, LeastSquaresSettings, ResidualModel, gauss_newton, levenberg_marquardt,
};
use nalgebra::DVector;

use crate::paper::{B_OPTIMAL, B_PRINTED, P6, Refinement};

const NEAR: [f64; 4] = [0.0025, 0.06, 0.14, -0.07];
const FAR: [f64; 4] = [0.001, 0.05, 0.1, 0.01];
const TOO_FAR: [f64; 4] = [0.01, 0.05, 0.1, -0.05];

fn settings() -> LeastSquaresSettings {
    LeastSquaresSettings::default()
}

fn assert_optimal(fit: &Fit) {
    assert!(fit.termination.is_converged(), "{}", fit.termination);
    assert!(
        (fit.residual_norm - 0.432969).abs() < 1e-6,
        "residual norm {}",
        fit.residual_norm
    );
    for (found, printed) in fit.parameters.iter().zip(B_OPTIMAL) {
        assert!((found - printed).abs() < 1e-7, "{found} for {printed}");
    }
    // The optimality condition itself: J'F = 0, each column against the residual.
    let gradient = fit.jacobian.transpose() * &fit.residual;
    for (slope, column) in gradient.iter().zip(fit.jacobian.column_iter()) {
        let cosine = slope.abs() / (column.norm() * fit.residual.norm());
        assert!(cosine < 1e-7, "cosine {cosine:e}");
    }
}

#[test]
fn the_test_jacobian_is_the_derivative_of_the_residual() {
    let model = Refinement { p6: P6 };
    let b = DVector::from_row_slice(&FAR);
    let jacobian = model.jacobian(&b);
    for column in 0..4 {
        let step = 1e-6 * b[column].abs();
        let (mut above, mut below) = (b.clone(), b.clone());
        above[column] += step;
        below[column] -= step;
        let difference = (model.residual(&above) - model.residual(&below)) / (2.0 * step);
        let error = (difference - jacobian.column(column)).norm();
        assert!(
            error < 1e-7 * jacobian.column(column).norm(),
            "column {column}: {error:e}"
        );
    }
}

#[test]
fn gauss_newton_takes_the_papers_four_to_five_steps() {
    let start = DVector::from_row_slice(&NEAR);
    let fit = gauss_newton(&Refinement { p6: P6 }, &start, &settings()).unwrap();
    assert_optimal(&fit);
    assert!((4..=5).contains(&fit.steps()), "{} steps", fit.steps());
}

#[test]
fn gauss_newton_takes_five_to_six_steps_from_further_off() {
    let start = DVector::from_row_slice(&FAR);
    let fit = gauss_newton(&Refinement { p6: P6 }, &start, &settings()).unwrap();
    assert_optimal(&fit);
    assert!((5..=6).contains(&fit.steps()), "{} steps", fit.steps());
}

#[test]
fn gauss_newton_diverges_where_levenberg_marquardt_converges() {
    let start = DVector::from_row_slice(&TOO_FAR);
    let model = Refinement { p6: P6 };
    let plain = gauss_newton(&model, &start, &settings()).unwrap();
    assert!(!plain.termination.is_converged());
    let error = plain.require_converged().unwrap_err();
    assert!(matches!(error, LeastSquaresError::DidNotConverge { .. }));
    assert!(error.to_string().contains("did not converge"), "{error}");
    assert_optimal(&levenberg_marquardt(&model, &start, &settings()).unwrap());
}

#[test]
fn levenberg_marquardt_converges_from_every_start_and_never_gets_worse() {
    for start in [NEAR, FAR, TOO_FAR] {
        let start = DVector::from_row_slice(&start);
        let fit = levenberg_marquardt(&Refinement { p6: P6 }, &start, &settings()).unwrap();
        assert_optimal(&fit);
        assert_eq!(fit.history[0].parameters, start);
        assert_eq!(fit.history.last().unwrap().parameters, fit.parameters);
        for pair in fit.history.windows(2) {
            assert!(pair[1].residual_norm <= pair[0].residual_norm);
            let step = (&pair[1].parameters - &pair[0].parameters).norm();
            assert_eq!(pair[1].step_norm, step);
        }
    }
}

#[test]
fn the_printed_sign_of_p6_does_not_fit_the_printed_parameters() {
    let b = DVector::from_row_slice(&B_PRINTED);
    let printed = Refinement { p6: -P6 }.residual(&b).norm();
    assert!((printed - 503.68).abs() < 0.005, "{printed}");
    let corrected = Refinement { p6: P6 }.residual(&b).norm();
    assert!((corrected - 0.43334).abs() < 5e-6, "{corrected}");
}

#[test]
fn weights_move_the_fit_to_the_equations_they_favour() {
    let start = DVector::from_row_slice(&NEAR);
    let model = Refinement { p6: P6 };
    let weights = DVector::from_row_slice(&[1.0, 1.0, 1.0, 1.0, 100.0, 1.0]);
    let weighted = LeastSquaresSettings {
        weights: Some(weights.clone()),
        ..settings()
    };
    let plain = gauss_newton(&model, &start, &settings()).unwrap();
    let fit = gauss_newton(&model, &start, &weighted).unwrap();
    assert!(fit.termination.is_converged(), "{}", fit.termination);
    assert!(fit.residual[4].abs() < 0.1 * plain.residual[4].abs());
    let norm = fit.residual.component_mul(&weights).norm();
    assert!((fit.residual_norm - norm).abs() < 1e-12 * norm);
    let damped = levenberg_marquardt(&model, &start, &weighted).unwrap();
    assert!((damped.parameters - fit.parameters).norm() < 1e-9);
}
