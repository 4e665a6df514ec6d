//! The classical Runge-Kutta method for any right-hand side: the second route for the predictor.

use nalgebra::SVector;

/// The state after `steps` steps of `h` seconds of x_dot = f(x).
pub fn integrate<const NX: usize>(
    f: impl Fn(&SVector<f64, NX>) -> SVector<f64, NX>,
    mut x: SVector<f64, NX>,
    h: f64,
    steps: usize,
) -> SVector<f64, NX> {
    // Node and weight of every stage; each stage leans on the one before it.
    let tableau = [(0.0, 1.0), (0.5, 2.0), (0.5, 2.0), (1.0, 1.0)];
    for _ in 0..steps {
        let mut slope = SVector::zeros();
        let mut sum = SVector::zeros();
        for (node, weight) in tableau {
            slope = f(&(x + slope * (node * h)));
            sum += slope * weight;
        }
        x += sum * (h / 6.0);
    }
    x
}
