//! The ballbot's regulators.

use lpvmpc_design::{check_rk4_step, lqr_continuous, lqr_discrete, poles, zero_order_hold};
use nalgebra::DMatrix;

use crate::paper::{B_OPTIMAL, at_rest, cost, from_p};

/// Agreement with values of 16 digits, up to the rounding of the problem's own matrices times the
/// condition of its equation.
fn assert_close(found: impl IntoIterator<Item = f64>, expected: &[f64]) {
    let found: Vec<f64> = found.into_iter().collect();
    assert_eq!(found.len(), expected.len());
    for (found, expected) in found.iter().zip(expected) {
        let error = (found / expected - 1.0).abs();
        assert!(error < 1e-12, "{found} for {expected}: {error:e}");
    }
}

/// Runge-Kutta steps of a linear model with a held input: the map of one step, composed.
fn runge_kutta(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    t_s: f64,
    substeps: usize,
) -> (DMatrix<f64>, DMatrix<f64>) {
    let h = t_s / substeps as f64;
    let eye = DMatrix::identity(a.nrows(), a.nrows());
    let ha = a * h;
    let series = &eye + (&eye + (&eye + &ha / 4.0) * &ha / 3.0) * &ha / 2.0;
    let (step_a, step_b) = (&eye + &series * &ha, series * b * h);
    let (mut a_d, mut b_d) = (eye, b * 0.0);
    for _ in 0..substeps {
        a_d = &step_a * a_d;
        b_d = &step_a * b_d + &step_b;
    }
    (a_d, b_d)
}

#[test]
fn the_poles_of_both_linear_models() {
    let (a, _) = at_rest(B_OPTIMAL);
    let found = poles(&a).unwrap();
    for (pole, expected) in found.iter().zip([-51.8017, -5.1484, 0.0, 4.0497]) {
        assert!((pole - expected).norm() < 5e-4, "{pole} for {expected}");
    }
    let (a, _) = from_p();
    for (pole, expected) in poles(&a).unwrap().iter().zip([-51.7, -5.49, 0.0, 4.33]) {
        assert!((pole - expected).norm() < 0.05, "{pole} for {expected}");
    }
}

// The gains and costs expected below are those of tests/reference/riccati_decimal.py.

#[test]
fn the_papers_regulator_from_p() {
    let (a, b) = from_p();
    let (q, r) = cost();
    let lqr = lqr_continuous(&a, &b, &q, &r).unwrap();
    #[rustfmt::skip]
    let k = [0.4472135954999579, -6.195773118219319, 0.2147073781797109, -1.301027182285421];
    assert_close(lqr.k.iter().copied(), &k);
    #[rustfmt::skip]
    let p = [101.0441343711236, 4138.857533177983, 5.09377211439672, 173.2761356980355];
    assert_close(lqr.p.diagonal().iter().copied(), &p);
}

#[test]
fn the_continuous_regulator_from_b() {
    let (a, b) = at_rest(B_OPTIMAL);
    let (q, r) = cost();
    let lqr = lqr_continuous(&a, &b, &q, &r).unwrap();
    #[rustfmt::skip]
    let k = [0.4472135954999579, -4.289494656231829, 0.1465976446483073, -0.9149006828512233];
    assert_close(lqr.k.iter().copied(), &k);
    #[rustfmt::skip]
    let p = [100.5324195906518, 2038.97421804272, 2.470298046587508, 86.1203596963773];
    assert_close(lqr.p.diagonal().iter().copied(), &p);
}

#[test]
fn the_discrete_regulators_from_b_with_runge_kutta_steps() {
    let (a, b) = at_rest(B_OPTIMAL);
    let (q, r) = cost();
    #[rustfmt::skip]
    let expected = [
        (
            1,
            [0.2709282872000266, -2.866484516267885, 0.09946651330399176, -0.6210511301691391],
            [2088.307252434043, 40698.67246923282, 46.09658720831674, 1701.122728969188],
        ),
        (
            4,
            [0.2692065625818213, -2.894032441464616, 0.1003133342364709, -0.6282617776702295],
            [2124.664300015335, 41717.74691608375, 50.48066643993717, 1762.568030735494],
        ),
    ];
    for (substeps, k, p) in expected {
        let (a_d, b_d) = runge_kutta(&a, &b, 0.05, substeps);
        let lqr = lqr_discrete(&a_d, &b_d, &q, &r).unwrap();
        assert_close(lqr.k.iter().copied(), &k);
        assert_close(lqr.p.diagonal().iter().copied(), &p);
    }
}

#[test]
fn the_predictors_fast_poles_and_the_exact_hold() {
    let (a, b) = at_rest(B_OPTIMAL);
    let decay = |a_d: &DMatrix<f64>, plant: f64| {
        poles(a_d)
            .unwrap()
            .into_iter()
            .map(|pole| pole.re)
            .min_by(|x, y| (x - plant).abs().total_cmp(&(y - plant).abs()))
            .unwrap()
    };
    for (substeps, expected, printed) in [(1, 0.743, 5e-4), (2, 0.0892, 5e-5), (4, 0.0755, 5e-5)] {
        let (a_d, _) = runge_kutta(&a, &b, 0.05, substeps);
        let fast = decay(&a_d, expected);
        assert!((fast - expected).abs() <= printed, "{substeps}: {fast}");
    }
    let (a_d, b_d) = zero_order_hold(&a, &b, 0.05).unwrap();
    assert!((decay(&a_d, 0.0750) - 0.0750).abs() <= 5e-5);
    assert!((b_d[2] + 24.44).abs() < 5e-3, "{}", b_d[2]);
    // The Runge-Kutta map goes to the exact one with the fourth power of the step.
    let error = |substeps| (runge_kutta(&a, &b, 0.05, substeps).0 - &a_d).norm();
    let order = (error(32) / error(64)).log2();
    assert!((order - 4.0).abs() < 0.1, "order {order}");
}

#[test]
fn the_one_step_predictor_is_beside_its_limit() {
    let (a, _) = at_rest(B_OPTIMAL);
    let one = check_rk4_step(&a, 0.05, 1).unwrap();
    // h lambda = -2.59, limit -2.785.
    assert!(
        (one.longest_step - 2.785 / 51.8017).abs() < 1e-5,
        "{}",
        one.longest_step
    );
    assert_eq!(one.fewest_substeps, 1);
    check_rk4_step(&a, 0.06, 1).unwrap_err();
}
