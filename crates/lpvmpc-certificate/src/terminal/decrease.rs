//! Proof that the terminal law decreases the terminal cost over each sample.

use super::ellipsoid::Ellipsoid;
use super::normalised::{Normaliser, Square, corners};
use crate::cover::{Cell, Finding};
use crate::enclosure::{
    Arithmetic, Interval, SampleEnclosure, SampledLaw, from_fn, is_positive_definite, product,
    smallest_eigenvalue, transposed,
};
use lpvmpc::Embedding;
use nalgebra::{DMatrix, SMatrix, SVector, SymmetricEigen};
use std::sync::{Mutex, PoisonError};

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
    pub states: Mutex<[Interval; NX]>,
}

impl<M, const NX: usize, const NU: usize> Decrease<'_, M, NX, NU> {
    pub fn examine<const NS: usize>(&self, cell: &Cell<NX>) -> Finding
    where
        M: Embedding<NX, NU, NS> + Sync,
    {
        if self.ellipsoid.misses(cell) {
            return Finding::Outside;
        }
        let frame = &self.normaliser.frame;
        let ball = self.ellipsoid.bounding_ball();
        let (centre, half_widths) = (&cell.centre, &cell.half_widths);
        let sample = { self.law }.enclose(self.model, frame, centre, half_widths, ball);
        let Ok(sample) = sample else {
            return Finding::Open {
                across: cell.half_widths.imax(),
            };
        };
        let g = sample.transition;
        let middle = g.at(&[0.0; NX]);
        let spread = self.spread(&middle, &sample.error_square);
        let at = |corner: &[f64; NX]| self.rest(&g.at(corner), &spread, 1.0);
        // The matrix depends on G'G, which is convex along lines: the corners are the worst.
        let vary = g.slopes.map(|slope| slope.amax() > 0.0);
        if corners(vary).all(|corner| is_positive_definite(&at(&corner))) {
            let mut states = self.states.lock().unwrap_or_else(PoisonError::into_inner);
            *states = std::array::from_fn(|i| states[i].hull(sample.states[i]));
            drop(states);
            let spare = corners(vary).map(|corner| smallest_eigenvalue(&at(&corner)));
            return Finding::Holds {
                spare: spare.fold(f64::INFINITY, f64::min),
            };
        }
        // The matrix inequality is more than the claim: where it is violated, the claim may hold.
        let highest = smallest_eigenvalue(&self.rest(&middle, &spread, -1.0));
        if highest < 0.0 && !self.ellipsoid.misses(&cell.middle()) {
            return Finding::Hopeless;
        }
        let weights = sample.dependence;
        let across = (0..NX).max_by(|a, b| weights[*a].total_cmp(&weights[*b]));
        Finding::Open {
            across: across.unwrap_or(0),
        }
    }

    /// By how much V(x+) exceeds what is claimed, as a share of V(x), at exactly this state and
    /// for certain: the motion is enclosed, and so is all rounding. `None` if it does not, if that
    /// is not certain, or if the state is not in the set.
    pub fn violation<const NS: usize>(&self, x: &SVector<f64, NX>) -> Option<f64>
    where
        M: Embedding<NX, NU, NS> + Sync,
    {
        if !self.ellipsoid.holds(x) {
            return None;
        }
        let x_column: [[Interval; 1]; NX] = from_fn(|i, _| Interval::point(x[i]));
        let y = product(&self.normaliser.frame.inverse, &x_column);
        let sample = self.enclose_finely(&y.map(|[y]| y))?;
        // y+ = (G + E) y with |E y|^2 <= y'Sy.
        let end = product(&sample.transition.range(), &y);
        let error: Square<NX> = from_fn(|i, j| Interval::point(sample.error_square[(i, j)]));
        let form = |m: &Square<NX>| product(&transposed(&y), &product(m, &y))[0][0];
        let norm = end
            .iter()
            .fold(Interval::point(0.0), |sum, [entry]| sum + entry.square())
            .square_root();
        let least = (norm - form(&error).square_root()).lower.max(0.0);
        let unit = self.normaliser.unit;
        let next = Interval::point(least).square() * Interval::point(unit.lower);
        let allowed = form(&self.allowed) * Interval::point(unit.upper);
        let excess = (next - allowed).lower;
        (excess > 0.0).then(|| excess / self.ellipsoid.value(x).upper)
    }

    /// The motion from a point y, in as many time steps as it takes, within reason: a long sample
    /// may have no enclosure in those that suit a proof.
    pub fn enclose_finely<const NS: usize>(
        &self,
        y: &[Interval; NX],
    ) -> Option<SampleEnclosure<NX, 0>>
    where
        M: Embedding<NX, NU, NS> + Sync,
    {
        const MORE_HALVINGS: u8 = 5;
        let frame = &self.normaliser.frame;
        (0..=MORE_HALVINGS).find_map(|more| {
            let law = SampledLaw {
                halvings: self.law.halvings + more,
                ..self.law
            };
            law.enclose_point(self.model, frame, y).ok()
        })
    }

    /// The split that costs least where the inequality is tightest, roughly.
    fn spread(&self, g: &Square<NX>, error_square: &SMatrix<f64, NX, NX>) -> Spread<NX> {
        let none = Spread {
            share: 0.0,
            square: SMatrix::zeros(),
        };
        let rest = self.rest(g, &none, 1.0);
        let rest = DMatrix::from_fn(NX, NX, |i, j| rest[i.max(j)][i.min(j)].middle());
        let eigen = SymmetricEigen::new(rest);
        let tightest = SVector::from_fn(|i, _| eigen.eigenvectors[(i, eigen.eigenvalues.imin())]);
        let size = SMatrix::<f64, NX, NX>::from_fn(|i, j| g[i][j].middle()) * tightest;
        let error = (error_square * tightest).dot(&tightest).sqrt();
        Spread {
            share: (error / size.norm()).clamp(1e-9, 0.5),
            square: *error_square,
        }
    }

    /// allowed less what bounds (G + E)'(G + E) from above (`sign` 1) or from below (-1):
    /// G'G and S = E'E in (1 + d) G'G + (1 + 1/d) S, in (1 - d) G'G - (1/d - 1) S.
    fn rest(&self, g: &Square<NX>, spread: &Spread<NX>, sign: f64) -> Square<NX> {
        let one = Interval::point(1.0);
        let share = Interval::point(spread.share);
        let (stretch, added) = if spread.share > 0.0 {
            let signed = Interval::point(sign);
            (one + signed * share, one + signed * share.reciprocal())
        } else {
            (one, one)
        };
        let square = product(&transposed(g), g);
        from_fn(|i, j| {
            let error = Interval::point(spread.square[(i, j)]);
            self.allowed[i][j] - stretch * square[i][j] - added * error
        })
    }
}

/// How an error E with E'E <= `square` is told from G, by the arithmetic and geometric mean: the
/// `share` d of G'G for the mixed terms.
struct Spread<const NX: usize> {
    share: f64,
    square: SMatrix<f64, NX, NX>,
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
