//! Time by the stamps of the measurements.

use crate::model::Scalar;
use nalgebra::convert;

/// The time from one measurement to the next, by their stamps.
///
/// A stamp is an `f64` in seconds since anything, whatever number the controller calculates with:
/// Unix time (1.8e9 s) is resolved to 0.24 us, where an `f32` would know it to 128 s. Only
/// differences of stamps become a `T`. Time begins with the first stamp.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Clock {
    last: Option<f64>,
}

/// What a stamp says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tick<T> {
    /// It is the first one: no time has passed that is known of.
    First,
    /// The time since the last one, s, not negative.
    Elapsed(T),
    /// It lies before the last one by so many seconds: out of order, or of another clock.
    Backward(T),
    /// It is not a finite number.
    NotFinite,
}

impl Clock {
    /// Takes in a stamp, s. The clock goes on from it, unless it lies before the last one or is
    /// not finite.
    pub fn tick<T: Scalar>(&mut self, stamp: f64) -> Tick<T> {
        if !stamp.is_finite() {
            return Tick::NotFinite;
        }
        let tick = match self.last {
            None => Tick::First,
            Some(last) if stamp >= last => Tick::Elapsed(convert(stamp - last)),
            Some(last) => return Tick::Backward(convert(last - stamp)),
        };
        self.last = Some(stamp);
        tick
    }

    /// The last stamp that it went on from, s; `None` before the first.
    pub fn now(&self) -> Option<f64> {
        self.last
    }

    /// Forgets the stamps: the next one is the first.
    pub fn reset(&mut self) {
        self.last = None;
    }
}
