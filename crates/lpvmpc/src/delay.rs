//! Inputs on their way to the plant: what acts now, and what will.

use crate::model::Scalar;
use nalgebra::SVector;

/// The inputs that have been commanded and what is left of their delay, at most `K` of them.
///
/// With a delay of d and a command every t_s, `K` must be at least d / t_s + 2. When there is no
/// room, the oldest input is forgotten.
#[derive(Clone, Debug, PartialEq)]
pub struct DelayLine<T, const NU: usize, const K: usize> {
    /// Time until it acts, s (negative: acts already), and the input; in this order.
    inputs: [(T, SVector<T, NU>); K],
    length: usize,
}

impl<T: Scalar, const NU: usize, const K: usize> Default for DelayLine<T, NU, K> {
    /// Nothing was commanded: the input is zero.
    fn default() -> Self {
        Self {
            inputs: [(T::zero(), SVector::zeros()); K],
            length: 0,
        }
    }
}

impl<T: Scalar, const NU: usize, const K: usize> DelayLine<T, NU, K> {
    /// The input `u` will act from `delay` s on.
    pub fn command(&mut self, u: SVector<T, NU>, delay: T) {
        if self.length == K {
            self.forget_oldest();
        }
        if let Some(place) = self.inputs.get_mut(self.length) {
            *place = (delay, u);
            self.length += 1;
        }
    }

    /// Time goes on by `duration` s.
    pub fn elapse(&mut self, duration: T) {
        for (time, _) in &mut self.inputs {
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
        self.inputs.copy_within(K.min(1).., 0);
        self.length = self.length.saturating_sub(1);
    }
}
