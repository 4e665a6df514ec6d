//! What a plan is aimed at: the wanted set points along the horizon.

use crate::model::Scalar;
use nalgebra::convert;

/// The wanted set points along the horizon, any numbers, reachable or not; those beyond its end are
/// expected to be the last one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SetPoints<T, const N: usize> {
    /// Those at the stages 0 to N - 1.
    pub stages: [T; N],
    /// That at the end of the horizon, and beyond.
    pub end: T,
}

impl<T: Scalar, const N: usize> SetPoints<T, N> {
    /// The same set point at every stage.
    pub fn constant(wanted: T) -> Self {
        Self {
            stages: [wanted; N],
            end: wanted,
        }
    }

    /// All of them numbers within `limits`; what is NaN repeats the one before, the first `last`.
    pub(super) fn clamped(&self, last: T, [lower, upper]: [T; 2]) -> Self {
        let mut before = last;
        let mut clamp = |wanted: T| {
            // What is infinite has a nearest admissible neighbour; NaN is ordered with nothing.
            if wanted >= lower || wanted <= upper {
                before = wanted.max(lower).min(upper);
            }
            before
        };
        Self {
            stages: self.stages.map(&mut clamp),
            end: clamp(self.end),
        }
    }

    /// How many of the first `horizon` stages come before the set points' last change.
    pub(super) fn before_last_change(&self, horizon: usize) -> usize {
        let stages = self.stages.iter().take(horizon);
        let changed = stages
            .enumerate()
            .filter(|(_, wanted)| **wanted != self.end);
        changed.last().map_or(0, |(i, _)| i + 1)
    }
}

/// The farthest set point whose distance, squared, still tells a move by `extent`.
pub(super) fn farthest<T: Scalar>(extent: T) -> T {
    extent / T::default_epsilon().powf(convert(0.5))
}
