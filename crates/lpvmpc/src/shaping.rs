//! Steps made feasible: smooth moves within limits of speed and acceleration.

use crate::model::Scalar;
use nalgebra::convert;

/// Position, speed and acceleration at an instant, in a unit, per s and per s^2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion<T> {
    /// Position.
    pub position: T,
    /// Speed, per s.
    pub speed: T,
    /// Acceleration, per s^2.
    pub acceleration: T,
}

/// The most that a move may ask for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MoveLimits<T> {
    /// Largest speed, per s, positive.
    pub speed: T,
    /// Largest acceleration, per s^2, positive.
    pub acceleration: T,
}

/// A move from rest to rest with the least jerk (Flash and Hogan 1985).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SmoothMove<T> {
    /// Where it begins.
    pub from: T,
    /// Where it ends.
    pub to: T,
    /// How long it takes, s; a move that takes no time is over at once.
    pub duration: T,
}

/// Largest speed over distance/duration: 15/8.
const PEAK_SPEED: f64 = 1.875;
/// Largest acceleration over distance/duration^2: 10/sqrt(3).
const PEAK_ACCELERATION: f64 = 5.773_502_691_896_258;

impl<T: Scalar> SmoothMove<T> {
    /// The shortest such move within `limits`.
    pub fn within(from: T, to: T, limits: MoveLimits<T>) -> Self {
        let distance = (to - from).abs();
        let by_speed = distance * convert(PEAK_SPEED) / limits.speed;
        let by_acceleration = (distance * convert(PEAK_ACCELERATION) / limits.acceleration).sqrt();
        Self {
            from,
            to,
            duration: by_speed.max(by_acceleration),
        }
    }

    /// Where it is `t` s after its beginning; at rest before and after.
    pub fn at(&self, t: T) -> Motion<T> {
        let zero = T::zero();
        let rest = |position| Motion {
            position,
            speed: zero,
            acceleration: zero,
        };
        // Negated, so that a move without duration is over.
        if !(t < self.duration) {
            return rest(self.to);
        }
        if !(t > zero) {
            return rest(self.from);
        }
        let [six, ten, fifteen] = [6.0, 10.0, 15.0].map(convert::<f64, T>);
        let [two, thirty, sixty] = [2.0, 30.0, 60.0].map(convert::<f64, T>);
        let (s, distance) = (t / self.duration, self.to - self.from);
        let left = T::one() - s;
        let pace = distance / self.duration;
        Motion {
            position: self.from + distance * (s * s * s * (ten + s * (six * s - fifteen))),
            speed: pace * thirty * s * s * left * left,
            acceleration: pace / self.duration * sixty * s * left * (T::one() - two * s),
        }
    }
}
