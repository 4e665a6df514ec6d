//! The same model in `f32`, for a microcontroller.

use crate::robots;
use ballbot::{Ballbot, DriveFriction, LinearParameters, Wheels};
use fastrand::Rng;
use lpvmpc::{LpvModel, Scalar};
use nalgebra::{SMatrix, Vector1, Vector3, convert};

/// Every entry of `single` is `double` to the accuracy of `f32`, relative to `scale`.
fn assert_agrees<const R: usize, const C: usize>(
    single: SMatrix<f32, R, C>,
    double: SMatrix<f64, R, C>,
    scale: SMatrix<f64, R, C>,
) {
    let single: SMatrix<f64, R, C> = convert(single);
    for (i, (single, double)) in single.iter().zip(&double).enumerate() {
        let allowed = 32.0 * f64::from(f32::EPSILON) * scale[i];
        assert!(
            (single - double).abs() <= allowed,
            "entry {i}: {single} for {double}, allowed {allowed:e}"
        );
    }
}

fn friction<T: Scalar>() -> DriveFriction<T> {
    DriveFriction {
        viscous: convert(0.03),
        coulomb: convert(0.02),
    }
}

#[test]
fn the_model_agrees() {
    let (mut single, mut double) = (Ballbot::<f32>::paper(), Ballbot::<f64>::paper());
    (single.drive, double.drive) = (friction(), friction());
    let mut rng = Rng::with_seed(10);
    for _ in 0..10_000 {
        // The same numbers in both: those that f32 has.
        let mut x = robots::state(&mut rng).cast::<f32>();
        // Coulomb friction turns on the speeds' difference: both are to have the same.
        for speed in [2, 3] {
            x[speed] = (x[speed] * 64.0).round() / 64.0;
        }
        let torque = robots::torque(&mut rng) as f32;
        let wide = x.cast::<f64>();
        let (a, b) = double.matrices(&double.scheduling(&wide, &Vector1::zeros()));
        let (a_single, b_single) = single.matrices(&single.scheduling(&x, &Vector1::zeros()));
        // The drive's friction is added to entries of either sign.
        let (bare, _) =
            Ballbot::<f64>::paper().matrices(&double.scheduling(&wide, &Vector1::zeros()));
        let sizes = bare.abs() + (a - bare).abs();
        assert_agrees(a_single, a, sizes);
        assert_agrees(b_single, b, b.abs());
        let torque_wide = f64::from(torque);
        let scale = sizes * wide.abs() + b.abs() * torque_wide.abs();
        assert_agrees(single.f(&x, torque), double.f(&wide, torque_wide), scale);
    }
}

#[test]
fn the_linear_model_agrees() {
    let (single, double) = (Ballbot::<f32>::paper(), Ballbot::<f64>::paper());
    let h = double.linear_parameters().to_vector();
    assert_agrees(single.linear_parameters().to_vector(), h, h.abs());
    let jacobian = double.linear_parameters_jacobian();
    // Differences within an entry: relative to its column.
    let scale = SMatrix::from_fn(|_, column| jacobian.column(column).abs().max());
    assert_agrees(single.linear_parameters_jacobian(), jacobian, scale);
    let p = LinearParameters::<f64>::paper().to_vector();
    assert_agrees(LinearParameters::<f32>::paper().to_vector(), p, p.abs());
}

#[test]
fn the_torque_map_agrees() {
    let double = Wheels::<f64>::paper().matrix();
    assert_agrees(Wheels::<f32>::paper().matrix(), double, double.abs());
    let motors = Vector3::new(0.3, -0.2, 0.7);
    let double = Wheels::paper().virtual_torques(&motors);
    let single = Wheels::paper().virtual_torques(&motors.cast::<f32>());
    assert_agrees(single, double, Vector3::repeat(motors.norm()));
}

#[test]
fn the_verdict_agrees() {
    let words = Ballbot::<f32>::paper().consistency(1.0).to_string();
    assert_eq!(words, Ballbot::<f64>::paper().consistency(1.0).to_string());
}
