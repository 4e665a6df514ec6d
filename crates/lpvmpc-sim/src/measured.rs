//! The measured state itself as the state that is decided for.

use crate::sensor::Measurement;
use lpvmpc::{Clock, Observation, Restart, Tick, Verdict};
use nalgebra::SVector;

/// All `NX` states as they were measured last, zero before the first reading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeasuredState<const NX: usize> {
    x: SVector<f64, NX>,
    clock: Clock,
}

impl<const NX: usize> MeasuredState<NX> {
    /// Nothing was measured yet.
    pub fn new() -> Self {
        Self {
            x: SVector::zeros(),
            clock: Clock::default(),
        }
    }

    /// What was known at a time (s), if anything was.
    pub fn known(x: SVector<f64, NX>, time: Option<f64>) -> Self {
        let mut clock = Clock::default();
        if let Some(time) = time {
            clock.tick::<f64>(time);
        }
        Self { x, clock }
    }

    /// The state. A reading that was no number stands in it, so that nothing is decided for it.
    pub fn state(&self) -> &SVector<f64, NX> {
        &self.x
    }

    /// Stamp of the last measurement, s; `None` before the first.
    pub fn time(&self) -> Option<f64> {
        self.clock.now()
    }

    /// Takes in a measurement. A reading that is missing keeps its last value. Returns the time
    /// since the last one (s), zero if that is not known, and what became of the readings; one
    /// whose stamp is no number changes nothing.
    pub fn observe(&mut self, measurement: &Measurement<NX>) -> (f64, Observation<NX>) {
        let (elapsed, restart) = match self.clock.tick(measurement.t) {
            Tick::First => (0.0, Some(Restart::Start)),
            Tick::Elapsed(elapsed) => (elapsed, None),
            Tick::Backward(_) => {
                self.clock.reset();
                self.clock.tick::<f64>(measurement.t);
                (0.0, Some(Restart::ClockSetBack))
            }
            Tick::NotFinite => {
                let verdicts = measurement.values.map(|value| match value {
                    Some(_) => Verdict::NotFinite,
                    None => Verdict::Missing,
                });
                return (
                    0.0,
                    Observation {
                        verdicts,
                        restart: None,
                    },
                );
            }
        };
        let mut verdicts = [Verdict::Missing; NX];
        let places = self.x.iter_mut().zip(&mut verdicts);
        for ((x, verdict), value) in places.zip(measurement.values) {
            if let Some(value) = value {
                *x = value;
                *verdict = match value.is_finite() {
                    true => Verdict::Used,
                    false => Verdict::NotFinite,
                };
            }
        }
        (elapsed, Observation { verdicts, restart })
    }
}

impl<const NX: usize> Default for MeasuredState<NX> {
    fn default() -> Self {
        Self::new()
    }
}
