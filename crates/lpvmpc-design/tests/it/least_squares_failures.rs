//! Fits that must fail, and say why.

use lpvmpc_design::{
    Evaluated, LeastSquaresError, LeastSquaresSettings, RankDeficiency, ResidualModel, Termination,
    gauss_newton, levenberg_marquardt,
};
use nalgebra::{DMatrix, DVector, dmatrix, dvector};

/// A residual with its Jacobian, as two functions.
struct Functions<F, J>(F, J);

impl<F, J> ResidualModel for Functions<F, J>
where
    F: Fn(&DVector<f64>) -> DVector<f64>,
    J: Fn(&DVector<f64>) -> DMatrix<f64>,
{
    fn residual(&self, b: &DVector<f64>) -> DVector<f64> {
        (self.0)(b)
    }

    fn jacobian(&self, b: &DVector<f64>) -> DMatrix<f64> {
        (self.1)(b)
    }
}

fn settings() -> LeastSquaresSettings {
    LeastSquaresSettings::default()
}

fn arctangent() -> impl ResidualModel {
    Functions(
        |b: &DVector<f64>| dvector![b[0].atan()],
        |b: &DVector<f64>| dmatrix![1.0 / (1.0 + b[0] * b[0])],
    )
}

#[test]
fn newton_on_the_arctangent_overshoots_and_damping_helps() {
    // Newton's method on atan(b) diverges from |b| > 1.3917, a textbook example.
    let start = dvector![3.0];
    let plain = gauss_newton(&arctangent(), &start, &settings()).unwrap();
    assert!(!plain.termination.is_converged(), "{}", plain.termination);
    assert!(plain.parameters.iter().all(|b| b.is_finite()));
    assert!(plain.residual_norm.is_finite());
    assert!(plain.jacobian.iter().all(|x| x.is_finite()));
    let damped = levenberg_marquardt(&arctangent(), &start, &settings()).unwrap();
    assert!(damped.termination.is_converged(), "{}", damped.termination);
    assert!(damped.parameters[0].abs() < 1e-10);
}

#[test]
fn two_parameters_that_act_alike_are_named() {
    // Only b0 + b2 matters; b1 is seen by itself.
    let model = Functions(
        |b: &DVector<f64>| dvector![b[0] + b[2] - 1.0, b[1] - 2.0, b[0] + b[2] - 3.0],
        |_: &DVector<f64>| dmatrix![1.0, 0.0, 1.0; 0.0, 1.0, 0.0; 1.0, 0.0, 1.0],
    );
    for method in [gauss_newton, levenberg_marquardt] {
        let fit = method(&model, &dvector![0.5, 0.5, 0.7], &settings()).unwrap();
        let Termination::RankDeficient(RankDeficiency {
            rank,
            parameters,
            weakest_parameter,
        }) = fit.termination
        else {
            panic!("{}", fit.termination);
        };
        assert_eq!((rank, parameters), (2, 3));
        assert!(weakest_parameter != 1);
        let error = fit.require_converged().unwrap_err().to_string();
        assert!(error.contains("rank 2 for 3 parameters"), "{error}");
    }
}

#[test]
fn a_residual_that_leaves_the_numbers_is_reported_with_the_last_good_iterate() {
    // The full step from b = 0.01 goes to log of a negative number.
    let model = Functions(
        |b: &DVector<f64>| dvector![b[0].ln() - 1.0, b[0] - 30.0],
        |b: &DVector<f64>| dmatrix![1.0 / b[0]; 1.0],
    );
    let far = gauss_newton(&model, &dvector![200.0], &settings()).unwrap();
    assert!(far.termination.is_converged(), "{}", far.termination);
    let logarithm = Functions(
        |b: &DVector<f64>| dvector![b[0].ln()],
        |b: &DVector<f64>| dmatrix![1.0 / b[0]],
    );
    let start = dvector![10.0];
    let fit = gauss_newton(&logarithm, &start, &settings()).unwrap();
    let Termination::NonFinite { what, at } = &fit.termination else {
        panic!("{}", fit.termination);
    };
    assert_eq!(*what, Evaluated::Residual);
    assert!((at[0] - (10.0 - 10.0 * 10.0_f64.ln())).abs() < 1e-12);
    assert_eq!(fit.parameters, start);
    assert!(fit.residual_norm.is_finite());
    let damped = levenberg_marquardt(&logarithm, &start, &settings()).unwrap();
    assert!(
        (damped.parameters[0] - 1.0).abs() < 1e-10,
        "{}",
        damped.parameters[0]
    );
}

