//! Gains over a scheduling box, and what the check does not say.

use std::f64::consts::PI;

use lpvmpc::LpvModel;
use lpvmpc_design::{
    FrozenError, SchedulingGrid, frozen_stability, lqr_continuous, poles, zero_order_hold,
};
use nalgebra::{DMatrix, SMatrix, SVector};

use crate::paper::{B_PRINTED, Ballbot, at_rest, cost, from_p};

/// Largest real part over |theta| <= pi/3, |theta_dot| <= 2 pi, b = b*, with the regulator of the
/// linear model (a, b) for Q with `phi_cost` in its first entry.
fn largest_real_part(linear: (DMatrix<f64>, DMatrix<f64>), phi_cost: f64, points: usize) -> f64 {
    let (mut q, r) = cost();
    q[(0, 0)] = phi_cost;
    let Ok(lqr) = lqr_continuous(&linear.0, &linear.1, &q, &r) else {
        return f64::NAN;
    };
    let k = SMatrix::<f64, 1, 4>::from_column_slice(lqr.k.as_slice());
    let upper = SVector::<f64, 2>::new(PI / 3.0, 2.0 * PI);
    let Ok(grid) = SchedulingGrid::new(-upper, upper, [points, points]) else {
        return f64::NAN;
    };
    match frozen_stability(&Ballbot { b: B_PRINTED }, &k, &grid) {
        Ok(found) if found.is_hurwitz() => found.largest_real_part,
        _ => f64::NAN,
    }
}

#[test]
fn the_ballbot_is_hurwitz_over_the_papers_box() {
    for (linear, phi_cost, expected) in [
        (from_p(), 200.0, -1.920),
        (from_p(), 1000.0, -2.224),
        (at_rest(B_PRINTED), 200.0, -1.475),
    ] {
        let found = largest_real_part(linear, phi_cost, 41);
        assert!((found - expected).abs() < 5e-4, "{found} for {expected}");
    }
}

#[test]
fn without_a_gain_the_ballbot_falls() {
    let upper = SVector::<f64, 2>::new(0.0, 0.0);
    let grid = SchedulingGrid::new(upper, upper, [1, 1]).unwrap();
    let found = frozen_stability(
        &Ballbot { b: B_PRINTED },
        &SMatrix::<f64, 1, 4>::zeros(),
        &grid,
    )
    .unwrap();
    assert!(!found.is_hurwitz());
    assert_eq!(found.points, 1);
    let (a, _) = at_rest(B_PRINTED);
    assert_eq!(found.pole, *poles(&a).unwrap().last().unwrap());
}

/// Goes from one damped oscillator to another that turns the other way round its axes.
struct Switching;

impl LpvModel<f64, 2, 1, 1> for Switching {
    fn scheduling(&self, x: &SVector<f64, 2>, _: &SVector<f64, 1>) -> SVector<f64, 1> {
        SVector::<f64, 1>::new(if x[0] * x[1] > 0.0 { 0.0 } else { 1.0 })
    }

    fn matrices(&self, s: &SVector<f64, 1>) -> (SMatrix<f64, 2, 2>, SMatrix<f64, 2, 1>) {
        let a = SMatrix::<f64, 2, 2>::new(-0.1, 10.0 - 9.0 * s[0], -1.0 - 9.0 * s[0], -0.1);
        (a, SMatrix::<f64, 2, 1>::new(0.0, 1.0))
    }
}

#[test]
fn every_frozen_loop_is_stable_and_the_moving_one_is_not() {
    let (lower, upper) = (SVector::<f64, 1>::new(0.0), SVector::<f64, 1>::new(1.0));
    let grid = SchedulingGrid::new(lower, upper, [101]).unwrap();
    let k = SMatrix::<f64, 1, 2>::zeros();
    let found = frozen_stability(&Switching, &k, &grid).unwrap();
    assert!((found.largest_real_part + 0.1).abs() < 1e-12);

    let mut x = SVector::<f64, 2>::new(1.0, 0.1);
    let start = x.norm();
    let step = 1e-3;
    let flow = |s: f64| {
        let (a, b) = Switching.matrices(&SVector::<f64, 1>::new(s));
        let a = DMatrix::from_column_slice(2, 2, a.as_slice());
        let b = DMatrix::from_column_slice(2, 1, b.as_slice());
        SMatrix::<f64, 2, 2>::from_column_slice(zero_order_hold(&a, &b, step).unwrap().0.as_slice())
    };
    let (first, second) = (flow(0.0), flow(1.0));
    for _ in 0..5000 {
        let s = Switching.scheduling(&x, &SVector::zeros())[0];
        x = if s == 0.0 { first * x } else { second * x };
    }
    assert!(x.norm() > 1000.0 * start, "{}", x.norm());
}

#[test]
fn a_grid_reaches_its_faces() {
    let lower = SVector::<f64, 2>::new(-0.3, 1.0);
    let upper = SVector::<f64, 2>::new(0.7, 3.0);
    let grid = SchedulingGrid::new(lower, upper, [7, 3]).unwrap();
    assert_eq!(grid.point_count(), 21);
    let points: Vec<_> = grid.points().collect();
    assert_eq!(points.len(), 21);
    assert_eq!(points[0], lower);
    assert_eq!(points[20], upper);
    assert_eq!(points[6], SVector::<f64, 2>::new(0.7, 1.0));
    assert_eq!(points[7], SVector::<f64, 2>::new(-0.3, 2.0));
}

#[test]
fn bad_boxes_and_bad_models_are_named() {
    let of = |x: f64| SVector::<f64, 1>::new(x);
    for (lower, upper, points) in [(1.0, 0.0, 5), (f64::NAN, 1.0, 5), (0.0, f64::INFINITY, 5)] {
        let error = SchedulingGrid::new(of(lower), of(upper), [points]).unwrap_err();
        assert!(
            matches!(error, FrozenError::Box { index: 0, .. }),
            "{error}"
        );
    }
    for points in [0, 1] {
        let error = SchedulingGrid::new(of(0.0), of(1.0), [points]).unwrap_err();
        assert!(matches!(error, FrozenError::Points { .. }), "{error}");
    }
    let singular = Ballbot {
        b: [f64::NAN, 0.06, 0.14, -0.07],
    };
    let zero = SVector::<f64, 2>::zeros();
    let grid = SchedulingGrid::new(zero, zero, [1, 1]).unwrap();
    let error = frozen_stability(&singular, &SMatrix::<f64, 1, 4>::zeros(), &grid).unwrap_err();
    assert!(
        error
            .to_string()
            .starts_with("at the scheduling [0.0, 0.0]: A - B K["),
        "{error}"
    );
}
