//! Whether what a file says of its own formulas is so.

use crate::equilibrium;
use crate::error::PlantError;
use crate::plant::Plant;

/// An embedding may be missed by so much of the terms that it sums up.
const EMBEDDING: f64 = 1e-9;
/// Points at which an embedding is compared with f.
const POINTS: usize = 20;

/// # Errors
/// The equilibrium is none, or the embedding is not f.
pub(crate) fn check(plant: &Plant) -> Result<(), PlantError> {
    if let Some(at) = &plant.data().equilibrium {
        equilibrium::check(plant, at)?;
    }
    check_embedding(plant)
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
