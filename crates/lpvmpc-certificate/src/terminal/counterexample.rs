//! A search for states at which a claimed decrease is false, or cannot be proved.

use super::decrease::Decrease;
use super::normalised::Square;
use crate::enclosure::Interval;
use lpvmpc::Embedding;
use lpvmpc_design::each;
use nalgebra::{DMatrix, SVector, SymmetricEigen};

/// Directions that are looked at, on the edge of the set and close to the origin.
const DIRECTIONS: usize = 48;
/// Of them, so many are followed to where the excess grows.
const FOLLOWED: usize = 6;
/// Steps of each.
const STEPS: usize = 8;
/// Inside the edge by more than rounding.
const EDGE: f64 = 1.0 - 1e-7;

/// What rounded numbers say of one state y, x = T y.
struct Look<const NX: usize> {
    y: SVector<f64, NX>,
    /// (V(x+) - what is allowed) / V(x).
    excess: f64,
    /// The same for the direction in which the matrix inequality is tightest at this scheduling.
    matrix_excess: f64,
    /// That direction, a unit vector.
    tightest: SVector<f64, NX>,
}

impl<M, const NX: usize, const NU: usize> Decrease<'_, M, NX, NU> {
    /// A state of the set at which the claimed decrease is false for certain, and by which share of
    /// V. Deterministic and of bounded work; `None` says nothing. `near` are more places to look.
    pub fn counterexample<const NS: usize>(
        &self,
        near: &[SVector<f64, NX>],
    ) -> Option<(SVector<f64, NX>, f64)>
    where
        M: Embedding<NX, NU, NS> + Sync,
    {
        let mut found = self.looks(near);
        found.sort_by(|a, b| b.excess.total_cmp(&a.excess));
        found.truncate(FOLLOWED);
        let followed = each(&found, |_, look| self.follow(look));
        let mut candidates: Vec<Look<NX>> = followed.into_iter().flatten().collect();
        candidates.extend(found);
        candidates.retain(|look| look.excess > 0.0);
        candidates.sort_by(|a, b| b.excess.total_cmp(&a.excess));
        candidates.iter().take(FOLLOWED).find_map(|look| {
            let x = self.normaliser.state(&look.y);
            self.violation(&x).map(|excess| (x, excess))
        })
    }

    /// The largest violation of the matrix inequality that was found, in units of P; below zero
    /// where there is none. Where it is above, no number of boxes proves the claim.
    pub fn tightest<const NS: usize>(&self) -> f64
    where
        M: Embedding<NX, NU, NS> + Sync,
    {
        let looks = self.looks(&[]);
        let excess = looks.iter().map(|look| look.matrix_excess);
        excess.fold(f64::NEG_INFINITY, f64::max)
    }

    fn looks<const NS: usize>(&self, near: &[SVector<f64, NX>]) -> Vec<Look<NX>>
    where
        M: Embedding<NX, NU, NS> + Sync,
    {
        let radius = self.ellipsoid.level().sqrt() * EDGE;
        let mut places: Vec<SVector<f64, NX>> = directions().map(|y| y * radius).collect();
        places.extend(near.iter().filter_map(|y| {
            let edge = radius / y.norm();
            edge.is_finite().then(|| y * edge.min(1.0))
        }));
        // Close to the origin the plant is linear, and one direction says it all.
        let origin = directions()
            .next()
            .and_then(|axis: SVector<f64, NX>| self.look(&(axis * (1e-3 * radius))));
        if let Some(origin) = &origin {
            places.extend([1e-3, 0.5, 1.0].map(|share| origin.tightest * (share * radius)));
        }
        let looks = each(&places, |_, y| self.look(y));
        looks.into_iter().flatten().collect()
    }

    /// To where this scheduling is worst, again and again.
    fn follow<const NS: usize>(&self, start: &Look<NX>) -> Vec<Look<NX>>
    where
        M: Embedding<NX, NU, NS> + Sync,
    {
        let radius = self.ellipsoid.level().sqrt() * EDGE;
        let mut path: Vec<Look<NX>> = Vec::new();
        for step in 0..STEPS {
            let from = path.last().unwrap_or(start);
            let side = if from.tightest.dot(&from.y) < 0.0 {
                -1.0
            } else {
                1.0
            };
            // Half of the way by turns, since the scheduling moves along.
            let share = if step % 2 == 0 { 1.0 } else { 0.5 };
            let towards = from.tightest * (side * radius * share) + from.y * (1.0 - share);
            let Some(look) = self.look(&(towards.normalize() * radius)) else {
                break;
            };
            path.push(look);
        }
        path
    }

    fn look<const NS: usize>(&self, y: &SVector<f64, NX>) -> Option<Look<NX>>
    where
        M: Embedding<NX, NU, NS> + Sync,
    {
        let at = std::array::from_fn(|i| Interval::point(y[i]));
        let sample = self.enclose_finely(&at)?;
        let g = DMatrix::from_column_slice(NX, NX, sample.transition.middle.as_slice());
        let allowed = middles(&self.allowed);
        let excess = g.transpose() * g - allowed;
        let column = DMatrix::from_column_slice(NX, 1, y.as_slice());
        let value = (column.transpose() * &excess * &column)[0] / y.norm_squared();
        if !value.is_finite() {
            return None;
        }
        let eigen = SymmetricEigen::new(excess);
        let worst = eigen.eigenvalues.imax();
        Some(Look {
            y: *y,
            excess: value,
            matrix_excess: eigen.eigenvalues[worst],
            tightest: SVector::from_fn(|i, _| eigen.eigenvectors[(i, worst)]),
        })
    }
}

/// Unit vectors: the axes, then others spread by the fractional parts of multiples of the roots of
/// primes. Of y and -y one is enough for a plant that is the same on both sides; both occur.
fn directions<const NX: usize>() -> impl Iterator<Item = SVector<f64, NX>> {
    let axes = (0..NX).map(|i| SVector::from_fn(|j, _| if i == j { 1.0 } else { 0.0 }));
    let spread = (1..=DIRECTIONS).map(|n| {
        let roots = [2.0_f64, 3.0, 5.0, 7.0, 11.0, 13.0, 17.0, 19.0];
        let component = |i: usize| {
            let prime = roots[i % roots.len()] + (i / roots.len()) as f64;
            2.0 * (n as f64 * prime.sqrt()).fract() - 1.0
        };
        SVector::<f64, NX>::from_fn(|i, _| component(i)).normalize()
    });
    axes.chain(spread)
}

fn middles<const N: usize>(m: &Square<N>) -> DMatrix<f64> {
    DMatrix::from_fn(N, N, |i, j| m[i.max(j)][i.min(j)].middle())
}
