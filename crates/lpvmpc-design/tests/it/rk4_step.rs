//! The limit of the Runge-Kutta step, against the method itself.

use lpvmpc_design::{Rk4StepError, accurate_rk4_substeps, check_rk4_step};
use nalgebra::{Complex, DMatrix, dmatrix};

/// |x| after one Runge-Kutta step of x_dot = z x from 1, taken stage by stage.
fn one_step(z: Complex<f64>) -> f64 {
    let one = Complex::from(1.0);
    let k1 = z * one;
    let k2 = z * (one + k1 * 0.5);
    let k3 = z * (one + k2 * 0.5);
    let k4 = z * (one + k3);
    (one + (k1 + k2 * 2.0 + k3 * 2.0 + k4) / 6.0).norm()
}

fn oscillator(pole: Complex<f64>) -> DMatrix<f64> {
    dmatrix![pole.re, pole.im; -pole.im, pole.re]
}

#[test]
fn every_ray_into_the_left_half_plane_leaves_the_stability_region_once_at_the_reported_limit() {
    for tenth_degree in 901..=1800 {
        let angle = f64::from(tenth_degree) / 1800.0 * std::f64::consts::PI;
        let pole = Complex::from_polar(1.0, angle);
        let limit = check_rk4_step(&oscillator(pole), 1e-3, 1)
            .unwrap()
            .longest_step;
        for part in 1..2000 {
            let radius = f64::from(part) * 4.0 / 2000.0;
            let stable = one_step(pole * radius) <= 1.0;
            assert_eq!(
                stable,
                radius <= limit,
                "angle {angle}, radius {radius}, limit {limit}"
            );
        }
        assert!(one_step(pole * 50.0) > 1.0);
    }
}

#[test]
fn a_step_that_is_too_long_names_pole_step_and_remedy() {
    let a = DMatrix::from_diagonal(&nalgebra::dvector![3.0, -143.0, -2.0]);
    let error = check_rk4_step(&a, 0.05, 1).unwrap_err();
    let Rk4StepError::TooLong {
        pole,
        amplification,
        longest_step,
        fewest_substeps,
        ..
    } = error.clone()
    else {
        panic!("{error}");
    };
    assert_eq!(pole, Complex::from(-143.0));
    assert!((amplification - one_step(Complex::from(-143.0 * 0.05))).abs() < 1e-12 * amplification);
    assert!((longest_step - 2.7852936 / 143.0).abs() < 1e-9);
    assert_eq!(fewest_substeps, 3);
    let text = error.to_string();
    for part in ["0.05 s", "-143", "at least 3 substeps"] {
        assert!(text.contains(part), "{part} is not in: {text}");
    }
    check_rk4_step(&a, 0.05, 2).unwrap_err();
    assert_eq!(check_rk4_step(&a, 0.05, 3).unwrap().fewest_substeps, 3);
}

#[test]
fn poles_that_do_not_decay_set_no_limit() {
    let a = DMatrix::from_diagonal(&nalgebra::dvector![0.0, 5.0]);
    let step = check_rk4_step(&a, 100.0, 1).unwrap();
    assert_eq!(step.longest_step, f64::INFINITY);
    assert_eq!(step.fewest_substeps, 1);
}

#[test]
fn arguments_out_of_range_are_refused() {
    let a = dmatrix![-1.0];
    for time in [0.0, -0.1, f64::NAN, f64::INFINITY] {
        let error = check_rk4_step(&a, time, 1).unwrap_err();
        assert!(matches!(error, Rk4StepError::SampleTime { .. }));
    }
    assert_eq!(
        check_rk4_step(&a, 0.1, 0).unwrap_err(),
        Rk4StepError::NoSubsteps
    );
    let error = check_rk4_step(&dmatrix![f64::NAN], 0.1, 1).unwrap_err();
    assert!(matches!(error, Rk4StepError::Matrix(_)));
}

#[test]
fn a_mode_that_outgrows_the_digits_is_named() {
    let a = DMatrix::from_diagonal(&nalgebra::dvector![-50.0, 4.0]);
    // e^200; ln(2^52) / 4 = 9.01 s use up the digits, half of that leaves some for a regulator.
    for (error, longest) in [
        (check_rk4_step(&a, 50.0, 4000).unwrap_err(), "9.01 s"),
        (accurate_rk4_substeps(&a, 50.0).unwrap_err(), "4.51 s"),
    ] {
        assert!(matches!(error, Rk4StepError::Outgrown { .. }), "{error}");
        let text = error.to_string();
        for part in ["50 s", "pole 4 1/s", "e^200", longest, "50 ms are 0.05 s"] {
            assert!(text.contains(part), "{part} is not in: {text}");
        }
    }
    check_rk4_step(&a, 9.0, 700).unwrap();
    accurate_rk4_substeps(&a, 4.5).unwrap();
}

#[test]
fn steps_without_end_are_refused() {
    let stable = dmatrix![-1e6];
    let error = accurate_rk4_substeps(&stable, 1e6).unwrap_err();
    assert!(matches!(error, Rk4StepError::TooMany { .. }), "{error}");
    let unstable = dmatrix![-1e6, 0.0; 0.0, 1.0];
    for time in [1e6, 1e300] {
        let error = accurate_rk4_substeps(&unstable, time).unwrap_err();
        assert!(matches!(error, Rk4StepError::Outgrown { .. }), "{error}");
    }
}
