//! Where a plant stands, with the parameters of its file and with others.

use crate::check::check_equilibrium;
use crate::data::Equilibrium;
use crate::error::PlantError;
use crate::plant::Plant;
use lpvmpc::Dual;
use nalgebra::{DMatrix, DVector, Vector1};

/// An equilibrium may be missed by so much of a state's size.
const MISSED: f64 = 1e-6;
/// Steps of Newton's method; near a solution it takes a few.
const MOST_STEPS: usize = 50;
/// A step this small, beside what it moves, is the end.
const SETTLED: f64 = 1e-15;
/// Singular values below this part of the largest are zero up to rounding.
const ROUNDING: f64 = 1e-12;

/// # Errors
/// The plant does not stand there.
pub(crate) fn check(plant: &Plant, at: &Equilibrium) -> Result<(), PlantError> {
    let slopes = slopes(plant, at)?;
    // What f may be for states and inputs that are rounded.
    let reach = DVector::from_iterator(
        slopes.ncols(),
        at.x.iter().chain(&at.u).map(|value| 1.0 + value.abs()),
    );
    let sizes = slopes.abs() * reach;
    let states = &plant.data().states;
    for ((signal, rate), size) in states.iter().zip(&change(plant, at)?).zip(&sizes) {
        // Negated, so that a NaN is no equilibrium.
        if !(rate.abs() <= MISSED * (1.0 + size)) {
            let fault = match plant.period() {
                None => format!(
                    "it is none: the derivative of {} is {rate} there",
                    signal.name
                ),
                Some(_) => format!(
                    "it is none: {} changes by {rate} per period there",
                    signal.name
                ),
            };
            return Err(PlantError::new("equilibrium", fault));
        }
    }
    Ok(())
}

/// The equilibrium of the file, or where the plant stands instead with its present parameters: under other inputs, or, where
/// none hold that state, near it. `None` where none is found within the bounds.
pub(crate) fn present(plant: &Plant) -> Option<Equilibrium> {
    let given = plant.data().equilibrium.as_ref()?;
    if check(plant, given).is_ok() {
        return Some(given.clone());
    }
    let is_one = |found: &Equilibrium| {
        check(plant, found).is_ok() && check_equilibrium(plant.data(), found).is_ok()
    };
    let (states, all) = (given.x.len(), given.x.len() + given.u.len());
    [states..all, 0..all]
        .into_iter()
        .filter(|free| !free.is_empty())
        .filter_map(|free| near(plant, given, free))
        .find(is_one)
}

/// Where Newton's method ends that begins at an equilibrium and moves the components of (x, u) that are `free`, as little as
/// can be.
fn near(plant: &Plant, given: &Equilibrium, free: std::ops::Range<usize>) -> Option<Equilibrium> {
    let mut at = given.clone();
    for _ in 0..MOST_STEPS {
        let mut jacobian = slopes(plant, &at).ok()?;
        if plant.period().is_some() {
            (0..jacobian.nrows()).for_each(|i| jacobian[(i, i)] -= 1.0);
        }
        let moved = jacobian.columns(free.start, free.len()).into_owned();
        let right = -change(plant, &at).ok()?;
        if !moved.iter().chain(&right).all(|entry| entry.is_finite()) {
            return None;
        }
        let svd = moved.svd(true, true);
        let least = svd.singular_values.amax() * ROUNDING;
        let step = svd.solve(&right, least).ok()?;
        let mut settled = true;
        let components = at.x.iter_mut().chain(&mut at.u).skip(free.start);
        for (component, step) in components.zip(&step) {
            settled &= step.abs() <= SETTLED * (1.0 + component.abs());
            *component += step;
        }
        if settled {
            break;
        }
    }
    Some(at)
}

/// How fast the states change: f, or in discrete time F - x.
fn change(plant: &Plant, at: &Equilibrium) -> Result<DVector<f64>, PlantError> {
    let mut rates = DVector::from_vec(plant.motion(&at.x, &at.u)?);
    if plant.period().is_some() {
        rates.iter_mut().zip(&at.x).for_each(|(next, x)| *next -= x);
    }
    Ok(rates)
}

/// The derivatives of f or F with respect to the states, then the inputs.
fn slopes(plant: &Plant, at: &Equilibrium) -> Result<DMatrix<f64>, PlantError> {
    let (states, inputs) = (at.x.len(), at.u.len());
    let mut slopes = DMatrix::zeros(states, states + inputs);
    let values: Vec<f64> = at.x.iter().chain(&at.u).copied().collect();
    for (k, mut column) in slopes.column_iter_mut().enumerate() {
        let mut motion: Vec<Dual<f64, 1>> = values.iter().map(|one| Dual::fixed(*one)).collect();
        motion[k] = Dual::variables(&Vector1::new(values[k]))[0];
        let (x, u) = motion.split_at(states);
        let rates = plant.motion(x, u)?;
        column
            .iter_mut()
            .zip(rates)
            .for_each(|(slope, rate)| *slope = rate.slopes[0]);
    }
    Ok(slopes)
}