#[test]
fn the_cap_is_reported() {
    let capped = LeastSquaresSettings {
        max_iterations: 2,
        ..settings()
    };
    let square = Functions(
        |b: &DVector<f64>| dvector![b[0] * b[0] - 2.0],
        |b: &DVector<f64>| dmatrix![2.0 * b[0]],
    );
    let fit = gauss_newton(&square, &dvector![1000.0], &capped).unwrap();
    assert_eq!(fit.termination, Termination::IterationCap { cap: 2 });
    assert_eq!(fit.steps(), 2);
    let fit = levenberg_marquardt(&square, &dvector![1000.0], &capped).unwrap();
    assert_eq!(fit.termination, Termination::IterationCap { cap: 4 });
    let error = fit.require_converged().unwrap_err().to_string();
    assert!(error.contains("cap of 4"), "{error}");
}

#[test]
fn a_cycle_of_full_steps_is_stagnation() {
    // Newton on sign(b) sqrt|b| goes from b to -b for ever.
    let root = Functions(
        |b: &DVector<f64>| dvector![b[0].signum() * b[0].abs().sqrt()],
        |b: &DVector<f64>| dmatrix![0.5 / b[0].abs().sqrt()],
    );
    let fit = gauss_newton(&root, &dvector![1.0], &settings()).unwrap();
    assert_eq!(fit.termination, Termination::Stagnation);
}

#[test]
fn an_exact_root_is_found_to_the_last_digit() {
    let square = Functions(
        |b: &DVector<f64>| dvector![b[0] * b[0] - 2.0, 3.0 * (b[0] * b[0] - 2.0)],
        |b: &DVector<f64>| dmatrix![2.0 * b[0]; 6.0 * b[0]],
    );
    for method in [gauss_newton, levenberg_marquardt] {
        let fit = method(&square, &dvector![1.0], &settings()).unwrap();
        assert!(fit.termination.is_converged(), "{}", fit.termination);
        assert!((fit.parameters[0] - 2.0_f64.sqrt()).abs() < 1e-15);
    }
}

#[test]
fn mistakes_in_the_problem_are_errors() {
    let square = Functions(
        |b: &DVector<f64>| dvector![b[0] * b[0] - 2.0],
        |b: &DVector<f64>| dmatrix![2.0 * b[0]],
    );
    for method in [gauss_newton, levenberg_marquardt] {
        let wrong_shape = method(&square, &dvector![1.0, 2.0], &settings());
        assert!(matches!(
            wrong_shape,
            Err(LeastSquaresError::TooFewEquations {
                equations: 1,
                parameters: 2
            })
        ));
        let not_finite = method(&square, &dvector![f64::NAN], &settings());
        assert!(matches!(
            not_finite,
            Err(LeastSquaresError::NonFiniteStart {
                what: Evaluated::Parameters,
                ..
            })
        ));
        for (weights, index) in [(dvector![0.0], 0), (dvector![f64::INFINITY], 0)] {
            let weighted = LeastSquaresSettings {
                weights: Some(weights),
                ..settings()
            };
            let error = method(&square, &dvector![1.0], &weighted).unwrap_err();
            assert!(matches!(error, LeastSquaresError::Weight { index: i, .. } if i == index));
        }
        let two_weights = LeastSquaresSettings {
            weights: Some(dvector![1.0, 1.0]),
            ..settings()
        };
        let error = method(&square, &dvector![1.0], &two_weights).unwrap_err();
        assert!(matches!(error, LeastSquaresError::WeightCount { .. }));
        let negative = LeastSquaresSettings {
            step_tolerance: -1.0,
            ..settings()
        };
        let error = method(&square, &dvector![1.0], &negative).unwrap_err();
        assert!(
            error.to_string().contains("step_tolerance is -1"),
            "{error}"
        );
    }
}

#[test]
fn a_jacobian_of_the_wrong_shape_or_a_residual_that_changes_length_is_an_error() {
    let tall = Functions(
        |b: &DVector<f64>| dvector![b[0], 1.0],
        |_: &DVector<f64>| dmatrix![1.0],
    );
    let growing = Functions(
        |b: &DVector<f64>| DVector::from_element(if b[0] == 1.0 { 1 } else { 2 }, b[0]),
        |_: &DVector<f64>| dmatrix![1.0],
    );
    for method in [gauss_newton, levenberg_marquardt] {
        let error = method(&tall, &dvector![1.0], &settings()).unwrap_err();
        assert!(matches!(error, LeastSquaresError::JacobianShape { .. }));
    }
    for method in [gauss_newton, levenberg_marquardt] {
        let error = method(&growing, &dvector![1.0], &settings()).unwrap_err();
        assert!(matches!(error, LeastSquaresError::ResidualLength { .. }));
    }
}
