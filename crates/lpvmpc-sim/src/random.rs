//! The random numbers of simulated worlds.

use rand_xoshiro::rand_core::{Rng, SeedableRng};
use rand_xoshiro::{SplitMix64, Xoshiro256PlusPlus};
use std::f64::consts::TAU;

/// What the counter of SplitMix64 goes up by: 2^64 over the golden ratio (Steele, Lea and Flood 2014).
const SPLIT_MIX_STEP: u64 = 0x9e37_79b9_7f4a_7c15;

/// A stream of random numbers: the same seed and stream give the same numbers everywhere, to
/// rounding.
///
/// The normal distribution is that of Box and Muller (1958): the tables of a ziggurat would be a
/// good part of what a page in a browser has to load.
#[derive(Clone, Debug)]
pub struct Random(Xoshiro256PlusPlus);

impl Random {
    /// The stream with number `stream` of those of a `seed`.
    pub fn new(seed: u64, stream: usize) -> Self {
        // SplitMix64 is a counter behind a hash, so any of its numbers is had at once.
        let counter = seed.wrapping_add((stream as u64).wrapping_mul(SPLIT_MIX_STEP));
        let own = SplitMix64::seed_from_u64(counter).next_u64();
        Self(Xoshiro256PlusPlus::seed_from_u64(own))
    }

    /// Uniform in [0, 1).
    pub fn uniform(&mut self) -> f64 {
        // The upper 53 bits, as many as a number has.
        (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Uniform in [-1, 1).
    pub fn symmetric(&mut self) -> f64 {
        2.0 * self.uniform() - 1.0
    }

    /// Normally distributed around zero with standard deviation 1.
    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        let angle = TAU * self.uniform();
        radius * angle.cos()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const COUNT: usize = 200_000;

    /// What a share of the numbers may be off by: four standard deviations of the share itself.
    fn assert_share(found: usize, expected: f64, what: &str) {
        let share = found as f64 / COUNT as f64;
        let spread = (expected * (1.0 - expected) / COUNT as f64).sqrt();
        assert!(
            (share - expected).abs() < 4.0 * spread,
            "{what}: {share}, not {expected}"
        );
    }

    #[test]
    fn normal_numbers_have_the_quantiles_of_the_normal_distribution() {
        let mut random = Random::new(1, 0);
        let numbers: Vec<f64> = (0..COUNT).map(|_| random.normal()).collect();
        // Values of its distribution function: Abramowitz and Stegun, table 26.1.
        for (z, below) in [
            (0.0, 0.5),
            (0.5, 0.691_462_461),
            (1.0, 0.841_344_746),
            (2.0, 0.977_249_868),
            (3.0, 0.998_650_102),
        ] {
            let count = |fits: &dyn Fn(f64) -> bool| numbers.iter().filter(|n| fits(**n)).count();
            assert_share(count(&|n| n < z), below, "below");
            assert_share(count(&|n| n > -z), below, "above");
        }
        // Neighbours do not know of each other.
        let products = numbers.windows(2).map(|pair| pair[0] * pair[1]);
        let correlation = products.sum::<f64>() / COUNT as f64;
        assert!(correlation.abs() < 4.0 / (COUNT as f64).sqrt());
    }

    #[test]
    fn uniform_numbers_fill_their_interval_evenly() {
        let mut random = Random::new(2, 3);
        let mut tenths = [0; 10];
        for _ in 0..COUNT {
            tenths[(10.0 * random.uniform()) as usize] += 1;
        }
        for found in tenths {
            assert_share(found, 0.1, "a tenth");
        }
    }

    #[test]
    fn a_stream_is_seeded_by_the_split_mix_number_of_its_place() {
        let mut seeds = SplitMix64::seed_from_u64(9);
        for stream in 0..100 {
            let expected = Xoshiro256PlusPlus::seed_from_u64(seeds.next_u64());
            assert_eq!(Random::new(9, stream).0, expected);
        }
    }

    #[test]
    fn streams_of_a_seed_are_repeated_and_differ() {
        let numbers = |seed, stream| {
            let mut random = Random::new(seed, stream);
            [random.normal(), random.normal()]
        };
        assert_eq!(numbers(7, 1), numbers(7, 1));
        assert_ne!(numbers(7, 1), numbers(7, 2));
        assert_ne!(numbers(7, 1), numbers(8, 1));
        assert_ne!(numbers(7, 1), numbers(8, 0));
    }
}
