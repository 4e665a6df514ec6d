//! Embeddings that are the plant, and embeddings that are not.

use lpvmpc::{Bounds, Embedding, Number};
use lpvmpc_design::{EmbeddingCheckError, embedding_defect};
use nalgebra::{Matrix2, Vector1, Vector2};

/// x1_ddot = 9.81 sin(x1) + u, with a factor of its own on gravity; s = x1.
struct Pendulum {
    factor: f64,
    /// As a linearisation has it: without sinc.
    linear: bool,
}

impl Embedding<2, 1, 1> for Pendulum {
    fn scheduling<N: Number>(&self, x: &Vector2<N>, _: &Vector1<N>) -> Vector1<N> {
        Vector1::new(x[0])
    }

    fn matrices<N: Number>(&self, s: &Vector1<N>) -> (Matrix2<N>, Vector2<N>) {
        let (zero, one) = (N::constant(0.0), N::constant(1.0));
        let sinc = if self.linear { one } else { s[0].sinc() };
        let gravity = N::constant(9.81 * self.factor) * sinc;
        (
            Matrix2::new(zero, one, gravity, zero),
            Vector2::new(zero, one),
        )
    }
}

fn f(x: &Vector2<f64>, u: &Vector1<f64>) -> Vector2<f64> {
    Vector2::new(x[1], 9.81 * x[0].sin() + u[0])
}

fn bounds<const K: usize>(lower: [f64; K], upper: [f64; K]) -> Bounds<f64, K> {
    Bounds {
        lower: lower.into(),
        upper: upper.into(),
    }
}

#[test]
fn an_exact_embedding_has_no_defect() {
    let exact = Pendulum {
        factor: 1.0,
        linear: false,
    };
    let (x, u) = (bounds([-3.0, -8.0], [2.0, 8.0]), bounds([-5.0], [5.0]));
    let found = embedding_defect(&exact, f, (&x, &u), 2000).unwrap();
    assert!(found.relative < 1e-14, "{found:?}");
}

/// 9.81 (x1 - sin x1) is largest at the end of the box that is farther from 0.
#[test]
fn a_linearisation_differs_most_at_the_far_end() {
    let linear = Pendulum {
        factor: 1.0,
        linear: true,
    };
    let (x, u) = (bounds([-1.5, -8.0], [0.7, 8.0]), bounds([0.0], [0.0]));
    let found = embedding_defect(&linear, f, (&x, &u), 200).unwrap();
    let expected = -9.81 * (1.5 - 1.5_f64.sin());
    assert_eq!(found.x[0], -1.5);
    assert!((found.defect[1] - expected).abs() < 1e-12, "{found:?}");
    assert_eq!(found.defect[0], 0.0);
}

/// 0.01 times 9.81 sin(x1), largest inside of the box, at a quarter turn, where no corner is.
#[test]
fn a_factor_of_one_percent_is_found_where_it_counts_most() {
    let wrong = Pendulum {
        factor: 1.01,
        linear: false,
    };
    let (x, u) = (bounds([-0.3, -1.0], [2.9, 1.0]), bounds([-1.0], [1.0]));
    let found = embedding_defect(&wrong, f, (&x, &u), 50).unwrap();
    assert!((found.defect[1] - 0.0981).abs() < 1e-9, "{found:?}");
    assert!(
        (found.x[0] - std::f64::consts::FRAC_PI_2).abs() < 1e-3,
        "{found:?}"
    );
}

#[test]
fn what_cannot_be_compared_is_refused_with_its_place() {
    let exact = Pendulum {
        factor: 1.0,
        linear: false,
    };
    let fine = bounds([-1.0, -1.0], [1.0, 1.0]);
    let u = bounds([0.0], [f64::INFINITY]);
    let error = embedding_defect(&exact, f, (&fine, &u), 10).unwrap_err();
    assert!(error.to_string().contains("u[0] is from 0"), "{error}");
    let upside_down = bounds([-1.0, 2.0], [1.0, 1.0]);
    let error = embedding_defect(&exact, f, (&upside_down, &bounds([0.0], [0.0])), 10).unwrap_err();
    assert!(error.to_string().contains("x[1] is from 2 to 1"), "{error}");
    let hole = |x: &Vector2<f64>, u: &Vector1<f64>| f(x, u) / (x[0] - 1.0);
    let error = embedding_defect(&exact, hole, (&fine, &bounds([0.0], [0.0])), 10).unwrap_err();
    assert!(
        matches!(error, EmbeddingCheckError::NotFinite { side: "f", .. }),
        "{error}"
    );
}
