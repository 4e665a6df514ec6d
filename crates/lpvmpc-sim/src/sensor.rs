//! What a sensor makes of the state: bias, noise, quantisation, missing, late and stale samples.

use crate::random::Random;
use nalgebra::SVector;
use std::collections::VecDeque;

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
    /// It measures at every `every`-th sample of the world, at least 1.
    pub every: usize,
    /// What it measures is delivered so many samples of the world later.
    pub late: usize,
    /// Probability from 0 to 1 that it delivers its last reading again, as a sensor or a bus does
    /// that hangs.
    pub stale: f64,
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
            late: 0,
            stale: 0.0,
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

    /// Its reading of a `quantity`, with a standard normal `noise`.
    fn reading(&self, quantity: f64, noise: f64) -> f64 {
        let value = quantity + self.bias + self.noise * noise;
        if self.resolution > 0.0 {
            (value / self.resolution).round() * self.resolution
        } else {
            value
        }
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
        } else if !(0.0..=1.0 - self.dropout).contains(&self.stale) {
            Some((
                "stale",
                self.stale,
                "it must be a probability that leaves room for that of a missing sample",
            ))
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
    random: Random,
    /// Measured, and not delivered yet: one entry per sample of the world.
    travelling: VecDeque<Option<f64>>,
    /// The reading that was delivered last, and the sample at which it was taken.
    last: Option<(f64, u64)>,
}

impl<const NX: usize> Channel<NX> {
    pub(crate) fn new(sensor: Sensor<NX>, seed: u64, index: usize) -> Self {
        Self {
            sensor,
            random: Random::new(seed, index),
            travelling: VecDeque::new(),
            last: None,
        }
    }

    /// Goes on with the noise, and with the readings, of the channel `before`.
    pub(crate) fn go_on_from(&mut self, before: &Self, noise: bool, readings: bool) {
        if noise {
            self.random = before.random.clone();
        }
        if readings {
            self.last = before.last;
            // What would have arrived later than it does now, has not come in time.
            let surplus = before.travelling.len().saturating_sub(self.sensor.late);
            self.travelling = before.travelling.iter().skip(surplus).copied().collect();
        }
    }

    /// What is delivered at the world's sample `k`, when the state is `x` and what is measured `other` than the row of
    /// it, if it is: a reading and its age in samples.
    pub(crate) fn read(
        &mut self,
        x: &SVector<f64, NX>,
        other: Option<f64>,
        k: u64,
    ) -> Option<(f64, u64)> {
        // Drawn in any case, so that a run with dropouts has the noise of the run without.
        let noise = self.random.normal();
        let chance = self.random.uniform();
        let Sensor {
            dropout,
            every,
            late,
            stale,
            ..
        } = self.sensor;
        let measures = chance >= dropout && k.is_multiple_of(every as u64);
        let quantity = other.unwrap_or_else(|| self.sensor.row.dot(x));
        self.travelling
            .push_back(measures.then(|| self.sensor.reading(quantity, noise)));
        let arrived = if self.travelling.len() > late {
            self.travelling.pop_front().flatten()
        } else {
            None
        };
        let hangs = (dropout..dropout + stale).contains(&chance);
        if !hangs {
            let value = arrived?;
            self.last = Some((value, k - late as u64));
        }
        self.last.map(|(value, taken)| (value, k - taken))
    }
}
