//! What a file says of signals: by their names, or a number for each.

use super::{Pair, Pairs};
use lpvmpc_any::Limits;
use lpvmpc_plant::Signal;
use lpvmpc_terminal::table::short;
use lpvmpc_words::nearest;

/// Their names.
pub fn names(signals: &[Signal]) -> Vec<&str> {
    signals.iter().map(|one| one.name.as_str()).collect()
}

/// One finite number for each signal.
pub fn components(place: &str, list: &[f64], signals: &[Signal]) -> Result<(), String> {
    if signals.is_empty() && !list.is_empty() {
        return Err(format!(
            "{place}: the plant has nothing that it could be for; it must be []"
        ));
    }
    if list.len() != signals.len() {
        return Err(format!(
            "{place}: {} numbers; it needs {}, for {}",
            list.len(),
            signals.len(),
            names(signals).join(", ")
        ));
    }
    let mut pairs = signals.iter().zip(list);
    match pairs.find(|(_, value)| !value.is_finite()) {
        Some((signal, value)) => Err(format!("{place}: {} = {value} is not finite", signal.name)),
        None => Ok(()),
    }
}

/// The same of weights.
pub(super) fn weights(place: &str, list: &[f64], signals: &[Signal]) -> Result<(), String> {
    components(place, list, signals)?;
    let mut pairs = signals.iter().zip(list);
    match pairs.find(|(_, weight)| **weight < 0.0) {
        Some((signal, weight)) => Err(format!(
            "{place}: the weight of {} is {}; it must not be negative",
            signal.name,
            short(*weight)
        )),
        None => Ok(()),
    }
}

/// Bounds of each signal: those given by name, else its own.
pub(super) fn limits(
    place: &str,
    given: &Option<Pairs>,
    signals: &[Signal],
) -> Result<Limits, String> {
    for (name, Pair([lower, upper])) in given.iter().flatten() {
        check_name(place, name, names(signals).into_iter())?;
        if !(lower <= upper) {
            let (lower, upper) = (short(*lower), short(*upper));
            return Err(format!(
                "{place}: {name} = [{lower}, {upper}] has no value between"
            ));
        }
    }
    let pair = |signal: &Signal| match given.as_ref().and_then(|given| given.get(&signal.name)) {
        Some(Pair(pair)) => *pair,
        None => [
            signal.lower.unwrap_or(f64::NEG_INFINITY),
            signal.upper.unwrap_or(f64::INFINITY),
        ],
    };
    let pairs: Vec<[f64; 2]> = signals.iter().map(pair).collect();
    Ok(Limits {
        lower: pairs.iter().map(|pair| pair[0]).collect(),
        upper: pairs.iter().map(|pair| pair[1]).collect(),
    })
}

/// Whether it is one of these names.
pub fn check_name<'a>(
    place: &str,
    name: &str,
    known: impl Iterator<Item = &'a str>,
) -> Result<(), String> {
    let known: Vec<&str> = known.collect();
    if known.contains(&name) {
        return Ok(());
    }
    let meant = nearest(name, known.iter().copied());
    Err(format!(
        "{place}: there is no {name:?}; there are {}{}",
        known.join(", "),
        meant.map_or(String::new(), |meant| format!("; did you mean {meant:?}?"))
    ))
}
