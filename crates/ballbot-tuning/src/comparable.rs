//! By which measures candidates can be compared: those that mean the same for all of them.

use crate::error::TuningError;
use crate::file::TuningFile;
use crate::judge::Quantity;
use ballbot_campaign::{LimitsTable, Measure, is_within};

/// What is to become small.
pub(crate) fn check_goal(
    place: &str,
    quantity: &Quantity,
    file: &TuningFile,
) -> Result<(), TuningError> {
    let reason = quantity.measure.and_then(|measure| match measure {
        measure if measure.is_time() => {
            Some("a time of this machine differs from run to run, so nothing could be repeated")
        }
        Measure::EndS => {
            Some("a run should last; the statistic failure_share says how many do not")
        }
        measure => incomparable(measure, file),
    });
    let name = quantity.measure.map_or("", Measure::name);
    refused(format!("{place}.measure"), name, reason)
}

/// What must be kept.
pub(crate) fn check_limit(
    place: &str,
    quantity: &Quantity,
    file: &TuningFile,
) -> Result<(), TuningError> {
    let counts = quantity.measure.is_some_and(Measure::counts_samples);
    match quantity.at_most {
        // Not a single sample: no sampling time makes that mean less.
        Some(0.0) if counts => Ok(()),
        _ => check_goal(place, quantity, file),
    }
}

/// What a run must keep to be no failure.
pub(crate) fn check_success(
    measure: Measure,
    limits: &LimitsTable,
    file: &TuningFile,
) -> Result<(), TuningError> {
    let none_at_all = limits.at_least.is_none() && limits.at_most.is_some_and(|most| most < 1.0);
    if measure.counts_samples() && none_at_all {
        return Ok(());
    }
    let place = format!("worlds.success.{measure}");
    refused(place, "(given)", incomparable(measure, file))
}

/// Why a measure does not mean the same for all candidates; nothing where it does.
fn incomparable(measure: Measure, file: &TuningFile) -> Option<&'static str> {
    let searched = |key: &str| {
        let mut keys = file
            .parameters
            .iter()
            .flat_map(|(key, table)| std::iter::once(key).chain(&table.also));
        keys.any(|other| is_within(other, key) || is_within(key, other))
    };
    let sums = measure == Measure::ClosedLoopCost;
    if sums && (searched("controller.q") || searched("controller.r")) {
        return Some(
            "each candidate would be measured by its own weights; take rms_error_rad and \
             rms_torque_nm",
        );
    }
    let fewer = searched("controller.t_s");
    if sums && fewer {
        return Some(
            "it is a sum over the samples, of which a candidate with a longer controller.t_s has \
             fewer; take rms_error_rad and rms_torque_nm",
        );
    }
    let counts = fewer && measure.counts_samples();
    counts.then_some(
        "it counts samples, of which a candidate with a longer controller.t_s has fewer; only \
         that there is none can be asked for, by an at_most of 0 of a limit",
    )
}

fn refused(place: String, value: &str, reason: Option<&str>) -> Result<(), TuningError> {
    reason.map_or(Ok(()), |reason| {
        Err(TuningError::value(place, value, reason))
    })
}
