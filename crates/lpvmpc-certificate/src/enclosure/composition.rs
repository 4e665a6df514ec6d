//! Many steps in a row.

use super::taylor_map::{ROUNDING, TaylorMap, euclidean, known};
use nalgebra::SMatrix;

/// M_{n+1} = Phi_n M_n + N_n. The error of each step is kept apart: what it acts on, and the
/// nominal product of the Phi that have acted on it since. Were errors only bounded step by step,
/// and the same in every direction, the bound would grow with the product of the norms, and would
/// not know which directions the errors leave alone.
pub(super) struct Composition<const N: usize, const C: usize, const D: usize> {
    /// M_n without error.
    map: TaylorMap<N, C, D>,
    sources: Vec<Source<N, C>>,
}

/// A matrix within E of the given one, E = F W with |F| <= `size`.
pub(super) struct Uncertain<const N: usize, const K: usize, const D: usize> {
    /// The matrix; its own error is one in any direction.
    pub map: TaylorMap<N, K, D>,
    /// |F|, at most.
    pub size: f64,
    /// W.
    pub acts_on: SMatrix<f64, K, K>,
}

/// An error F W with |F| <= `size`, by now `since` F W.
struct Source<const N: usize, const C: usize> {
    size: f64,
    since: SMatrix<f64, N, N>,
    /// W'W, of norm 1, up to rounding.
    metric: SMatrix<f64, C, C>,
}

impl<const N: usize, const C: usize> Source<N, C> {
    /// The error F `acts_on` with |F| <= `size`.
    fn new<const K: usize>(size: f64, acts_on: SMatrix<f64, K, C>) -> Self {
        let norm = euclidean(&acts_on);
        let acts_on = if norm > 0.0 { acts_on / norm } else { acts_on };
        Self {
            size: known(size * norm * (1.0 + ROUNDING)),
            since: SMatrix::identity(),
            metric: acts_on.transpose() * acts_on,
        }
    }

    /// An error in any direction.
    fn isotropic(size: f64) -> Self {
        Self::new(size, SMatrix::<f64, C, C>::identity())
    }

    /// A bound of the norm.
    fn norm(&self) -> f64 {
        self.size * euclidean(&self.since) * (1.0 + ROUNDING)
    }
}

impl<const N: usize, const D: usize> Composition<N, N, D> {
    /// M_0 = I.
    pub fn identity() -> Self {
        Self {
            map: TaylorMap::constant(SMatrix::identity()),
            sources: Vec::new(),
        }
    }
}

impl<const N: usize, const C: usize, const D: usize> Composition<N, C, D> {
    /// The next step, with N_n = `gamma` `gain`.
    pub fn advance<const K: usize>(
        &mut self,
        phi: &Uncertain<N, N, D>,
        gamma: &Uncertain<N, K, D>,
        gain: &TaylorMap<K, C, D>,
    ) {
        let before: f64 = self.sources.iter().map(Source::norm).sum();
        let next = phi.map.times(&self.map).plus(&gamma.map.times(gain));
        // Of the old error, `since` tells what the middle of Phi does to it, up to rounding.
        for source in &mut self.sources {
            source.since = phi.map.middle * source.since;
        }
        let varies = self.map.deviation();
        let acts_on = phi.acts_on * self.map.middle;
        let acts_through = gamma.acts_on * gain.middle;
        let reach = euclidean(&phi.acts_on);
        let fresh = next.error
            + before * (phi.map.deviation() + phi.map.error + phi.size * reach)
            + phi.size * reach * varies
            + gamma.size * euclidean(&gamma.acts_on) * gain.deviation()
            + ROUNDING
                * (before * euclidean(&phi.map.middle)
                    + phi.size * reach * euclidean(&self.map.middle)
                    + gamma.size * euclidean(&gamma.acts_on) * euclidean(&gain.middle));
        self.sources.extend([
            Source::new(phi.size, acts_on),
            Source::new(gamma.size, acts_through),
            Source::isotropic(fresh),
        ]);
        self.map = TaylorMap { error: 0.0, ..next };
    }

    /// How much M depends on each coordinate of the box.
    pub fn dependence(&self) -> [f64; D] {
        std::array::from_fn(|symbol| self.map.weight(symbol))
    }

    /// M as an affine map without error, and a matrix S with E'E <= S for its error E: by Cauchy
    /// and Schwarz, |sum of F_i W_i v|^2 <= (sum of |F_i|) (sum of |F_i| |W_i v|^2).
    pub fn affine(&self) -> (TaylorMap<N, C, D>, SMatrix<f64, C, C>) {
        let map = self.map.affine();
        let rest = Source::isotropic(map.error);
        let mut total = 0.0;
        let mut metric = SMatrix::zeros();
        for source in self.sources.iter().chain([&rest]) {
            total += source.norm();
            metric += source.metric * source.norm();
        }
        let square = metric * total;
        // Rounding, as much as any entry of the sums may have.
        let slack = ROUNDING * (square.norm() + total * metric.norm());
        let square = (square + SMatrix::identity() * slack) * (1.0 + ROUNDING);
        (TaylorMap { error: 0.0, ..map }, square)
    }
}
