//! Matrices over a box, with an error in the Euclidean norm.

use super::interval::Interval;
use super::rows::from_fn;
use super::taylor_model::TaylorModel;
use nalgebra::SMatrix;

/// A matrix over the box -1 <= z_i <= 1: at every z it is within `error`, in the Euclidean
/// operator norm, of `middle` + sum of `slopes[i]` z_i + sum over i <= j of `squares[i][j]` z_i z_j.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TaylorMap<const R: usize, const C: usize, const D: usize> {
    /// The matrix at z = 0, up to the error.
    pub middle: SMatrix<f64, R, C>,
    /// Its linear dependence on z.
    pub slopes: [SMatrix<f64, R, C>; D],
    /// Its quadratic dependence on z; the part below the diagonal is zero.
    pub squares: [[SMatrix<f64, R, C>; D]; D],
    /// The largest distance from the true matrix, rounding included; infinite when unknown.
    pub error: f64,
}

/// Bounds the rounding of an entry of a sum of up to four products of matrices of up to 16 rows, relative to the product of
/// their norms, of the norms themselves, and of sums of up to 1000 norms: as many as a sample's steps have errors.
pub(super) const ROUNDING: f64 = 512.0 * f64::EPSILON;

impl<const R: usize, const C: usize, const D: usize> TaylorMap<R, C, D> {
    /// The map with these entries.
    pub fn of(entries: &[[TaylorModel<D>; C]; R]) -> Self {
        let errors = SMatrix::<f64, R, C>::from_fn(|i, j| entries[i][j].error);
        let matrix = |coefficient: &dyn Fn(&TaylorModel<D>) -> f64| {
            SMatrix::from_fn(|i, j| coefficient(&entries[i][j]))
        };
        let mut map = Self::constant(matrix(&|entry| entry.middle));
        map.error = frobenius(&errors);
        for (k, slope) in map.slopes.iter_mut().enumerate() {
            *slope = matrix(&|entry| entry.slopes()[k]);
        }
        for (k, l) in map.upper() {
            map.squares[k][l] = matrix(&|entry| entry.squares()[k][l]);
        }
        map.checked()
    }

    /// Nothing is known of a matrix whose coefficients have overflowed.
    fn checked(self) -> Self {
        let squares = self.upper().map(|(i, j)| &self.squares[i][j]);
        let matrices = std::iter::once(&self.middle).chain(&self.slopes);
        let mut entries = matrices.chain(squares).flat_map(SMatrix::iter);
        let finite = entries.all(|entry| entry.is_finite());
        let error = if finite {
            known(self.error)
        } else {
            f64::INFINITY
        };
        Self { error, ..self }
    }

    /// The same matrix at every z.
    pub fn constant(middle: SMatrix<f64, R, C>) -> Self {
        Self {
            middle,
            slopes: [SMatrix::zeros(); D],
            squares: [[SMatrix::zeros(); D]; D],
            error: 0.0,
        }
    }

    /// Its entries.
    pub fn entries(&self) -> [[TaylorModel<D>; C]; R] {
        from_fn(|i, j| {
            let mut entry = TaylorModel::polynomial(
                self.middle[(i, j)],
                |k| self.slopes[k][(i, j)],
                |k, l| self.squares[k][l][(i, j)],
            );
            entry.error = self.error;
            entry
        })
    }

    /// A bound of the norm over the whole box, without the error.
    pub fn norm(&self) -> f64 {
        (euclidean(&self.middle) + self.deviation()) * (1.0 + ROUNDING)
    }

    /// A bound of the norm of the part that varies with z.
    pub(super) fn deviation(&self) -> f64 {
        self.parts(euclidean).iter().sum::<f64>() * (1.0 + ROUNDING)
    }

    /// The sums of the norms of the linear and of the quadratic part.
    fn parts(&self, norm: fn(&SMatrix<f64, R, C>) -> f64) -> [f64; 2] {
        let slopes: f64 = self.slopes.iter().map(norm).sum();
        let squares: f64 = self.upper().map(|(i, j)| norm(&self.squares[i][j])).sum();
        [slopes, squares].map(|sum| sum * (1.0 + ROUNDING))
    }

    /// The places of the quadratic part.
    fn upper(&self) -> impl Iterator<Item = (usize, usize)> + use<R, C, D> {
        (0..D).flat_map(|i| (i..D).map(move |j| (i, j)))
    }

    /// The product.
    pub fn times<const N: usize>(&self, other: &TaylorMap<C, N, D>) -> TaylorMap<R, N, D> {
        let (m, n) = (&self.middle, &other.middle);
        let (p, q) = (&self.slopes, &other.slopes);
        let mut product = TaylorMap::constant(m * n);
        for (i, j) in self.upper() {
            let mixed = p[i] * q[j]
                + if i == j {
                    SMatrix::zeros()
                } else {
                    p[j] * q[i]
                };
            product.squares[i][j] = m * other.squares[i][j] + self.squares[i][j] * n + mixed;
        }
        for (k, slope) in product.slopes.iter_mut().enumerate() {
            *slope = m * q[k] + p[k] * n;
        }
        let (a, b) = (euclidean(m), euclidean(n));
        let ([a1, a2], [b1, b2]) = (self.parts(euclidean), other.parts(euclidean));
        // Of order three and four.
        let beyond = a1 * b2 + a2 * b1 + a2 * b2;
        let errors = self.error * (b + b1 + b2 + other.error) + other.error * (a + a1 + a2);
        let (size, other_size) = (self.size(), other.size());
        let zero = size + self.error == 0.0 || other_size + other.error == 0.0;
        let underflow = if zero { 0.0 } else { UNDERFLOW };
        product.error =
            (beyond + errors + ROUNDING * size * other_size + underflow) * (1.0 + ROUNDING);
        product.checked()
    }

