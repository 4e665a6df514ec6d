//! The set x'Px <= level.

use super::normalised::Normaliser;
use crate::cover::Cell;
use crate::enclosure::{
    Arithmetic, Ball, Interval, from_fn, is_positive_definite, product, transposed,
};
use nalgebra::{SMatrix, SVector};

/// The set x'Px <= level, with rigorous answers about it.
#[derive(Debug, Clone)]
pub(super) struct Ellipsoid<const NX: usize> {
    p: SMatrix<f64, NX, NX>,
    level: f64,
    normaliser: Normaliser<NX>,
}

impl<const NX: usize> Ellipsoid<NX> {
    pub fn new(p: SMatrix<f64, NX, NX>, level: f64, normaliser: Normaliser<NX>) -> Self {
        Self {
            p,
            level,
            normaliser,
        }
    }

    pub fn level(&self) -> f64 {
        self.level
    }

    /// Whether |row x| <= limit in the whole set: limit^2 P - level row'row > 0.
    fn keeps(&self, row: &SVector<f64, NX>, limit: f64) -> bool {
        let square = Interval::point(limit).square();
        let level = Interval::point(self.level);
        let p = self.normaliser.p();
        let rest = from_fn(|i, j| {
            let outer = Interval::point(row[i]) * Interval::point(row[j]);
            square * p[i][j] - level * outer
        });
        limit > 0.0 && is_positive_definite(&self.normaliser.congruent(&rest))
    }

    /// A proved bound of |row x| in the set, above the largest value by rounding; infinite if it
    /// could not be proved.
    pub fn bound(&self, row: &SVector<f64, NX>) -> f64 {
        const MARGIN: f64 = 1.0 + 1e-9;
        if row.amax() == 0.0 {
            return 0.0;
        }
        let bound = self.reach(row) * MARGIN;
        if self.keeps(row, bound) {
            bound
        } else {
            f64::INFINITY
        }
    }

    /// A state of the set with |row x| > limit, rounding included; `None` if none was found.
    pub fn beyond(&self, row: &SVector<f64, NX>, limit: f64) -> Option<SVector<f64, NX>> {
        const INSIDE: f64 = 1.0 - 1e-9;
        let state = self.farthest(row)? * INSIDE;
        let value = (0..NX).fold(Interval::point(0.0), |sum, i| {
            sum + Interval::point(row[i]) * Interval::point(state[i])
        });
        (self.holds(&state) && value.lower > limit).then_some(state)
    }

    /// The state of the set with the largest row x, rounded.
    pub fn farthest(&self, row: &SVector<f64, NX>) -> Option<SVector<f64, NX>> {
        let inverse =
            nalgebra::DMatrix::from_column_slice(NX, NX, self.p.as_slice()).try_inverse()?;
        let along = inverse * nalgebra::DVector::from_column_slice(row.as_slice());
        let along = SVector::from_column_slice(along.as_slice());
        Some(along * (self.level / row.dot(&along)).sqrt())
    }

    /// Whether the state is in the set, for certain.
    pub fn holds(&self, state: &SVector<f64, NX>) -> bool {
        self.value(state).upper <= self.level
    }

    /// x'Px.
    pub fn value(&self, state: &SVector<f64, NX>) -> Interval {
        let x: [[Interval; 1]; NX] = from_fn(|i, _| Interval::point(state[i]));
        let [[value]] = product(&transposed(&x), &product(self.normaliser.p(), &x));
        value
    }

    /// The largest |row x| in the set, rounded.
    fn reach(&self, row: &SVector<f64, NX>) -> f64 {
        let inverse = nalgebra::DMatrix::from_column_slice(NX, NX, self.p.as_slice()).try_inverse();
        let row = nalgebra::DVector::from_column_slice(row.as_slice());
        inverse.map_or(f64::INFINITY, |inverse| {
            (self.level * row.dot(&(inverse * &row))).sqrt()
        })
    }

    /// A ball of y around the set, x = T y.
    pub fn bounding_ball(&self) -> Ball {
        let square = Interval::point(self.level) * self.normaliser.unit.reciprocal();
        Ball {
            radius: square.square_root().upper,
        }
    }

    /// A cell of y around that.
    pub fn bounding_cell(&self) -> Cell<NX> {
        Cell {
            centre: SVector::zeros(),
            half_widths: SVector::repeat(self.bounding_ball().radius),
        }
    }

    /// Whether no T y with y in the cell is in the set: x'Px = y'T'PTy >= unit |y|^2.
    pub fn misses(&self, cell: &Cell<NX>) -> bool {
        let square = |i: usize| Interval::around(cell.centre[i], cell.half_widths[i]).square();
        let distance = (0..NX).fold(Interval::point(0.0), |sum, i| sum + square(i));
        (distance * self.normaliser.unit).lower > self.level
    }
}
