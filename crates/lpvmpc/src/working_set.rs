//! The rows that hold with equality, and the Cholesky factor of their Gram matrix.
//!
//! In the normalised deviations v the problem reads: minimise |v|^2 / 2 subject to
//! alpha_j'v >= beta_j. Over a working set W the multipliers solve G lambda = beta with
//! G = W W' + D, where D holds the compliance 1/quadratic of rows with a quadratic price. The
//! factor L L' = G is grown and shrunk by one row at a time. It is used semi-normally
//! (Bjorck, Numerical Methods for Least Squares Problems, ch. 6.6): where cancellation is
//! strong, a correction step restores the accuracy of an orthogonal factorisation.

use crate::model::Scalar;
use crate::solution::ActiveRow;
use nalgebra::{SVector, convert};

/// A row of the problem in terms of the normalised deviations v.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Row<T, const NU: usize, const N: usize> {
    /// alpha: d(slack)/dv, zero from `support` on.
    pub alpha: [SVector<T, NU>; N],
    /// Stages that the row depends on.
    pub support: usize,
    /// 1 / quadratic price for an elastic row, else 0.
    pub compliance: T,
    /// Largest multiplier: the linear price, or infinity.
    pub cap: T,
    /// May the multiplier have any sign?
    pub equality: bool,
    /// The row is the mirror image of an exceeded soft bound that is being taken back: its
    /// multiplier counts down from the cap.
    pub mirrored: bool,
    /// Which bound it is, and its multiplier in the row's own direction.
    pub active: ActiveRow<T>,
}

impl<T: Scalar, const NU: usize, const N: usize> Row<T, NU, N> {
    pub fn empty() -> Self {
        Self {
            alpha: [SVector::zeros(); N],
            support: 0,
            compliance: T::zero(),
            cap: T::zero(),
            equality: false,
            mirrored: false,
            active: ActiveRow::empty(),
        }
    }

    /// alpha'v: the change of the slack that the deviations `v` make.
    pub fn dot(&self, v: &[SVector<T, NU>; N]) -> T {
        self.alpha
            .iter()
            .zip(v.iter())
            .take(self.support)
            .fold(T::zero(), |sum, (a, b)| sum + a.dot(b))
    }

    /// v += factor * alpha
    pub fn add_to(&self, v: &mut [SVector<T, NU>; N], factor: T) {
        for (v, a) in v.iter_mut().zip(self.alpha.iter()).take(self.support) {
            *v += a * factor;
        }
    }
}

/// How the current minimiser answers to one more unit of a candidate row's multiplier.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Direction<T, const NU: usize, const N: usize, const M: usize> {
    /// Change of v: the part of alpha that the working set does not span.
    pub primal: [SVector<T, NU>; N],
    /// Change of the working set's multipliers, with the opposite sign.
    pub dual: [T; M],
    /// Change of the candidate's slack, >= 0; 0 when the row depends on the working set.
    pub slope: T,
}

impl<T: Scalar, const NU: usize, const N: usize, const M: usize> Direction<T, NU, N, M> {
    pub fn zeros() -> Self {
        Self {
            primal: [SVector::zeros(); N],
            dual: [T::zero(); M],
            slope: T::zero(),
        }
    }
}

/// Rows that hold with equality, with the factor of their Gram matrix.
#[derive(Clone, Debug)]
pub(crate) struct WorkingSet<T, const NU: usize, const N: usize, const M: usize> {
    rows: [Row<T, NU, N>; M],
    factor: [[T; M]; M],
    len: usize,
}

impl<T: Scalar, const NU: usize, const N: usize, const M: usize> WorkingSet<T, NU, N, M> {
    pub fn new() -> Self {
        Self {
            rows: [Row::empty(); M],
            factor: [[T::zero(); M]; M],
            len: 0,
        }
    }

    pub fn clear(&mut self) {
        self.len = 0;
    }

    pub fn len(&self) -> usize {
        self.len
    }

    pub fn is_full(&self) -> bool {
        self.len >= M
    }

    pub fn rows(&self) -> &[Row<T, NU, N>] {
        self.rows.get(..self.len).unwrap_or(&[])
    }

    pub fn rows_mut(&mut self) -> &mut [Row<T, NU, N>] {
        self.rows.get_mut(..self.len).unwrap_or(&mut [])
    }

