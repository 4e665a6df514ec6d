//! What a plan is aimed at: the wanted set points along the horizon.

use crate::list::List;
use crate::model::Scalar;
use nalgebra::convert;

/// The wanted set points along the horizon, any numbers, reachable or not.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SetPoints<'a, T> {
    /// Those at the stages from 0 on; from where they end, `end`.
    pub stages: &'a [T],
    /// That at the end of the horizon, and beyond.
    pub end: T,
}

impl<T: Scalar> SetPoints<'_, T> {
    /// The same set point at every stage.
    pub fn constant(wanted: T) -> Self {
        Self {
            stages: &[],
            end: wanted,
        }
    }
}

/// Admissible set points, as many as the horizon has samples.
#[derive(Debug)]
#[cfg_attr(feature = "alloc", derive(Clone))]
pub(super) struct Aims<T: 'static> {
    /// Those at the stages 0 to N - 1.
    pub stages: List<T>,
    /// That at the end of the horizon, and beyond.
    pub end: T,
    /// How many of the stages come before the last change.
    pub changes: usize,
}

impl<T: Scalar> Aims<T> {
    pub fn new(stages: List<T>) -> Self {
        Self {
            stages,
            end: T::zero(),
            changes: 0,
        }
    }

    /// Takes over what is `wanted`, as numbers within the limits; what is NaN repeats the one before, the
    /// first `last`.
    pub fn take(&mut self, wanted: &SetPoints<'_, T>, last: T, [lower, upper]: [T; 2]) {
        let mut before = last;
        let mut clamp = |wanted: T| {
            // What is infinite has a nearest admissible neighbour; NaN is ordered with nothing.
            if wanted >= lower || wanted <= upper {
                before = wanted.max(lower).min(upper);
            }
            before
        };
        for (i, place) in self.stages.iter_mut().enumerate() {
            *place = clamp(wanted.stages.get(i).copied().unwrap_or(wanted.end));
        }
        self.end = clamp(wanted.end);
        let end = self.end;
        let last_change = self.stages.iter().rposition(|aim| *aim != end);
        self.changes = last_change.map_or(0, |i| i + 1);
    }

    /// Aims at `set_point` alone; the answer is what [`Aims::go_on`] takes back.
    pub fn stay(&mut self, set_point: T) -> (T, usize) {
        let before = (self.end, self.changes);
        (self.end, self.changes) = (set_point, 0);
        before
    }

    /// Aims at what was aimed at `before`.
    pub fn go_on(&mut self, before: (T, usize)) {
        (self.end, self.changes) = before;
    }
}

/// The farthest set point whose distance, squared, still tells a move by `extent`.
pub(super) fn farthest<T: Scalar>(extent: T) -> T {
    extent / T::default_epsilon().powf(convert(0.5))
}
