//! The measured state itself as the state that is decided for.

use super::Measurement;
use crate::clock::{Clock, Tick};
use crate::estimator::{Observation, Restart, Verdict};
use crate::model::Scalar;
use nalgebra::SVector;

/// All `NX` states as they were measured last, zero before the first reading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeasuredState<T, const NX: usize> {
    x: SVector<T, NX>,
    clock: Clock,
}

impl<T: Scalar, const NX: usize> MeasuredState<T, NX> {
    /// Nothing was measured yet.
    pub fn new() -> Self {
        Self {
            x: SVector::zeros(),
            clock: Clock::default(),
        }
    }

    /// What was known at a time (s), if anything was.
    pub fn known(x: SVector<T, NX>, time: Option<f64>) -> Self {
        let mut clock = Clock::default();
        if let Some(time) = time {
            clock.tick::<T>(time);
        }
        Self { x, clock }
    }

    /// The state. A reading that was no number stands in it, so that nothing is decided for it.
    pub fn state(&self) -> &SVector<T, NX> {
        &self.x
    }

    /// Stamp of the last measurement, s; `None` before the first.
    pub fn time(&self) -> Option<f64> {
        self.clock.now()
    }

    /// Takes in readings of the first states, all of them as a rule. A reading that is missing
    /// keeps its last value. Returns the time since the last measurement (s), zero if that is not
    /// known, and what became of the readings; one whose stamp is NaN changes nothing.
    pub fn observe<const NY: usize>(
        &mut self,
        measurement: &Measurement<T, NY>,
    ) -> (T, Observation<NY>) {
        let (elapsed, restart) = match self.clock.tick(measurement.t) {
            Tick::First => (T::zero(), Some(Restart::Start)),
            Tick::Elapsed(elapsed) => (elapsed, None),
            Tick::Backward(_) => {
                self.clock.reset();
                self.clock.tick::<T>(measurement.t);
                (T::zero(), Some(Restart::ClockSetBack))
            }
            Tick::NotFinite => {
                let refused = Observation::refused(&measurement.readings, Verdict::NotFinite);
                return (T::zero(), refused);
            }
        };
        let mut verdicts = [Verdict::Missing; NY];
        let places = self.x.iter_mut().zip(&mut verdicts);
        for ((x, verdict), reading) in places.zip(&measurement.readings) {
            if let Some(reading) = reading {
                *x = reading.value;
                *verdict = match reading.value.is_finite() {
                    true => Verdict::Used,
                    false => Verdict::NotFinite,
                };
            }
        }
        (elapsed, Observation { verdicts, restart })
    }
}

impl<T: Scalar, const NX: usize> Default for MeasuredState<T, NX> {
    fn default() -> Self {
        Self::new()
    }
}
