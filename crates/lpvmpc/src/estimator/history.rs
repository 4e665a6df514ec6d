//! The recent past of an estimate: enough to go through it again with a reading that comes late.

use super::Covariance;
use crate::list::List;
use crate::model::Scalar;
use nalgebra::SVector;

/// State, disturbance and their covariance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Estimate<T, const NX: usize, const ND: usize> {
    /// x + E_x d.
    pub(super) z: SVector<T, NX>,
    pub(super) d: SVector<T, ND>,
    pub(super) covariance: Covariance<T, NX, ND>,
}

impl<T: Scalar, const NX: usize, const ND: usize> Estimate<T, NX, ND> {
    pub(super) fn is_finite(&self) -> bool {
        let Covariance { zz, dd, .. } = &self.covariance;
        let mut entries = self.z.iter().chain(&self.d).chain(zz).chain(dd);
        entries.all(|entry| entry.is_finite())
    }
}

/// A reading at the instant when it was taken.
#[derive(Clone, Copy, Debug)]
pub(super) struct Taken<T> {
    pub(super) value: T,
    pub(super) trust: Trust,
}

/// How a reading is taken in whenever its instant is gone through.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Trust {
    /// It has just come, and has to be judged.
    New,
    /// As it is.
    Plain,
    /// After the state's variance was raised.
    AfterBlow,
}

/// An instant of the past, and the input from there to the next one.
#[derive(Clone, Copy, Debug)]
pub(super) struct Instant<T, const NX: usize, const NU: usize, const NY: usize, const ND: usize> {
    /// The estimate from the readings of all instants before; `None` where it has to be found by
    /// going through the past again.
    pub(super) prior: Option<Estimate<T, NX, ND>>,
    pub(super) readings: [Option<Taken<T>>; NY],
    pub(super) u: SVector<T, NU>,
    /// Time to the next instant, s; zero at the last one, which is now.
    pub(super) duration: T,
}

impl<T: Scalar, const NX: usize, const NU: usize, const NY: usize, const ND: usize>
    Instant<T, NX, NU, NY, ND>
{
    pub(super) fn new(prior: Option<Estimate<T, NX, ND>>) -> Self {
        Self {
            prior,
            readings: [None; NY],
            u: SVector::zeros(),
            duration: T::zero(),
        }
    }

    pub(super) fn has_news(&self) -> bool {
        let readings = self.readings.iter().flatten();
        readings.into_iter().any(|taken| taken.trust == Trust::New)
    }
}

/// The last instants in a ring.
#[derive(Debug)]
#[cfg_attr(feature = "alloc", derive(Clone))]
pub(super) struct History<
    T: 'static,
    const NX: usize,
    const NU: usize,
    const NY: usize,
    const ND: usize,
> {
    ring: List<Instant<T, NX, NU, NY, ND>>,
    /// The place of the oldest.
    start: usize,
    length: usize,
}

impl<T, const NX: usize, const NU: usize, const NY: usize, const ND: usize>
    History<T, NX, NU, NY, ND>
where
    T: Scalar,
{
    /// A past of one instant, which is now, in a `ring` with places for one at least.
    pub(super) fn new(ring: List<Instant<T, NX, NU, NY, ND>>, now: Estimate<T, NX, ND>) -> Self {
        let mut history = Self {
            ring,
            start: 0,
            length: 1,
        };
        history.begin(now);
        history
    }

    /// Forgets the past: there is one instant, which is now.
    pub(super) fn begin(&mut self, now: Estimate<T, NX, ND>) {
        (self.start, self.length) = (0, 1);
        if let Some(first) = self.ring.first_mut() {
            *first = Instant::new(Some(now));
        }
    }

    /// The past of another history, as far back as there are places for.
    pub(super) fn copy_from(&mut self, other: &Self) {
        let forgotten = other.length.saturating_sub(self.ring.len());
        (self.start, self.length) = (0, other.length - forgotten);
        for (i, place) in self.ring.iter_mut().take(self.length).enumerate() {
            if let Some(instant) = other.get(forgotten + i) {
                *place = *instant;
            }
        }
    }

    /// Where the instant `i`, from the oldest, is in the ring.
    fn place(&self, i: usize) -> Option<usize> {
        let place = self.start + i;
        let beyond = place.checked_sub(self.ring.len());
        (i < self.length).then(|| beyond.unwrap_or(place))
    }

    pub(super) fn len(&self) -> usize {
        self.length
    }

    /// The instant `i`, from the oldest.
    pub(super) fn get(&self, i: usize) -> Option<&Instant<T, NX, NU, NY, ND>> {
        self.ring.get(self.place(i)?)
    }

    pub(super) fn get_mut(&mut self, i: usize) -> Option<&mut Instant<T, NX, NU, NY, ND>> {
        let place = self.place(i)?;
        self.ring.get_mut(place)
    }

    /// The input `u` acted for `duration` s, and the estimate is `prior` now.
    pub(super) fn advance(&mut self, u: &SVector<T, NU>, duration: T, prior: Estimate<T, NX, ND>) {
        if let Some(last) = self.get_mut(self.length - 1) {
            (last.u, last.duration) = (*u, duration);
        }
        if self.length == self.ring.len() {
            self.forget_oldest();
        }
        self.length += 1;
        if let Some(now) = self.get_mut(self.length - 1) {
            *now = Instant::new(Some(prior));
        }
    }

    /// The instant `age` s ago, made where there is none; instants closer to each other than
    /// `resolution` s are one. `None` if it is too long ago.
    pub(super) fn at(&mut self, age: T, resolution: T) -> Option<usize> {
        let mut place = self.length - 1;
        let mut ago = T::zero();
        while age > ago + resolution {
            place = place.checked_sub(1)?;
            ago += self.get(place)?.duration;
        }
        if age >= ago - resolution || place + 1 == self.length {
            return Some(place);
        }
        self.split(place, ago - age)
    }

    /// Makes an instant `after` s after the instant `place`, before the next one.
    fn split(&mut self, mut place: usize, after: T) -> Option<usize> {
        if self.length == self.ring.len() {
            // Without the instant before it, the new one could not be reached.
            place = place.checked_sub(1)?;
            // Nor without a prior to begin with; and news must not be forgotten before they were taken in.
            self.get(1)?.prior.as_ref()?;
            if self.get(0)?.has_news() {
                return None;
            }
            self.forget_oldest();
        }
        let before = self.get_mut(place)?;
        let rest = before.duration - after;
        before.duration = after;
        let u = before.u;
        self.length += 1;
        for i in (place + 2..self.length).rev() {
            let moved = *self.get(i - 1)?;
            *self.get_mut(i)? = moved;
        }
        *self.get_mut(place + 1)? = Instant {
            u,
            duration: rest,
            ..Instant::new(None)
        };
        Some(place + 1)
    }

    /// The first instant that has to be gone through again, with one whose prior is known; `None`
    /// without news.
    pub(super) fn first_with_news(&self) -> Option<usize> {
        let instant = |i: &usize| self.get(*i);
        let news = (0..self.length).find(|i| instant(i).is_some_and(Instant::has_news))?;
        (0..=news)
            .rev()
            .find(|i| instant(i).is_some_and(|found| found.prior.is_some()))
    }

    fn forget_oldest(&mut self) {
        self.start = self.place(1).unwrap_or(0);
        self.length -= 1;
    }
}