    /// The sum.
    pub fn plus(&self, other: &Self) -> Self {
        let mut sum = *self;
        sum.middle += other.middle;
        for (slope, other) in sum.slopes.iter_mut().zip(&other.slopes) {
            *slope += other;
        }
        for (i, j) in self.upper() {
            sum.squares[i][j] += other.squares[i][j];
        }
        let rounding = ROUNDING * sum.size();
        sum.error = (self.error + other.error + rounding) * (1.0 + ROUNDING);
        sum.checked()
    }

    /// A bound of the entries' sizes, each summed over all coefficients.
    fn size(&self) -> f64 {
        let [slopes, squares] = self.parts(frobenius);
        frobenius(&self.middle) + slopes + squares
    }

    /// The same map with its quadratic part in the error: z_i^2 is 1/2, give or take 1/2.
    pub fn affine(&self) -> Self {
        let mut affine = Self {
            squares: [[SMatrix::zeros(); D]; D],
            ..*self
        };
        let mut terms = self.error + ROUNDING * self.size();
        for (i, j) in self.upper() {
            let square = self.squares[i][j];
            if i == j {
                affine.middle += square * 0.5;
                terms += 0.5 * euclidean(&square);
            } else {
                terms += euclidean(&square);
            }
        }
        // Halves of subnormal numbers are rounded, too.
        let underflow = if terms > 0.0 { UNDERFLOW } else { 0.0 };
        affine.error = (terms + underflow) * (1.0 + ROUNDING);
        affine.checked()
    }

    /// The linear part at a corner of the box, given by the signs of z, without the error.
    pub fn at(&self, corner: &[f64; D]) -> [[Interval; C]; R] {
        from_fn(|i, j| {
            let terms = self.slopes.iter().zip(corner);
            terms.fold(
                Interval::point(self.middle[(i, j)]),
                |sum, (slope, sign)| sum + Interval::point(slope[(i, j)] * sign),
            )
        })
    }

    /// All values of the linear part over the box, without the error.
    pub fn range(&self) -> [[Interval; C]; R] {
        let sign = Interval::new(-1.0, 1.0);
        from_fn(|i, j| {
            let middle = Interval::point(self.middle[(i, j)]);
            let slopes = self.slopes.iter();
            slopes.fold(middle, |sum, slope| {
                sum + Interval::point(slope[(i, j)]) * sign
            })
        })
    }

    /// How much the matrix depends on z_`symbol`.
    pub fn weight(&self, symbol: usize) -> f64 {
        let squares = self.upper().filter(|(i, j)| *i == symbol || *j == symbol);
        frobenius(&self.slopes[symbol])
            + squares
                .map(|(i, j)| frobenius(&self.squares[i][j]))
                .sum::<f64>()
    }
}

pub(super) fn known(error: f64) -> f64 {
    if error.is_nan() { f64::INFINITY } else { error }
}

/// What is lost where products underflow, over all that is summed in one coefficient and in its
/// error: each loses less than the smallest subnormal number.
pub(super) const UNDERFLOW: f64 = f64::MIN_POSITIVE;

/// An upper bound of the root of the sum of the squares of the entries; infinite if an entry is.
pub(super) fn frobenius<const R: usize, const C: usize>(m: &SMatrix<f64, R, C>) -> f64 {
    scaled(m, |m| m.norm() * (1.0 + ROUNDING))
}

/// `norm` of a matrix whose fourth powers neither overflow nor underflow: where the entries are so large
/// or small, of the matrix over its largest one.
fn scaled<const R: usize, const C: usize>(
    m: &SMatrix<f64, R, C>,
    norm: impl Fn(&SMatrix<f64, R, C>) -> f64,
) -> f64 {
    const SAFE: std::ops::RangeInclusive<f64> = 1e-50..=1e50;
    if !m.iter().all(|entry| entry.is_finite()) {
        return f64::INFINITY;
    }
    let largest = m.amax();
    if largest == 0.0 {
        0.0
    } else if SAFE.contains(&largest) {
        norm(m)
    } else {
        // Rounded once more by the division, and by the product, which may be subnormal.
        (largest * norm(&(m / largest)) * (1.0 + ROUNDING)).next_up()
    }
}

/// An upper bound of the Euclidean operator norm, at most 1 % above it for four columns: with
/// S = M'M, |M|^2 = |S| <= |S^n|_F^(1/n).
pub(super) fn euclidean<const R: usize, const C: usize>(m: &SMatrix<f64, R, C>) -> f64 {
    scaled(m, by_powers)
}

fn by_powers<const R: usize, const C: usize>(m: &SMatrix<f64, R, C>) -> f64 {
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
