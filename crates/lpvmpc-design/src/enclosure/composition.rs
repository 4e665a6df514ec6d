//! Many steps in a row.

use super::affine_map::{AffineMap, ROUNDING, euclidean, known};
use nalgebra::SMatrix;

/// M_{n+1} = Phi_n M_n + N_n. The error of each step is kept apart, with the nominal product of
/// the Phi that have acted on it since: were it only bounded step by step, the bound would grow
/// with the product of the norms, which is far above the norm of the product.
pub(super) struct Composition<const N: usize, const C: usize, const D: usize> {
    /// M_n without error.
    map: AffineMap<N, C, D>,
    sources: Vec<Source<N>>,
}

/// An error E with |E| <= `size`, by now `since` E.
struct Source<const N: usize> {
    size: f64,
    since: SMatrix<f64, N, N>,
}

impl<const N: usize, const C: usize, const D: usize> From<AffineMap<N, C, D>>
    for Composition<N, C, D>
{
    fn from(map: AffineMap<N, C, D>) -> Self {
        let first = Source {
            size: map.error,
            since: SMatrix::identity(),
        };
        Self {
            map: AffineMap { error: 0.0, ..map },
            sources: vec![first],
        }
    }
}

impl<const N: usize, const C: usize, const D: usize> Composition<N, C, D> {
    /// The next step.
    pub fn advance(&mut self, phi: &AffineMap<N, N, D>, added: &AffineMap<N, C, D>) {
        let error = self.error();
        let next = phi.times(&self.map).plus(added);
        // Of the old error, `since` tells what the middle of Phi does to it, up to rounding.
        let rounding: f64 = {
            let size = euclidean(&phi.middle);
            let each = |source: &Source<N>| source.size * euclidean(&source.since);
            ROUNDING * size * self.sources.iter().map(each).sum::<f64>()
        };
        for source in &mut self.sources {
            source.since = phi.middle * source.since;
        }
        let fresh = next.error + (phi.deviation() + phi.error) * error + rounding;
        self.sources.push(Source {
            size: known(fresh * (1.0 + ROUNDING)),
            since: SMatrix::identity(),
        });
        self.map = AffineMap { error: 0.0, ..next };
    }

    /// A bound of the error.
    fn error(&self) -> f64 {
        let each = |source: &Source<N>| source.size * euclidean(&source.since);
        known(self.sources.iter().map(each).sum::<f64>() * (1.0 + ROUNDING))
    }

    /// M with its error.
    pub fn map(&self) -> AffineMap<N, C, D> {
        AffineMap {
            error: self.error(),
            ..self.map
        }
    }
}
