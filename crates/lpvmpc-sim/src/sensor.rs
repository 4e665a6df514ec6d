//! What a sensor makes of the state: bias, noise, quantisation, missing samples.

use nalgebra::SVector;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal, StandardUniform};

/// One measured quantity: a linear combination of the states, and what is wrong with it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensor<const NX: usize> {
    /// The measured quantity is `row`' x; a unit vector for a state itself.
    pub row: SVector<f64, NX>,
    /// Standard deviation of the white Gaussian noise of a sample, in the quantity's unit.
    pub noise: f64,
    /// Constant error that is added, in the quantity's unit.
    pub bias: f64,
    /// Step between two readings, in the quantity's unit; 0 for a continuous reading.
    pub resolution: f64,
    /// Probability from 0 to 1 that a sample is missing.
    pub dropout: f64,
    /// It delivers every `every`-th sample of the world, at least 1.
    pub every: usize,
}

/// What the sensors deliver at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measurement<const NY: usize> {
    /// Time of the measurement, s.
    pub t: f64,
    /// The readings, in the units of the measured quantities; `None` where one is missing.
    pub values: [Option<f64>; NY],
}

impl<const NX: usize> Sensor<NX> {
    /// A perfect sensor of `row`' x.
    pub fn ideal(row: SVector<f64, NX>) -> Self {
        Self {
            row,
            noise: 0.0,
            bias: 0.0,
            resolution: 0.0,
            dropout: 0.0,
            every: 1,
        }
    }

    /// Perfect sensors of all states, in their order.
    pub fn ideal_states() -> [Self; NX] {
        std::array::from_fn(|i| {
            let mut row = SVector::zeros();
            row[i] = 1.0;
            Self::ideal(row)
        })
    }

    /// What makes no sense about it: the quantity, its value, and what would be right.
    pub(crate) fn mistake(&self) -> Option<(&'static str, f64, &'static str)> {
        let size = |value: f64| value.is_finite() && value >= 0.0;
        let sizes = "it must be finite and not negative";
        if let Some(entry) = self.row.iter().find(|entry| !entry.is_finite()) {
            Some(("row", *entry, "its entries must be finite"))
        } else if !size(self.noise) {
            Some(("noise", self.noise, sizes))
        } else if !self.bias.is_finite() {
            Some(("bias", self.bias, "it must be finite"))
        } else if !size(self.resolution) {
            Some(("resolution", self.resolution, sizes))
        } else if !(0.0..=1.0).contains(&self.dropout) {
            Some(("dropout", self.dropout, "it must be a probability, 0 to 1"))
        } else if self.every == 0 {
            Some(("every", 0.0, "it must be at least 1"))
        } else {
            None
        }
    }
}

/// A sensor at work, with a random stream of its own: what is set for one sensor leaves the
/// noise of the others as it was.
#[derive(Clone, Debug)]
pub(crate) struct Channel<const NX: usize> {
    sensor: Sensor<NX>,
    random: ChaCha8Rng,
}

impl<const NX: usize> Channel<NX> {
    pub(crate) fn new(sensor: Sensor<NX>, seed: u64, index: usize) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(index as u64);
        Self { sensor, random }
    }

    /// The reading of the state `x` at the world's sample `k`.
    pub(crate) fn read(&mut self, x: &SVector<f64, NX>, k: u64) -> Option<f64> {
        // Drawn in any case, so that a run with dropouts has the noise of the run without.
        let noise: f64 = StandardNormal.sample(&mut self.random);
        let chance: f64 = StandardUniform.sample(&mut self.random);
        let Sensor {
            row,
            bias,
            resolution,
            dropout,
            every,
            ..
        } = &self.sensor;
        if chance < *dropout || !k.is_multiple_of(*every as u64) {
            return None;
        }
        let value = row.dot(x) + bias + self.sensor.noise * noise;
        Some(if *resolution > 0.0 {
            (value / resolution).round() * resolution
        } else {
            value
        })
    }
}