    /// The answer of the minimiser over the working set to the candidate `row`.
    pub fn direction(&self, row: &Row<T, NU, N>, direction: &mut Direction<T, NU, N, M>) {
        let Direction {
            primal,
            dual,
            slope,
        } = direction;
        *primal = row.alpha;
        let size = row.dot(&row.alpha);
        for (d, other) in dual.iter_mut().zip(self.rows()) {
            *d = other.dot(&row.alpha);
        }
        self.solve_gram(dual);
        for (d, other) in dual.iter().zip(self.rows()) {
            other.add_to(primal, -*d);
        }
        let cancelled: T = convert(0.1);
        if self.len > 0 && square(primal) < cancelled * size {
            self.correct(primal, dual);
        }
        let mut rest = square(primal);
        for (d, other) in dual.iter().zip(self.rows()) {
            rest += other.compliance * *d * *d;
        }
        // Beyond this angle to the span of the working set, rounding decides: take the row
        // as dependent.
        let dependent = T::default_epsilon() * convert(4.0) * size;
        let rigid = if rest > dependent { rest } else { T::zero() };
        *slope = rigid + row.compliance;
    }

    /// One step of iterative refinement on G dual = W alpha, in terms of the residual vector.
    fn correct(&self, primal: &mut [SVector<T, NU>; N], dual: &mut [T; M]) {
        let mut correction = [T::zero(); M];
        for ((c, d), other) in correction.iter_mut().zip(dual.iter()).zip(self.rows()) {
            *c = other.dot(primal) - other.compliance * *d;
        }
        self.solve_gram(&mut correction);
        for ((c, d), other) in correction.iter().zip(dual.iter_mut()).zip(self.rows()) {
            *d += *c;
            other.add_to(primal, -*c);
        }
    }

    /// Adds `row`, whose `direction` is current. The set must not be full.
    pub fn append(&mut self, row: &Row<T, NU, N>, direction: &Direction<T, NU, N, M>) {
        let m = self.len;
        // The new row of L is L^-1 W alpha = L' dual.
        let mut entries = [T::zero(); M];
        for (j, entry) in entries.iter_mut().enumerate().take(m) {
            *entry = self
                .factor
                .iter()
                .zip(direction.dual.iter())
                .take(m)
                .skip(j)
                .fold(T::zero(), |sum, (l, d)| {
                    sum + l.get(j).copied().unwrap_or(T::zero()) * *d
                });
        }
        if let Some(place) = entries.get_mut(m) {
            *place = direction.slope.sqrt();
        }
        if let (Some(l), Some(place)) = (self.factor.get_mut(m), self.rows.get_mut(m)) {
            *l = entries;
            *place = *row;
            self.len = m + 1;
        }
    }

    /// Removes the row at `position`.
    pub fn remove(&mut self, position: usize) -> Row<T, NU, N> {
        let Some(removed) = self.rows().get(position).copied() else {
            return Row::empty();
        };
        let m = self.len;
        for j in position + 1..m {
            if let Some((before, from)) = pair_mut(&mut self.rows, j) {
                *before = *from;
            }
            if let Some((before, from)) = pair_mut(&mut self.factor, j) {
                *before = *from;
            }
        }
        self.len = m - 1;
        // Row k now reaches one column too far: rotate columns k and k + 1.
        for k in position..self.len {
            let (a, b) = self.entries(k, k);
            let length = a.hypot(b);
            if length == T::zero() {
                continue;
            }
            let (c, s) = (a / length, b / length);
            for row in self.factor.iter_mut().take(self.len).skip(k) {
                if let Some([left, right]) = row.get_mut(k..k + 2) {
                    (*left, *right) = (c * *left + s * *right, c * *right - s * *left);
                }
            }
        }
        removed
    }

    fn entries(&self, row: usize, column: usize) -> (T, T) {
        match self.factor.get(row).and_then(|l| l.get(column..column + 2)) {
            Some([a, b]) => (*a, *b),
            _ => (T::one(), T::zero()),
        }
    }

    /// G^-1 in place on the first `len` entries.
    pub fn solve_gram(&self, rhs: &mut [T; M]) {
        for i in 0..self.len.min(M) {
            let l = &self.factor[i];
            let mut entry = rhs[i];
            for k in 0..i {
                entry -= l[k] * rhs[k];
            }
            rhs[i] = entry / l[i];
        }
        for i in (0..self.len.min(M)).rev() {
            let entry = rhs[i] / self.factor[i][i];
            rhs[i] = entry;
            for k in 0..i {
                rhs[k] -= self.factor[i][k] * entry;
            }
        }
    }
}

/// |v|^2
fn square<T: Scalar, const NU: usize, const N: usize>(v: &[SVector<T, NU>; N]) -> T {
    v.iter().fold(T::zero(), |sum, v| sum + v.norm_squared())
}

/// Places `j - 1` and `j`.
fn pair_mut<V>(array: &mut [V], j: usize) -> Option<(&mut V, &mut V)> {
    match array.get_mut(j.wrapping_sub(1)..=j) {
        Some([before, from]) => Some((before, from)),
        _ => None,
    }
}
