//! Matrices over a box, with an error in the Euclidean norm.

use super::affine::Affine;
use super::interval::Interval;
use nalgebra::SMatrix;

/// A matrix over the box -1 <= z_i <= 1: at every z it is within `error`, in the Euclidean
/// operator norm, of `middle` + sum of `slopes[i]` z_i.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AffineMap<const R: usize, const C: usize, const D: usize> {
    /// The matrix at z = 0, up to the error.
    pub middle: SMatrix<f64, R, C>,
    /// Its dependence on z.
    pub slopes: [SMatrix<f64, R, C>; D],
    /// The largest distance from the true matrix, rounding included; infinite when unknown.
    pub error: f64,
}

/// Bounds the rounding of an entry of a product of matrices of up to a dozen rows, relative to
/// the product of their norms, and of the norms themselves.
pub(super) const ROUNDING: f64 = 64.0 * f64::EPSILON;

impl<const R: usize, const C: usize, const D: usize> AffineMap<R, C, D> {
    /// The map with these entries.
    pub fn of(entries: &[[Affine<D>; C]; R]) -> Self {
        let errors = SMatrix::<f64, R, C>::from_fn(|i, j| entries[i][j].error);
        Self {
            middle: SMatrix::from_fn(|i, j| entries[i][j].middle),
            slopes: std::array::from_fn(|k| SMatrix::from_fn(|i, j| entries[i][j].slopes[k])),
            error: known(frobenius(&errors)),
        }
    }

    /// Its entries.
    pub fn entries(&self) -> [[Affine<D>; C]; R] {
        std::array::from_fn(|i| {
            std::array::from_fn(|j| Affine {
                middle: self.middle[(i, j)],
                slopes: std::array::from_fn(|k| self.slopes[k][(i, j)]),
                error: self.error,
            })
        })
    }

    /// A bound of the norm over the whole box, without the error.
    pub fn norm(&self) -> f64 {
        (euclidean(&self.middle) + self.deviation()) * (1.0 + ROUNDING)
    }

    /// A bound of the norm of the part that varies with z.
    pub(super) fn deviation(&self) -> f64 {
        self.slopes.iter().map(euclidean).sum::<f64>() * (1.0 + ROUNDING)
    }

    /// The product.
    pub fn times<const N: usize>(&self, other: &AffineMap<C, N, D>) -> AffineMap<R, N, D> {
        let slope = |k: usize| self.middle * other.slopes[k] + self.slopes[k] * other.middle;
        let (a, b) = (euclidean(&self.middle), euclidean(&other.middle));
        let (da, db) = (self.deviation(), other.deviation());
        let exact = da * db + self.error * (b + db + other.error) + other.error * (a + da);
        let size = (frobenius(&self.middle) + frobenius_sum(&self.slopes))
            * (frobenius(&other.middle) + frobenius_sum(&other.slopes));
        AffineMap {
            middle: self.middle * other.middle,
            slopes: std::array::from_fn(slope),
            error: known((exact + ROUNDING * size) * (1.0 + ROUNDING)),
        }
    }

    /// The sum.
    pub fn plus(&self, other: &Self) -> Self {
        let sum = Self {
            middle: self.middle + other.middle,
            slopes: std::array::from_fn(|k| self.slopes[k] + other.slopes[k]),
            error: 0.0,
        };
        let size = frobenius(&sum.middle) + frobenius_sum(&sum.slopes);
        Self {
            error: known((self.error + other.error + ROUNDING * size) * (1.0 + ROUNDING)),
            ..sum
        }
    }

    /// The matrix at a corner of the box, given by the signs of z, without the error.
    pub fn at(&self, corner: &[f64; D]) -> [[Interval; C]; R] {
        std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                let terms = self.slopes.iter().zip(corner);
                terms.fold(
                    Interval::point(self.middle[(i, j)]),
                    |sum, (slope, sign)| sum + Interval::point(slope[(i, j)] * sign),
                )
            })
        })
    }

    /// How much the matrix depends on z_`symbol`.
    pub fn weight(&self, symbol: usize) -> f64 {
        frobenius(&self.slopes[symbol])
    }
}

pub(super) fn known(error: f64) -> f64 {
    if error.is_nan() { f64::INFINITY } else { error }
}

pub(super) fn frobenius<const R: usize, const C: usize>(m: &SMatrix<f64, R, C>) -> f64 {
    m.norm() * (1.0 + ROUNDING)
}

fn frobenius_sum<const R: usize, const C: usize>(slopes: &[SMatrix<f64, R, C>]) -> f64 {
    slopes.iter().map(frobenius).sum()
}

/// An upper bound of the Euclidean operator norm, at most 1 % above it for four columns: with
/// S = M'M, |M|^2 = |S| <= |S^n|_F^(1/n).
pub(super) fn euclidean<const R: usize, const C: usize>(m: &SMatrix<f64, R, C>) -> f64 {
    const SQUARINGS: i32 = 5;
    let mut power = m.transpose() * m;
    let mut bound = 1.0;
    let mut exponent = 0.5;
    for _ in 0..SQUARINGS {
        // Scaled, so that it neither overflows nor vanishes.
        let size = power.norm();
        if size <= f64::MIN_POSITIVE || !size.is_finite() {
            return frobenius(m);
        }
        bound *= size.powf(exponent);
        exponent *= 0.5;
        power /= size;
        power *= power;
    }
    // S^n loses at most a few roundings of its own norm at each squaring, of which the n-th
    // root is taken; the powers are as exact.
    bound * power.norm().powf(exponent) * (1.0 + 16.0 * ROUNDING)
}
