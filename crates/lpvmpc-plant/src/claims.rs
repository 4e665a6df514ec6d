//! Whether what a file says of its own formulas is so.

use crate::error::PlantError;
use crate::plant::Plant;
use lpvmpc::Dual;
use nalgebra::Vector1;

/// An equilibrium may be missed by so much of a state's size; an embedding by so much of the
/// terms that it sums up.
const EQUILIBRIUM: f64 = 1e-6;
const EMBEDDING: f64 = 1e-9;
/// Points at which an embedding is compared with f.
const POINTS: usize = 20;

/// # Errors
/// The equilibrium is none, or the embedding is not f.
pub(crate) fn check(plant: &Plant) -> Result<(), PlantError> {
    check_equilibrium(plant)?;
    check_embedding(plant)
}

fn check_equilibrium(plant: &Plant) -> Result<(), PlantError> {
    let Some(equilibrium) = &plant.data().equilibrium else {
        return Ok(());
    };
    // In discrete time it stands where it is one period later.
    let discrete = plant.period().is_some();
    let mut rates = plant.motion(&equilibrium.x, &equilibrium.u)?;
    if discrete {
        let pairs = rates.iter_mut().zip(&equilibrium.x);
        pairs.for_each(|(next, x)| *next -= x);
    }
    // What f may be for states and inputs that are rounded.
    let mut sizes = vec![1.0; rates.len()];
    let fixed = |values: &[f64]| -> Vec<Dual<f64, 1>> {
        values.iter().map(|value| Dual::fixed(*value)).collect()
    };
    let (states, inputs) = (equilibrium.x.len(), equilibrium.u.len());
    for i in 0..states + inputs {
        let (mut x, mut u) = (fixed(&equilibrium.x), fixed(&equilibrium.u));
        let place = match i.checked_sub(states) {
            None => &mut x[i],
            Some(j) => &mut u[j],
        };
        *place = Dual::variables(&Vector1::new(place.value))[0];
        let reach = 1.0 + place.value.abs();
        for (size, rate) in sizes.iter_mut().zip(plant.motion(&x, &u)?) {
            *size += rate.slopes[0].abs() * reach;
        }
    }
    for ((signal, rate), size) in plant.data().states.iter().zip(rates).zip(sizes) {
        // Negated, so that a NaN is no equilibrium.
        if !(rate.abs() <= EQUILIBRIUM * size) {
            let fault = match discrete {
                false => format!(
                    "it is none: the derivative of {} is {rate} there",
                    signal.name
                ),
                true => format!(
                    "it is none: {} changes by {rate} per period there",
                    signal.name
                ),
            };
            return Err(PlantError::new("equilibrium", fault));
        }
    }
    Ok(())
}

fn check_embedding(plant: &Plant) -> Result<(), PlantError> {
    let data = plant.data();
    if data.embedding.is_none() {
        return Ok(());
    }
    let (states, inputs) = (data.states.len(), data.inputs.len());
    let sides = sides(plant);
    let (formula, is) = match plant.period() {
        None => ("f", "the derivative of"),
        Some(_) => ("F", "one period later"),
    };
    for point in 0..POINTS {
        // From the middle on they fill the box evenly: multiples of irrational numbers, without their
        // whole part.
        let at = |(i, (lower, upper)): (usize, &(f64, f64))| {
            let share = (0.5 + point as f64 * ((i + 2) as f64).sqrt()).fract();
            lower * (1.0 - share) + upper * share
        };
        let values: Vec<f64> = sides.iter().enumerate().map(at).collect();
        let (x, u) = values.split_at(states);
        let rates = plant.motion(x, u)?;
        let (mut s, mut entries, mut c) = (Vec::new(), Vec::new(), Vec::new());
        plant.evaluate_scheduling((x, u), |_, value| s.push(value));
        plant.evaluate_matrices(&s, |_, value| entries.push(value));
        plant.evaluate_offset(&s, |_, value| c.push(value));
        let (a, b) = entries.split_at(states * states);
        for (i, rate) in rates.iter().enumerate() {
            let row = |matrix: &[f64], columns: usize, by: &[f64]| -> (f64, f64) {
                let terms = matrix[i * columns..].iter().zip(by).map(|(m, v)| m * v);
                terms.fold((0.0, 0.0), |(sum, size), term| {
                    (sum + term, size + term.abs())
                })
            };
            let (of_x, of_u) = (row(a, states, x), row(b, inputs, u));
            let c = c.get(i).map_or(0.0, |c| *c);
            let embedded = of_x.0 + of_u.0 + c;
            let size = 1.0 + of_x.1 + of_u.1 + c.abs() + rate.abs();
            // Negated, so that what is not finite where f is finite is not f.
            if rate.is_finite() && !((embedded - rate).abs() <= EMBEDDING * size) {
                let fault = format!(
                    "it is not {formula}: at x = {x:?}, u = {u:?} {is} {} is {rate}, and {embedded} by A x + B u + c",
                    data.states[i].name
                );
                return Err(PlantError::new("embedding", fault));
            }
        }
    }
    Ok(())
}

/// The box of states and inputs: their bounds, or 1 about the equilibrium (or zero) where there are none.
fn sides(plant: &Plant) -> Vec<(f64, f64)> {
    let data = plant.data();
    let about = data.equilibrium.as_ref().map(|e| [&e.x[..], &e.u].concat());
    let signals = data.states.iter().chain(&data.inputs);
    { signals.enumerate() }
        .map(|(i, signal)| {
            let middle = about.as_ref().map_or(0.0, |about| about[i]);
            let lower = signal.lower.unwrap_or(middle - 1.0);
            let upper = signal.upper.unwrap_or(middle + 1.0);
            (lower.min(upper), upper.max(lower))
        })
        .collect()
}
