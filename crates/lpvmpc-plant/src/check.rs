//! Whether a plant's data make sense.

use crate::data::{Equilibrium, PlantData, Signal};
use crate::error::PlantError;
use crate::file::operations::MOST_OPERATIONS;
use crate::operation::Operation;
use std::collections::HashMap;

/// Of states, inputs, outputs and parameters there are no more than this each.
const MOST_SIGNALS: usize = 1000;
/// A name is no longer than this.
const LONGEST_NAME: usize = 200;

/// What a result depends on.
#[derive(Clone, Copy, Default)]
struct Dependence {
    /// On a state or an input.
    on_motion: bool,
    /// On the scheduling.
    on_scheduling: bool,
}

/// # Errors
/// The first thing that is wrong, with its place.
pub(crate) fn check(plant: &PlantData) -> Result<(), PlantError> {
    check_name("name", &plant.name)?;
    if plant.states.is_empty() {
        return Err(PlantError::new("states", "a plant has at least one"));
    }
    check_signals(plant)?;
    let dependence = check_operations(plant)?;
    let results = Results { plant, dependence };
    let motion = |place: &str, list: &[usize], count: usize, of: &str| {
        results.check(place, list, count, of, Allowed::Motion)
    };
    check_time(plant)?;
    let formulas = if plant.period.is_some() {
        "next"
    } else {
        "derivative"
    };
    motion(formulas, plant.motion(), plant.states.len(), "state")?;
    motion("output", &plant.output, plant.outputs.len(), "output")?;
    if let Some(embedding) = &plant.embedding {
        let scheduling = &embedding.scheduling;
        motion(
            "embedding.scheduling",
            scheduling,
            scheduling.len(),
            "parameter",
        )?;
        for (name, matrix, columns, of) in [
            ("a", &embedding.a, plant.states.len(), "state"),
            ("b", &embedding.b, plant.inputs.len(), "input"),
        ] {
            let place = format!("embedding.{name}");
            if matrix.len() != plant.states.len() {
                let (found, states) = (matrix.len(), plant.states.len());
                let fault = format!("{found} rows for {states} states");
                return Err(PlantError::new(place, fault));
            }
            for (i, row) in matrix.iter().enumerate() {
                results.check(
                    &format!("{place}[{i}]"),
                    row,
                    columns,
                    of,
                    Allowed::Scheduling,
                )?;
            }
        }
        if let Some(c) = &embedding.c {
            let states = plant.states.len();
            results.check("embedding.c", c, states, "state", Allowed::Scheduling)?;
        }
    }
    match &plant.equilibrium {
        None => Ok(()),
        Some(equilibrium) => check_equilibrium(plant, equilibrium),
    }
}

/// Either a derivative, or a period and the state one period later.
fn check_time(plant: &PlantData) -> Result<(), PlantError> {
    match plant.period {
        None if !plant.next.is_empty() => {
            let fault = "it is of a plant in discrete time, which has a `period`, too";
            Err(PlantError::new("next", fault))
        }
        None if plant.derivative.is_empty() => {
            let fault = "it is missing; in discrete time `period` and `next` stand in its place";
            Err(PlantError::new("derivative", fault))
        }
        Some(_) if !plant.derivative.is_empty() => {
            let fault = "a plant with a `period` is in discrete time: it has `next` in its place";
            Err(PlantError::new("derivative", fault))
        }
        Some(period) if !(period > 0.0 && period.is_finite()) => {
            let fault = format!("it is {period} s; it must be a positive number of seconds");
            Err(PlantError::new("period", fault))
        }
        _ => Ok(()),
    }
}

