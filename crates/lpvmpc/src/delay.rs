//! Inputs on their way to the plant: what acts now, and what will.

use crate::list::List;
use crate::model::Scalar;
use nalgebra::{SVector, try_convert};

/// The inputs that have been commanded and what is left of their delay.
///
/// How many places it needs, [`DelayLine::places`] says. When there is no room, the oldest input is forgotten.
#[derive(Debug)]
#[cfg_attr(feature = "alloc", derive(Clone))]
pub struct DelayLine<T: 'static, const NU: usize> {
    /// Time until it acts, s (negative: acts already), and the input; in this order.
    inputs: List<(T, SVector<T, NU>)>,
    length: usize,
}

impl<T: Scalar, const NU: usize> DelayLine<T, NU> {
    /// Nothing was commanded, so the input is zero. What `memory` contains does not matter.
    pub fn new(memory: List<(T, SVector<T, NU>)>) -> Self {
        Self {
            inputs: memory,
            length: 0,
        }
    }

    /// The same with memory of its own, for so many `commands`.
    #[cfg(feature = "alloc")]
    pub fn allocate(commands: usize) -> Self {
        Self::new(List::repeat((T::zero(), SVector::zeros()), commands))
    }

    /// Places for the inputs that are on their way at once with this delay, s, and a command every `interval` s: one more acts,
    /// and one is new. Of more than a million, which no plant waits for, the oldest are forgotten.
    pub fn places(delay: T, interval: T) -> usize {
        const ROUNDING: usize = 1;
        const MOST: f64 = 1e6;
        let count = try_convert::<T, f64>((delay / interval).ceil());
        // An input whose delay is infinite never acts.
        let count = count.filter(|count| count.is_finite());
        count.map_or(0, |count| count.min(MOST) as usize) + 2 + ROUNDING
    }

    /// Takes over the inputs of another line, the last ones if there are not places for all.
    pub fn copy_from(&mut self, other: &Self) {
        let forgotten = other.length.saturating_sub(self.inputs.len());
        self.length = other.length - forgotten;
        let inputs = other.inputs.iter().skip(forgotten).take(self.length);
        for (place, input) in self.inputs.iter_mut().zip(inputs) {
            *place = *input;
        }
    }

    /// The input `u` will act from `delay` s on.
    pub fn command(&mut self, u: SVector<T, NU>, delay: T) {
        if self.length == self.inputs.len() {
            self.forget_oldest();
        }
        if let Some(place) = self.inputs.get_mut(self.length) {
            *place = (delay, u);
            self.length += 1;
        }
    }

    /// The last input that was commanded is `u` in truth; where none was, `u` acts already.
    pub fn correct(&mut self, u: SVector<T, NU>) {
        match self.length.checked_sub(1) {
            Some(last) => {
                if let Some((_, input)) = self.inputs.get_mut(last) {
                    *input = u;
                }
            }
            None => self.command(u, T::zero()),
        }
    }

    /// Forgets all inputs: as new.
    pub fn clear(&mut self) {
        self.length = 0;
    }

    /// The input that acts now.
    pub(crate) fn acting(&self) -> SVector<T, NU> {
        let inputs = self.inputs.iter().take(self.length);
        let begun = inputs.take_while(|(time, _)| *time <= T::zero());
        begun.last().map_or_else(SVector::zeros, |(_, u)| *u)
    }

    /// Time goes on by `duration` s.
    pub fn elapse(&mut self, duration: T) {
        for (time, _) in self.inputs.iter_mut().take(self.length) {
            *time -= duration;
        }
        // The second one acts already, so the first one does no more.
        while self.length > 1
            && self
                .inputs
                .get(1)
                .is_some_and(|(time, _)| *time <= T::zero())
        {
            self.forget_oldest();
        }
    }

    /// Calls `visit(seconds, u)` for every stretch of constant input within the next `duration`
    /// s, in order.
    pub fn for_each(&self, duration: T, mut visit: impl FnMut(T, &SVector<T, NU>)) {
        let mut acting = SVector::zeros();
        let mut now = T::zero();
        for (time, u) in self.inputs.iter().take(self.length) {
            let until = if *time < duration { *time } else { duration };
            if until > now {
                visit(until - now, &acting);
                now = until;
            }
            acting = *u;
            if *time >= duration {
                return;
            }
        }
        if duration > now {
            visit(duration - now, &acting);
        }
    }

    fn forget_oldest(&mut self) {
        for i in 1..self.length {
            let next = self.inputs.get(i).copied();
            if let (Some(place), Some(next)) = (self.inputs.get_mut(i - 1), next) {
                *place = next;
            }
        }
        self.length = self.length.saturating_sub(1);
    }
}
