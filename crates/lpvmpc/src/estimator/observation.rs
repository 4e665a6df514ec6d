//! What became of a measurement.

use super::settings::{Gate, Reading};
use crate::model::Scalar;

/// What became of a reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// It has corrected the estimate.
    Used,
    /// It has corrected the estimate after the state's variance was raised: after several outliers
    /// in a row, or when it is the first one of its sensor.
    UsedAfterBlow,
    /// There was none.
    Missing,
    /// Whoever observes does without this sensor.
    NotNeeded,
    /// It is not a finite number, or its stamp is not.
    NotFinite,
    /// It was too old, or came out of order.
    Stale,
    /// A reading of this sensor from the same instant was used before: a sensor or a bus hangs.
    Repeated,
    /// It was too far from the prediction.
    Outlier,
}

impl Verdict {
    /// Whether the reading has corrected the estimate.
    pub fn is_used(self) -> bool {
        matches!(self, Self::Used | Self::UsedAfterBlow)
    }
}

/// Why an estimate begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Restart {
    /// It is the first reading.
    Start,
    /// No reading was believed for longer than the gate's longest gap.
    Gap,
    /// The stamps went back by more than the gate's longest gap.
    ClockSetBack,
    /// The estimate had become non-finite.
    NotFinite,
}

/// What became of a measurement of `NY` sensors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Observation<const NY: usize> {
    /// Of each reading.
    pub verdicts: [Verdict; NY],
    /// Why the estimate began anew with this measurement; `None` when it went on.
    pub restart: Option<Restart>,
}

impl<const NY: usize> Observation<NY> {
    /// Every reading was refused for the same reason.
    pub(crate) fn refused<T>(readings: &[Option<Reading<T>>; NY], verdict: Verdict) -> Self {
        let of = |reading: &Option<Reading<T>>| match reading {
            Some(_) => verdict,
            None => Verdict::Missing,
        };
        Self {
            verdicts: readings.each_ref().map(of),
            restart: None,
        }
    }

    /// No reading was of use, each for a reason of its own.
    pub(super) fn useless<T: Scalar>(readings: &[Option<Reading<T>>; NY], gate: &Gate<T>) -> Self {
        let of = |reading: &Option<Reading<T>>| match reading {
            Some(reading) => gate.refuses(reading).unwrap_or(Verdict::Stale),
            None => Verdict::Missing,
        };
        Self {
            verdicts: readings.each_ref().map(of),
            restart: None,
        }
    }
}
