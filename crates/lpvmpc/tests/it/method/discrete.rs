//! A plant in discrete time, linearised at several points together over a sample of several periods.

use lpvmpc::{LpvModel, Rk4};
use nalgebra::{Matrix2, Vector1, Vector2};

const PERIOD: f64 = 0.1;
/// Periods of a sample.
const PERIODS: usize = 3;

/// x1+ = x1 + 0.1 x2, x2+ = x2 - 0.2 x1^3 + 0.1 (1 + x1) u, with s = x1.
struct Cubic;

impl LpvModel<f64, 2, 1, 1> for Cubic {
    fn period(&self) -> Option<f64> {
        Some(PERIOD)
    }

    fn scheduling(&self, x: &Vector2<f64>, _: &Vector1<f64>) -> Vector1<f64> {
        Vector1::new(x[0])
    }

    fn matrices(&self, s: &Vector1<f64>) -> (Matrix2<f64>, Vector2<f64>) {
        let a = Matrix2::new(1.0, 0.1, -0.2 * s[0] * s[0], 1.0);
        (a, Vector2::new(0.0, 0.1 * (1.0 + s[0])))
    }

    fn jacobian(&self, x: &Vector2<f64>, u: &Vector1<f64>) -> (Matrix2<f64>, Vector2<f64>) {
        let slope = -0.6 * x[0] * x[0] + 0.1 * u[0];
        (
            Matrix2::new(1.0, 0.1, slope, 1.0),
            Vector2::new(0.0, 0.1 * (1.0 + x[0])),
        )
    }
}

/// A sample by the formulas, written out once more.
fn sample(mut x: Vector2<f64>, u: f64) -> Vector2<f64> {
    for _ in 0..PERIODS {
        let force = -0.2 * x[0].powi(3) + 0.1 * (1.0 + x[0]) * u;
        x = Vector2::new(x[0] + 0.1 * x[1], x[1] + force);
    }
    x
}

fn points() -> ([Vector2<f64>; 3], [Vector1<f64>; 3]) {
    let x = [[0.3, -1.0], [-2.0, 0.5], [1.5, 4.0]].map(Vector2::from);
    (x, [-1.0, 0.0, 7.0].map(Vector1::new))
}

/// The embedding's pairs lead from x to the sample's end: A_d x + B_d u, as this plant has no affine term.
#[test]
fn pairs_along_a_sample_of_several_periods_lead_to_its_end() {
    let (x, u) = points();
    let there = Rk4 { substeps: 1 }.linearize_each(&Cubic, &x, &u, PERIOD * PERIODS as f64);
    for (i, (next, a_d, b_d)) in there.iter().enumerate() {
        let expected = sample(x[i], u[i][0]);
        assert!((next - expected).amax() < 1e-13, "{i}");
        assert!((a_d * x[i] + b_d * u[i] - expected).amax() < 1e-13, "{i}");
    }
}

#[test]
fn derivatives_along_a_sample_are_its_differences() {
    const STEP: f64 = 1e-5;
    let (x, u) = points();
    let there = Rk4 { substeps: 1 }.differentiate_each(&Cubic, &x, &u, PERIOD * PERIODS as f64);
    for (i, (next, a_d, b_d)) in there.iter().enumerate() {
        let at = |j: usize, step: f64| {
            let mut moved = x[i];
            moved[j] += step;
            sample(moved, u[i][0])
        };
        let difference = |up: Vector2<f64>, down: Vector2<f64>| (up - down) / (2.0 * STEP);
        let of_state = [0, 1].map(|j| difference(at(j, STEP), at(j, -STEP)));
        let of_input = difference(sample(x[i], u[i][0] + STEP), sample(x[i], u[i][0] - STEP));
        assert!((next - sample(x[i], u[i][0])).amax() < 1e-13, "{i}");
        assert!(
            (a_d - Matrix2::from_columns(&of_state)).amax() < 1e-7,
            "{i}"
        );
        assert!((b_d - of_input).amax() < 1e-7, "{i}");
    }
}