fn check_signals(plant: &PlantData) -> Result<(), PlantError> {
    for (list, count) in [
        ("states", plant.states.len()),
        ("inputs", plant.inputs.len()),
        ("parameters", plant.parameters.len()),
        ("outputs", plant.outputs.len()),
    ] {
        if count > MOST_SIGNALS {
            let fault = format!("{count} of them, at most {MOST_SIGNALS}");
            return Err(PlantError::new(list, fault));
        }
    }
    let mut known = HashMap::new();
    let parameters = plant
        .parameters
        .iter()
        .map(|p| (p.name.as_str(), p.unit.as_str()));
    let named = numbered("states", plant.states.iter().map(name_and_unit))
        .chain(numbered("inputs", plant.inputs.iter().map(name_and_unit)))
        .chain(numbered("parameters", parameters))
        .chain(numbered("outputs", plant.outputs.iter().map(name_and_unit)));
    for (place, (name, unit)) in named {
        check_names(&place, name, unit)?;
        if let Some(other) = known.insert(name, place.clone()) {
            return Err(PlantError::new(
                place,
                format!("{name:?} is also the name of {other}"),
            ));
        }
    }
    for (list, signals) in [
        ("states", &plant.states),
        ("inputs", &plant.inputs),
        ("outputs", &plant.outputs),
    ] {
        for (i, signal) in signals.iter().enumerate() {
            check_bounds(&format!("{list}[{i}] ({})", signal.name), signal)?;
        }
    }
    for (i, parameter) in plant.parameters.iter().enumerate() {
        if !parameter.value.is_finite() {
            let place = format!("parameters[{i}] ({})", parameter.name);
            return Err(PlantError::new(place, "its value is not finite"));
        }
    }
    Ok(())
}

fn name_and_unit(signal: &Signal) -> (&str, &str) {
    (&signal.name, &signal.unit)
}

fn numbered<'a>(
    list: &'a str,
    signals: impl Iterator<Item = (&'a str, &'a str)> + 'a,
) -> impl Iterator<Item = (String, (&'a str, &'a str))> {
    { signals.enumerate() }.map(move |(i, signal)| (format!("{list}[{i}]"), signal))
}

fn check_names(place: &str, name: &str, unit: &str) -> Result<(), PlantError> {
    check_name(place, name)?;
    if unit.len() > LONGEST_NAME || unit.chars().any(char::is_control) {
        return Err(PlantError::new(
            place,
            "its unit is no short text on one line",
        ));
    }
    Ok(())
}

fn check_name(place: &str, name: &str) -> Result<(), PlantError> {
    if name.is_empty() {
        return Err(PlantError::new(place, "the name is missing"));
    }
    if name.len() > LONGEST_NAME || name.chars().any(char::is_control) {
        let fault = format!("a name is one line of at most {LONGEST_NAME} bytes");
        return Err(PlantError::new(place, fault));
    }
    Ok(())
}

fn check_bounds(place: &str, signal: &Signal) -> Result<(), PlantError> {
    let lower = signal.lower.unwrap_or(f64::NEG_INFINITY);
    let upper = signal.upper.unwrap_or(f64::INFINITY);
    let finite = |bound: Option<f64>| bound.is_none_or(f64::is_finite);
    if finite(signal.lower) && finite(signal.upper) && lower <= upper {
        return Ok(());
    }
    let fault = format!("its bounds are from {lower} to {upper}");
    Err(PlantError::new(place, fault))
}

