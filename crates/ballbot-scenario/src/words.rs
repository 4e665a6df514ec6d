//! Statuses and endings for people, with the ballbot's names.

use lpvmpc::{BoundId, Quantity, Side, Status};
use lpvmpc_sim::Ending;

/// Names of the states, in their order.
pub const STATES: [&str; 4] = ["phi", "theta", "phi_dot", "theta_dot"];

/// Names of what a regulator decides on: the torque, and its rate where that is bounded.
const INPUTS: [&str; 2] = ["torque", "torque rate"];

/// What the reader of a TOML file says, without the types of a programming language.
pub fn toml_message(message: &str) -> String {
    const PLAIN: [(&str, &str); 11] = [
        ("expected usize", "expected a whole number, 0 or more"),
        ("expected u64", "expected a whole number, 0 or more"),
        ("expected f64", "expected a number"),
        ("expected an array of length", "expected a list of length"),
        ("expected a sequence", "expected a list"),
        ("expected a map", "expected a table"),
        (
            "wanted exactly 1 element, more than 1 element",
            "one kind must be chosen here: of these tables or keys, only one may stand",
        ),
        (
            "wanted exactly 1 element, found 0 elements",
            "a kind must be chosen here: this table is empty",
        ),
        (
            "wanted string or table",
            "expected the name of a kind in quotes, or a table",
        ),
        (
            "invalid type: unit variant, expected struct variant",
            "this kind needs keys of its own: a table, not its name alone",
        ),
        (
            "invalid type: unit variant, expected newtype variant",
            "this kind needs a value or keys of its own, not its name alone",
        ),
    ];
    PLAIN
        .iter()
        .fold(message.trim_end().to_owned(), |text, (from, to)| {
            text.replace(from, to)
        })
}

/// Why a run ended, with its time.
pub fn ending(ending: &Ending) -> String {
    match ending {
        Ending::Complete => "complete".to_owned(),
        Ending::OutOfRange { t, component } => {
            let state = STATES.get(*component).copied().unwrap_or("state");
            format!("the robot has fallen: {state} left its range by t = {t:.3} s")
        }
        Ending::NoPlan { t, status } => {
            format!("no plan at t = {t:.3} s: {}", self::status(status))
        }
        Ending::PlantFailed { t, error } => format!("at t = {t:.3} s: {error}"),
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_active_bound_is_named_once_with_the_time_at_which_it_begins() {
        let bound = |stage, quantity, side| BoundId {
            stage,
            quantity,
            side,
        };
        let bounds = [
            bound(8, Quantity::State(1), Side::Upper),
            bound(7, Quantity::State(1), Side::Upper),
            bound(0, Quantity::Input(0), Side::Lower),
        ];
        assert_eq!(
            active_bounds(&bounds, 0.05),
            "theta upper 0.35 s ahead, torque lower 0.00 s ahead"
        );
    }
}
