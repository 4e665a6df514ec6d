//! Pushes: what acts on the plant besides its input.

use nalgebra::SVector;

/// A push at a known time. `NX` states; loads of `NL` components, as the plant defines them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Disturbance<const NX: usize, const NL: usize> {
    /// The state jumps: a collision, or a new start.
    Jump {
        /// When, s.
        time: f64,
        /// Added to the state, in state units.
        change: SVector<f64, NX>,
    },
    /// A load so short that only its integral counts.
    Impulse {
        /// When, s.
        time: f64,
        /// The load's integral over time, load units times s.
        impulse: SVector<f64, NL>,
    },
    /// A constant load for a while.
    Load {
        /// From when on, s.
        from: f64,
        /// Until when, s; infinite for ever.
        until: f64,
        /// The load.
        load: SVector<f64, NL>,
    },
}

impl<const NX: usize, const NL: usize> Disturbance<NX, NL> {
    /// The times at which it changes something, s.
    pub(crate) fn times(&self) -> [f64; 2] {
        match *self {
            Self::Jump { time, .. } | Self::Impulse { time, .. } => [time, time],
            Self::Load { from, until, .. } => [from, until],
        }
    }

    /// Whether all its numbers make sense.
    pub(crate) fn is_valid(&self) -> bool {
        let [from, until] = self.times();
        from.is_finite()
            && from <= until
            && match self {
                Self::Jump { change, .. } => change.iter().all(|entry| entry.is_finite()),
                Self::Impulse { impulse: load, .. } | Self::Load { load, .. } => {
                    load.iter().all(|entry| entry.is_finite())
                }
            }
    }
}
