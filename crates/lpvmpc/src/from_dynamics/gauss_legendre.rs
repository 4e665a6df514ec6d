//! Integrals from 0 to 1.

use core::f64::consts::PI;
use nalgebra::ComplexField;

/// A formula of Gauss and Legendre: the integral of g from 0 to 1 as a sum of weights times g at nodes,
/// exact for polynomials of degree 2 n - 1 with n nodes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GaussLegendre {
    /// Nodes with their weights.
    nodes: [(f64, f64); Self::MOST],
    count: usize,
}

impl GaussLegendre {
    /// The largest number of nodes.
    pub const MOST: usize = 16;

    /// The formula with so many nodes, at least 1 and at most [`Self::MOST`].
    ///
    /// The roots of the Legendre polynomial by Newton's method from their asymptotic places
    /// (Press et al., Numerical Recipes, ch. 4.6).
    pub fn with_nodes(count: usize) -> Self {
        let count = count.clamp(1, Self::MOST);
        let mut nodes = [(0.0, 0.0); Self::MOST];
        for (i, node) in nodes.iter_mut().take(count).enumerate() {
            let mut x = ComplexField::cos(PI * (i as f64 + 0.75) / (count as f64 + 0.5));
            // It converges quadratically from where it begins.
            for _ in 0..8 {
                let (value, slope) = legendre(count, x);
                x -= value / slope;
            }
            let (_, slope) = legendre(count, x);
            *node = (0.5 * (1.0 - x), 1.0 / ((1.0 - x * x) * slope * slope));
        }
        Self { nodes, count }
    }

    /// How many nodes it has.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Each node with its weight.
    pub fn iter(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        self.nodes.iter().take(self.count).copied()
    }
}

/// The Legendre polynomial of degree `n` >= 1 and its derivative at `x`, |x| < 1.
fn legendre(n: usize, x: f64) -> (f64, f64) {
    let (mut before, mut value) = (1.0, x);
    for k in 2..=n {
        let k = k as f64;
        (before, value) = (
            value,
            ((2.0 * k - 1.0) * x * value - (k - 1.0) * before) / k,
        );
    }
    (value, n as f64 * (x * value - before) / (x * x - 1.0))
}
