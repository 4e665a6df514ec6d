//! Statuses and endings for people, with the ballbot's names.

use lpvmpc::{BoundId, Observation, Quantity, Restart, Side, Status, Verdict};
use lpvmpc_sim::Termination;
pub use lpvmpc_words::{
    MOST_BYTES, check_lists, from_toml, nearest, read, read_text, toml_message,
};

/// Names of the states, in their order.
pub const STATES: [&str; 4] = ["phi", "theta", "phi_dot", "theta_dot"];

/// Names of what a regulator decides on: the torque, and its rate where that is bounded.
const INPUTS: [&str; 2] = ["torque", "torque rate"];

/// Why a run ended, with its time.
pub fn termination(termination: &Termination) -> String {
    match termination {
        Termination::Complete => "complete".to_owned(),
        Termination::OutOfRange { t, component } => {
            let state = STATES.get(*component).copied().unwrap_or("state");
            format!("the robot has fallen: {state} left its range by t = {t:.3} s")
        }
        Termination::NoPlan { t, status } => {
            format!("no plan at t = {t:.3} s: {}", self::status(status))
        }
        Termination::PlantFailed { t, error } => format!("at t = {t:.3} s: {error}"),
    }
}

/// The solver's status.
pub fn status(status: &Status<f64>) -> String {
    let mut text = status.to_string();
    for (index, name) in STATES.iter().enumerate() {
        text = text.replace(&format!("state {index}"), name);
    }
    for (index, name) in INPUTS.iter().enumerate() {
        text = text.replace(&format!("input {index}"), &format!("the {name}"));
    }
    text
}

/// Active bounds of a plan with samples of `t_s` seconds, by name, with the time ahead at which
/// each begins to be active: "theta upper 0.35 s ahead". States first, in their order.
pub fn active_bounds(bounds: &[BoundId], t_s: f64) -> String {
    let states = STATES.iter().enumerate();
    let states = states.map(|(index, name)| (Quantity::State(index), *name));
    let inputs = INPUTS.iter().enumerate();
    let inputs = inputs.map(|(index, name)| (Quantity::Input(index), *name));
    let mut texts = Vec::new();
    for (quantity, name) in states.chain(inputs) {
        for (side, word) in [
            (Side::Lower, "lower"),
            (Side::Upper, "upper"),
            (Side::Equality, "terminal equality"),
        ] {
            let active = bounds.iter();
            let active = active.filter(|bound| bound.quantity == quantity && bound.side == side);
            if let Some(first) = active.map(|bound| bound.stage).min() {
                let ahead = first as f64 * t_s;
                texts.push(format!("{name} {word} {ahead:.2} s ahead"));
            }
        }
    }
    texts.join(", ")
}

/// What was wrong with the readings of (phi, theta, phi_dot, theta_dot), observation by observation
/// with its time (s): how many of which sensor were not believed and why, and when the estimate began
/// anew; empty where there is nothing to tell. A reading that is missing is not told.
pub fn readings(observations: impl Iterator<Item = (f64, Observation<4>)>) -> String {
    const REFUSED: [(Verdict, &str); 4] = [
        (Verdict::NotFinite, "NaN or infinite"),
        (Verdict::Outlier, "outlier"),
        (Verdict::Stale, "too old"),
        (Verdict::Repeated, "repeated"),
    ];
    let mut counts = [[0_usize; REFUSED.len()]; STATES.len()];
    let mut restarts = Vec::new();
    for (t, observation) in observations {
        for (counts, verdict) in counts.iter_mut().zip(observation.verdicts) {
            for (count, (refused, _)) in counts.iter_mut().zip(REFUSED) {
                *count += usize::from(verdict == refused);
            }
        }
        if let Some(cause) = observation.restart.and_then(restart) {
            restarts.push(format!("the estimate began anew at t = {t:.3} s: {cause}"));
        }
    }
    let sensors = STATES.iter().zip(counts).flat_map(|(name, counts)| {
        let told = REFUSED.iter().zip(counts).filter(|(_, count)| *count > 0);
        told.map(move |((_, word), count)| format!("{name} {word} {count} times"))
    });
    let more = restarts.len().saturating_sub(MOST_RESTARTS);
    restarts.truncate(MOST_RESTARTS);
    let rest = (more > 0).then(|| format!("and {more} times more"));
    let told = sensors.chain(restarts).chain(rest);
    told.collect::<Vec<_>>().join(", ")
}

/// Times at which an estimate began anew that are told one by one.
const MOST_RESTARTS: usize = 5;

/// Why an estimate began anew; nothing of its first beginning.
fn restart(cause: Restart) -> Option<&'static str> {
    match cause {
        Restart::Start => None,
        Restart::Gap => Some("no reading was believed for too long"),
        Restart::ClockSetBack => Some("the time stamps went back"),
        Restart::NotFinite => Some("it had become non-finite"),
    }
}
