//! Proof that the terminal law decreases the terminal cost over each sample.

use super::cover::{Cell, Finding};
use super::ellipsoid::Ellipsoid;
use super::normalised::{Normaliser, Square, corners, from_fn, minus_identity, transposed};
use crate::enclosure::{
    AnalyticModel, Interval, SampledLaw, is_positive_definite, product, smallest_eigenvalue,
};
use nalgebra::SMatrix;
use std::cell::Cell as Shared;

/// The statement (1 - contraction) P - Q - K'RK - Psi'P Psi > 0 for every x in the ellipsoid,
/// where x+ = Psi x is the state a sample after x under u = -K x, held.
pub(super) struct Decrease<'a, M, const NX: usize, const NU: usize> {
    pub model: &'a M,
    pub law: SampledLaw<NX, NU>,
    pub normaliser: Normaliser<NX>,
    /// T'((1 - contraction) P - Q - K'RK)T, times a lower bound of the eigenvalues of T'PT.
    pub allowed: Square<NX>,
    pub ellipsoid: Ellipsoid<NX>,
    /// Where the states have been during the samples, over all cells that were proved.
    pub states: Shared<[Interval; NX]>,
}

impl<M, const NX: usize, const NU: usize> Decrease<'_, M, NX, NU> {
    pub fn examine<const NS: usize>(&self, cell: &Cell<NX>) -> Finding
    where
        M: AnalyticModel<NX, NU, NS>,
    {
        if self.ellipsoid.misses(cell) {
            return Finding::Outside;
        }
        let frame = &self.normaliser.frame;
        let sample = self
            .law
            .enclose(self.model, frame, &cell.centre, &cell.half_widths);
        let Ok(sample) = sample else {
            return Finding::Open {
                across: cell.half_widths.imax(),
            };
        };
        let g = sample.transition;
        // A bound of the norm of (G + E)'(G + E) - G'G for |E| <= error.
        let (size, error) = (Interval::point(g.norm()), Interval::point(g.error));
        let shift = error * (size + size + error);
        let at = |corner: &[f64; NX]| minus_identity(&self.rest(&g.at(corner)), shift);
        // The matrix depends on G'G, which is convex along lines: the corners are the worst.
        if corners().all(|corner| is_positive_definite(&at(&corner))) {
            let states = self.states.get();
            self.states
                .set(std::array::from_fn(|i| states[i].hull(sample.states[i])));
            let spare = corners().map(|corner| smallest_eigenvalue(&at(&corner)));
            return Finding::Holds {
                spare: spare.fold(f64::INFINITY, f64::min),
            };
        }
        let highest = smallest_eigenvalue(&self.rest(&g.at(&[0.0; NX]))) + shift.upper;
        if highest < 0.0 && !self.ellipsoid.misses(&cell.middle()) {
            return Finding::Fails { excess: -highest };
        }
        let weights: [f64; NX] = std::array::from_fn(|i| g.weight(i));
        let across = (0..NX).max_by(|a, b| weights[*a].total_cmp(&weights[*b]));
        Finding::Open {
            across: across.unwrap_or(0),
        }
    }

    /// allowed - G'G.
    fn rest(&self, g: &Square<NX>) -> Square<NX> {
        let square = product(&transposed(g), g);
        from_fn(|i, j| self.allowed[i][j] - square[i][j])
    }
}

/// (1 - contraction) P - Q - K'RK.
pub(super) fn allowed<const NX: usize, const NU: usize>(
    p: &SMatrix<f64, NX, NX>,
    q: &SMatrix<f64, NX, NX>,
    r: &SMatrix<f64, NU, NU>,
    k: &SMatrix<f64, NU, NX>,
    contraction: f64,
) -> Square<NX> {
    let k: [[Interval; NX]; NU] = from_fn(|i, j| Interval::point(k[(i, j)]));
    let r: [[Interval; NU]; NU] = from_fn(|i, j| Interval::point(r[(i, j)]));
    let input_cost = product(&transposed(&k), &product(&r, &k));
    let kept = Interval::point(1.0) - Interval::point(contraction);
    from_fn(|i, j| {
        kept * Interval::point(p[(i, j)]) - Interval::point(q[(i, j)]) - input_cost[i][j]
    })
}
