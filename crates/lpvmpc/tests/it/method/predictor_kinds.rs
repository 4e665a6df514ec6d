//! The three kinds of predictor: what the pair of a sample reproduces, and to which order.

use super::plant::CartPole;
use lpvmpc::{LpvModel, Predictor, Rk4};
use lpvmpc_testkit::rng::Rng;
use nalgebra::{DMatrix, Matrix5, Vector1, Vector4};

/// A state and an input of the cart-pole, up to a tilt of 57 degrees.
fn somewhere(rng: &mut Rng) -> (Vector4<f64>, Vector1<f64>) {
    let x = rng.matrix::<4, 1>();
    (x, Vector1::new(rng.uniform(-10.0, 10.0)))
}

/// A_d x + B_d u is the nonlinear step at the state and input that were expected.
#[test]
fn the_stage_consistent_pair_reproduces_the_rollout() {
    let plant = CartPole::laboratory();
    let mut rng = Rng::new(11);
    for trial in 0..500 {
        let rk4 = Rk4 {
            substeps: 1 + trial % 4,
        };
        let (x, u) = somewhere(&mut rng);
        let (a_d, b_d) = Predictor::StageConsistent(rk4).linearize(&plant, &x, &u, 0.05);
        let rolled_out = rk4.advance(&plant, &x, &u, 0.05);
        let error = (a_d * x + b_d * u - rolled_out).norm();
        // Some 200 roundings per step, of rates that are ten times the state.
        assert!(error <= 2e3 * f64::EPSILON * (1.0 + rolled_out.norm()));
    }
}

/// The frozen pair misses the motion of the scheduling within the sample: an error of order two
/// in t_s, where the stage-consistent pair has none.
#[test]
fn the_frozen_pair_is_of_first_order() {
    let plant = CartPole::laboratory();
    let (x, u) = (Vector4::new(0.1, 0.7, -0.5, 2.0), Vector1::new(5.0));
    let rk4 = Rk4 { substeps: 2 };
    let error = |t_s: f64| {
        let (a_d, b_d) = Predictor::FrozenRk4(rk4).linearize(&plant, &x, &u, t_s);
        (a_d * x + b_d * u - rk4.advance(&plant, &x, &u, t_s)).norm()
    };
    let order = (error(0.01) / error(0.005)).log2();
    assert!((1.8..2.2).contains(&order), "{order}");
}

/// exp([A B; 0 0] t_s) holds A_d and B_d: another algorithm (Padé approximants) in nalgebra.
#[test]
fn the_exact_pair_is_the_matrix_exponential() {
    let plant = CartPole::laboratory();
    let mut rng = Rng::new(12);
    for _ in 0..200 {
        let (x, u) = somewhere(&mut rng);
        let t_s = rng.uniform(1e-4, 1.0);
        let exact = Predictor::FrozenExact(Rk4 { substeps: 1 });
        let (a_d, b_d) = exact.linearize(&plant, &x, &u, t_s);
        let (a, b) = plant.matrices(&plant.scheduling(&x, &u));
        let mut block = Matrix5::zeros();
        block.fixed_view_mut::<4, 4>(0, 0).copy_from(&(a * t_s));
        block.fixed_view_mut::<4, 1>(0, 4).copy_from(&(b * t_s));
        let exponential = DMatrix::from_column_slice(5, 5, block.as_slice()).exp();
        let size = exponential.norm();
        assert!((exponential.view((0, 0), (4, 4)) - a_d).norm() <= 1e-13 * size);
        assert!((exponential.view((0, 4), (4, 1)) - b_d).norm() <= 1e-13 * size);
    }
}

/// A model that overflows gives a pair that is not finite, in bounded time.
#[test]
fn nonsense_does_not_hang_the_exponential() {
    let exact = Predictor::FrozenExact(Rk4 { substeps: 1 });
    for entry in [f64::NAN, f64::INFINITY, 1e300] {
        let a = nalgebra::Matrix1::new(entry);
        let (a_d, _) = exact.discretize(&a, &Vector1::new(1.0), 1.0);
        assert!(!a_d[0].is_finite());
    }
}
