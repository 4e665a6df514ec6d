//! A random order of the first n numbers that needs no memory: any place of it is had at once, on any
//! shard.

use crate::inputs::child;

/// A permutation of 0 to n - 1: a Feistel network on as many bits as n needs, gone through again
/// where it leads beyond n.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Permutation {
    keys: [u64; ROUNDS],
    /// Bits of each half.
    half: u32,
    n: u64,
}

/// Rounds of the network; four make a pseudorandom permutation (Luby and Rackoff 1988).
const ROUNDS: usize = 6;

impl Permutation {
    /// The permutation of 0 to `n` - 1 with this seed.
    pub fn new(seed: u64, n: u64) -> Self {
        let bits = u64::BITS - n.saturating_sub(1).leading_zeros();
        Self {
            keys: std::array::from_fn(|round| child(seed, round as u64)),
            half: bits.div_ceil(2).max(1),
            n,
        }
    }

    /// Where `index` goes.
    pub fn at(&self, index: u64) -> u64 {
        let mut place = index;
        loop {
            place = self.network(place);
            // At most three of four places are beyond.
            if place < self.n {
                return place;
            }
        }
    }

    fn network(&self, place: u64) -> u64 {
        let mask = (1 << self.half) - 1;
        let (mut left, mut right) = (place >> self.half, place & mask);
        for key in self.keys {
            (left, right) = (right, left ^ (mixed(right ^ key) & mask));
        }
        left << self.half | right
    }
}

/// The finaliser of MurmurHash3 (Appleby), whose every bit depends on every bit.
fn mixed(mut bits: u64) -> u64 {
    bits = (bits ^ bits >> 33).wrapping_mul(0xff51_afd7_ed55_8ccd);
    bits = (bits ^ bits >> 33).wrapping_mul(0xc4ce_b9fe_1a85_ec53);
    bits ^ bits >> 33
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_place_is_taken_once() {
        for n in [1, 2, 3, 5, 64, 100, 1000] {
            let mut taken = vec![false; n as usize];
            let order = Permutation::new(7, n);
            (0..n).for_each(|i| taken[order.at(i) as usize] = true);
            assert!(taken.into_iter().all(|place| place), "{n}");
        }
    }

    /// Neighbours come from anywhere, and other seeds give other orders.
    #[test]
    fn the_order_is_random() {
        let n = 1000;
        let order = Permutation::new(1, n);
        let places: Vec<f64> = (0..n).map(|i| order.at(i) as f64).collect();
        let mean = (n - 1) as f64 / 2.0;
        let product = |pair: &[f64]| (pair[0] - mean) * (pair[1] - mean);
        let covariance = places.windows(2).map(product).sum::<f64>() / n as f64;
        let variance = places.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n as f64;
        assert!((covariance / variance).abs() < 4.0 / (n as f64).sqrt());
        let other = Permutation::new(2, n);
        let same = (0..n).filter(|i| other.at(*i) == order.at(*i)).count();
        assert!(same < 10, "{same}");
    }
}
