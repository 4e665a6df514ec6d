//! Matrix inequalities against P, in coordinates in which P is nearly the identity.

use crate::enclosure::{
    Arithmetic, Frame, Interval, from_fn, is_positive_definite, product, transposed,
};
use nalgebra::{DMatrix, SMatrix, SVector};

/// Rows of a square matrix whose entries are known up to intervals.
pub(super) type Square<const N: usize> = [[Interval; N]; N];

/// Coordinates y, x = T y, in which x'Px is nearly |y|^2: T from a Cholesky factorisation in
/// rounded numbers.
#[derive(Debug, Clone, Copy)]
pub(super) struct Normaliser<const NX: usize> {
    pub frame: Frame<NX>,
    p: Square<NX>,
    /// (1 - UNIT_SLACK) |y|^2 <= x'Px <= (1 + UNIT_SLACK) |y|^2.
    pub unit: Interval,
}

/// More than rounding makes of the identity.
const UNIT_SLACK: f64 = 1e-9;

impl<const NX: usize> Normaliser<NX> {
    /// `None` if P is not symmetric to the bit, or was not shown to be positive definite.
    pub fn of(p: &SMatrix<f64, NX, NX>) -> Option<Self> {
        if *p != p.transpose() {
            return None;
        }
        let factor = DMatrix::from_column_slice(NX, NX, p.as_slice()).cholesky()?;
        let t = factor.l().transpose().try_inverse()?;
        // Upper triangular.
        let entry = |i: usize, j: usize| if i <= j { t[(i, j)] } else { 0.0 };
        if t.iter().any(|entry| !entry.is_finite()) || (0..NX).any(|i| entry(i, i) == 0.0) {
            return None;
        }
        let t: Square<NX> = from_fn(|i, j| Interval::point(entry(i, j)));
        let normaliser = Self {
            frame: Frame {
                t,
                inverse: triangular_inverse(&t),
            },
            p: from_fn(|i, j| Interval::point(p[(i, j)])),
            unit: Interval::new(1.0 - UNIT_SLACK, 1.0 + UNIT_SLACK),
        };
        let unit = normaliser.congruent(&normaliser.p);
        let above = minus_identity(&unit, Interval::point(normaliser.unit.lower));
        let below = minus_identity(
            &unit.map(|row| row.map(|x| -x)),
            Interval::point(-normaliser.unit.upper),
        );
        let near = is_positive_definite(&above) && is_positive_definite(&below);
        near.then_some(normaliser)
    }

    /// T'MT of a symmetric M: positive definite if and only if M is.
    pub fn congruent(&self, m: &Square<NX>) -> Square<NX> {
        product(&transposed(&self.frame.t), &product(m, &self.frame.t))
    }

    /// Roughly T y.
    pub fn state(&self, y: &SVector<f64, NX>) -> SVector<f64, NX> {
        SMatrix::<f64, NX, NX>::from_fn(|i, j| self.frame.t[i][j].middle()) * y
    }

    pub fn p(&self) -> &Square<NX> {
        &self.p
    }
}

/// By back substitution.
fn triangular_inverse<const N: usize>(t: &Square<N>) -> Square<N> {
    let mut inverse = [[Interval::point(0.0); N]; N];
    for i in (0..N).rev() {
        let row = from_fn::<_, 1, N>(|_, j| {
            let unit = Interval::point(if i == j { 1.0 } else { 0.0 });
            let sum = (i + 1..N).fold(unit, |sum, k| sum - t[i][k] * inverse[k][j]);
            sum * t[i][i].reciprocal()
        });
        inverse[i] = row[0];
    }
    inverse
}

/// The corners of the box -1 <= z <= 1, as signs, of the components that `vary`; the others stay at 0.
pub(super) fn corners<const D: usize>(vary: [bool; D]) -> impl Iterator<Item = [f64; D]> {
    let count = vary.iter().filter(|one| **one).count();
    (0..1_usize << count).map(move |corner| {
        let mut rest = corner;
        vary.map(|varies| {
            let sign = match (varies, rest & 1) {
                (false, _) => return 0.0,
                (true, 1) => 1.0,
                (true, _) => -1.0,
            };
            rest >>= 1;
            sign
        })
    })
}

/// M - shift I.
pub(super) fn minus_identity<const N: usize>(m: &Square<N>, shift: Interval) -> Square<N> {
    from_fn(|i, j| if i == j { m[i][j] - shift } else { m[i][j] })
}