/// What each result depends on.
fn check_operations(plant: &PlantData) -> Result<Vec<Dependence>, PlantError> {
    if plant.operations.len() > MOST_OPERATIONS {
        let fault = format!(
            "{} of them, at most {MOST_OPERATIONS}",
            plant.operations.len()
        );
        return Err(PlantError::new("operations", fault));
    }
    let scheduling = plant.embedding.as_ref().map_or(0, |e| e.scheduling.len());
    let mut dependence: Vec<Dependence> = Vec::with_capacity(plant.operations.len());
    for (index, operation) in plant.operations.iter().enumerate() {
        let fail = |fault: String| Err(PlantError::new(format!("operation {index}"), fault));
        let name = operation.name();
        let (given, count, list) = match *operation {
            Operation::State(i) => (Some(i), plant.states.len(), "states"),
            Operation::Input(i) => (Some(i), plant.inputs.len(), "inputs"),
            Operation::Parameter(i) => (Some(i), plant.parameters.len(), "parameters"),
            Operation::Scheduling(i) => (Some(i), scheduling, "scheduling parameters"),
            _ => (None, 0, ""),
        };
        if let Some(i) = given.filter(|i| *i >= count) {
            return fail(format!(
                "{name} {i}, but there are {count} {list}, counted from 0"
            ));
        }
        if let Operation::Constant(value) = operation
            && !value.is_finite()
        {
            return fail(format!("the constant {value} is not finite"));
        }
        let mut of = Dependence {
            on_motion: matches!(operation, Operation::State(_) | Operation::Input(_)),
            on_scheduling: matches!(operation, Operation::Scheduling(_)),
        };
        for argument in operation.arguments() {
            let Some(known) = dependence.get(argument) else {
                return fail(format!(
                    "{name} refers to operation {argument}, which is not before it"
                ));
            };
            of.on_motion |= known.on_motion;
            of.on_scheduling |= known.on_scheduling;
        }
        dependence.push(of);
    }
    Ok(dependence)
}

/// What formulas may depend on beside the parameters.
#[derive(Clone, Copy)]
enum Allowed {
    /// x and u.
    Motion,
    /// s.
    Scheduling,
}

struct Results<'a> {
    plant: &'a PlantData,
    dependence: Vec<Dependence>,
}

impl Results<'_> {
    /// `list` has `count` results, one for each `of` these, of formulas of what is `allowed`.
    fn check(
        &self,
        place: &str,
        list: &[usize],
        count: usize,
        of: &str,
        allowed: Allowed,
    ) -> Result<(), PlantError> {
        if list.len() != count {
            let fault = format!("{} results, one for each {of} makes {count}", list.len());
            return Err(PlantError::new(place, fault));
        }
        for (i, result) in list.iter().enumerate() {
            let fail = |fault: String| Err(PlantError::new(format!("{place}[{i}]"), fault));
            let Some(dependence) = self.dependence.get(*result) else {
                let count = self.plant.operations.len();
                return fail(format!(
                    "operation {result}, but there are {count}, counted from 0"
                ));
            };
            match allowed {
                Allowed::Motion if dependence.on_scheduling => {
                    return fail(
                        "it is a formula of x, u and p, but depends on the scheduling".into(),
                    );
                }
                Allowed::Scheduling if dependence.on_motion => {
                    return fail("it is a formula of s and p, but depends on x or u".into());
                }
                _ => {}
            }
        }
        Ok(())
    }
}

/// A finite number for each state and input, within its bounds.
pub(crate) fn check_equilibrium(
    plant: &PlantData,
    equilibrium: &Equilibrium,
) -> Result<(), PlantError> {
    for (name, values, signals) in [
        ("x", &equilibrium.x, &plant.states),
        ("u", &equilibrium.u, &plant.inputs),
    ] {
        let place = format!("equilibrium.{name}");
        if values.len() != signals.len() {
            let (found, count) = (values.len(), signals.len());
            let fault = format!("{found} numbers where {count} are needed");
            return Err(PlantError::new(place, fault));
        }
        for (i, (value, signal)) in values.iter().zip(signals).enumerate() {
            let place = || format!("{place}[{i}]");
            if !value.is_finite() {
                return Err(PlantError::new(place(), "it is not finite"));
            }
            let lower = signal.lower.unwrap_or(f64::NEG_INFINITY);
            let upper = signal.upper.unwrap_or(f64::INFINITY);
            if !(lower..=upper).contains(value) {
                let fault = format!(
                    "{} is {value:?}; it must be from {lower:?} to {upper:?}, its bounds",
                    signal.name
                );
                return Err(PlantError::new(place(), fault));
            }
        }
    }
    Ok(())
}
