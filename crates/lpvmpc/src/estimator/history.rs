//! The recent past of an estimate: enough to go through it again with a reading that comes late.

use super::Covariance;
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
    fn new(prior: Option<Estimate<T, NX, ND>>) -> Self {
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

/// The last instants, at most `K`, in a ring.
#[derive(Clone, Debug)]
pub(super) struct History<
    T,
    const NX: usize,
    const NU: usize,
    const NY: usize,
    const ND: usize,
    const K: usize,
> {
    ring: [Instant<T, NX, NU, NY, ND>; K],
    /// The place of the oldest.
    start: usize,
    length: usize,
}

impl<T, const NX: usize, const NU: usize, const NY: usize, const ND: usize, const K: usize>
    History<T, NX, NU, NY, ND, K>
where
    T: Scalar,
{
    /// A past of one instant, which is now.
    pub(super) fn new(now: Estimate<T, NX, ND>) -> Self {
        const { assert!(K > 0, "the present is an instant, too") };
        Self {
            ring: [Instant::new(Some(now)); K],
            start: 0,
            length: 1,
        }
    }

    pub(super) fn len(&self) -> usize {
        self.length
    }

    /// The instant `i`, from the oldest.
    pub(super) fn get(&self, i: usize) -> Option<&Instant<T, NX, NU, NY, ND>> {
        (i < self.length).then(|| self.ring.get((self.start + i) % K))?
    }

    pub(super) fn get_mut(&mut self, i: usize) -> Option<&mut Instant<T, NX, NU, NY, ND>> {
        (i < self.length).then(|| self.ring.get_mut((self.start + i) % K))?
    }

    /// The input `u` acted for `duration` s, and the estimate is `prior` now.
    pub(super) fn advance(&mut self, u: &SVector<T, NU>, duration: T, prior: Estimate<T, NX, ND>) {
        if let Some(last) = self.get_mut(self.length - 1) {
            (last.u, last.duration) = (*u, duration);
        }
        if self.length == K {
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
        if self.length == K {
            // Without the instant before it, the new one could not be reached.
            place = place.checked_sub(1)?;
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
        self.start = (self.start + 1) % K;
        self.length -= 1;
    }
}
