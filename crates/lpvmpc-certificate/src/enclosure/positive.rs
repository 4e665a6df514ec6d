//! Definiteness of symmetric matrices whose entries are known up to intervals.

use super::elementary::Arithmetic;
use super::interval::Interval;
use nalgebra::{DMatrix, SymmetricEigen};

/// Whether every symmetric matrix with entries in the lower triangle of `matrix` is positive
/// definite: its Cholesky factorisation, in interval arithmetic, has positive pivots.
/// `false` may also mean that the intervals are too wide to tell.
pub(crate) fn is_positive_definite<const N: usize>(matrix: &[[Interval; N]; N]) -> bool {
    // L D L' without square roots; `rest` is the Schur complement.
    let mut rest = *matrix;
    for pivot in 0..N {
        if rest[pivot][pivot].lower <= 0.0 {
            return false;
        }
        let inverse = rest[pivot][pivot].reciprocal();
        for i in pivot + 1..N {
            let factor = rest[i][pivot] * inverse;
            for j in pivot + 1..=i {
                let update = if i == j {
                    rest[i][pivot].square() * inverse
                } else {
                    factor * rest[j][pivot]
                };
                rest[i][j] = rest[i][j] - update;
            }
        }
    }
    true
}

/// The smallest eigenvalue of the matrix of middles: an estimate, not a bound.
pub(crate) fn smallest_eigenvalue<const N: usize>(matrix: &[[Interval; N]; N]) -> f64 {
    let middles = DMatrix::from_fn(N, N, |i, j| matrix[i.max(j)][i.min(j)].middle());
    if middles.iter().any(|entry| !entry.is_finite()) {
        return f64::NEG_INFINITY;
    }
    SymmetricEigen::new(middles).eigenvalues.min()
}
