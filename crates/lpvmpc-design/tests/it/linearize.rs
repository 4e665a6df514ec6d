//! Linear models from values of f, against derivatives by hand.

use lpvmpc::LpvModel;
use lpvmpc_design::{LinearizeError, Variable, controllability_rank, linearize};
use nalgebra::{DMatrix, SMatrix, SVector};

use crate::paper::{B_OPTIMAL, Ballbot};

type State = SVector<f64, 2>;
type Input = SVector<f64, 1>;

#[test]
fn a_function_with_known_derivatives() {
    let f = |x: &State, u: &Input| {
        State::new(
            (x[0] * x[1]).exp() + u[0].sin(),
            x[0].powi(3) / (1.0 + x[1] * x[1]),
        )
    };
    let (x, u) = (State::new(1.3, -0.4), Input::new(0.7));
    let found = linearize(f, &x, &u).unwrap();
    let e = (x[0] * x[1]).exp();
    let n = 1.0 + x[1] * x[1];
    #[rustfmt::skip]
    let a = SMatrix::<f64, 2, 2>::new(
        x[1] * e, x[0] * e,
        3.0 * x[0] * x[0] / n, -2.0 * x[1] * x[0].powi(3) / (n * n),
    );
    let b = SMatrix::<f64, 2, 1>::new(u[0].cos(), 0.0);
    assert!((found.a - a).norm() < 1e-12, "{}", found.a - a);
    assert!((found.b - b).norm() < 1e-12, "{}", found.b - b);
    assert!((found.a - a).amax() <= found.error_estimate);
    assert!((found.defect - f(&x, &u)).norm() < 1e-15);
}

#[test]
fn the_ballbot_upright_is_an_equilibrium_with_the_lpv_models_matrices() {
    let model = Ballbot { b: B_OPTIMAL };
    let f = |x: &SVector<f64, 4>, u: &SVector<f64, 1>| model.derivative(x, u);
    let found = linearize(f, &SVector::zeros(), &SVector::zeros()).unwrap();
    let (a, b) = model.matrices(&SVector::zeros());
    assert_eq!(found.defect.norm(), 0.0);
    assert!((found.a - a).norm() < 1e-11 * a.norm(), "{}", found.a - a);
    assert!((found.b - b).norm() < 1e-12 * b.norm(), "{}", found.b - b);
    let a = DMatrix::from_column_slice(4, 4, found.a.as_slice());
    let b = DMatrix::from_column_slice(4, 1, found.b.as_slice());
    assert_eq!(controllability_rank(&a, &b).unwrap(), 4);
}

#[test]
fn away_from_rest_the_linear_model_follows_the_plant_to_second_order() {
    let model = Ballbot { b: B_OPTIMAL };
    let f = |x: &SVector<f64, 4>, u: &SVector<f64, 1>| model.derivative(x, u);
    let x = SVector::<f64, 4>::new(2.0, 0.4, -3.0, 1.5);
    let u = SVector::<f64, 1>::new(0.3);
    let linear = linearize(f, &x, &u).unwrap();
    let dx = SVector::<f64, 4>::new(0.3, -0.2, 0.5, 0.4);
    let du = SVector::<f64, 1>::new(0.1);
    let gap = |size: f64| {
        let predicted = linear.defect + (linear.a * dx + linear.b * du) * size;
        (f(&(x + dx * size), &(u + du * size)) - predicted).norm()
    };
    let order = (gap(1e-2) / gap(5e-3)).log2();
    assert!((order - 2.0).abs() < 0.05, "order {order}");
    assert!(linear.defect.norm() > 1.0, "not an equilibrium");
}

#[test]
fn a_steep_function_of_small_states_is_resolved() {
    // All of the change happens within 1e-3 of the point.
    let f = |x: &SVector<f64, 1>, _: &SVector<f64, 1>| SVector::<f64, 1>::new((x[0] / 1e-3).tanh());
    let found = linearize(f, &SVector::zeros(), &SVector::zeros()).unwrap();
    assert!((found.a[0] - 1000.0).abs() < 1e-5, "{}", found.a[0]);
    assert!((found.a[0] - 1000.0).abs() <= found.error_estimate);
}

#[test]
fn a_kink_nearby_is_passed_under_and_at_a_kink_the_slopes_are_averaged() {
    let f = |x: &SVector<f64, 1>, _: &SVector<f64, 1>| SVector::<f64, 1>::new(x[0].max(0.0));
    let zero = SVector::<f64, 1>::zeros();
    for (x, slope) in [(0.003, 1.0), (0.0, 0.5), (-0.003, 0.0)] {
        let found = linearize(f, &SVector::<f64, 1>::new(x), &zero).unwrap();
        assert!((found.a[0] - slope).abs() < 1e-12, "{} at {x}", found.a[0]);
    }
}

#[test]
fn steps_out_of_the_domain_are_left_out_and_no_domain_is_an_error() {
    let root = |x: &SVector<f64, 1>, _: &SVector<f64, 1>| SVector::<f64, 1>::new(x[0].sqrt());
    let zero = SVector::<f64, 1>::zeros();
    let near = SVector::<f64, 1>::new(0.01);
    let found = linearize(root, &near, &zero).unwrap();
    assert!((found.a[0] - 5.0).abs() < 1e-9, "{}", found.a[0]);
    let error = linearize(root, &zero, &zero).unwrap_err();
    assert!(matches!(
        error,
        LinearizeError::NotDifferentiable {
            variable: Variable::State(0),
            ..
        }
    ));
    assert!(error.to_string().contains("x[0]"), "{error}");
    let error = linearize(root, &-near, &zero).unwrap_err();
    assert!(matches!(error, LinearizeError::NonFinite { row: 0, .. }));
}
