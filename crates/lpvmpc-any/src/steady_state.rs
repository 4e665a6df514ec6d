//! Where a plant of any size can stand.

use crate::check::{Axis, Names};
use crate::controller_settings::limits;
use crate::error::MpcError;
use crate::model::Model;
use crate::settings::LinearModels;
use crate::size::{MOST_INPUTS, MOST_STATES};
use lpvmpc::{LpvModel, SteadyStateProblem};
use lpvmpc_plant::Plant;
use nalgebra::SVector;

const BOTH: usize = MOST_STATES + MOST_INPUTS;

/// A steady state, f(x, u) = 0.
#[derive(Debug, Clone, PartialEq)]
pub struct SteadyState {
    /// The state at which the plant stands, in its order and units.
    pub x: Vec<f64>,
    /// The input that holds it there.
    pub u: Vec<f64>,
    /// Whether x is the reference itself, to 1e-4 of its size. If not, it is the nearest state at which the
    /// plant can stand.
    pub reached: bool,
}

/// The steady state of `plant` within its bounds that is nearest to `x_ref`, by the sum of
/// `weights` times squares: a state without weight is wherever the others want it.
///
/// # Errors
/// A list has not the plant's size or a number that makes no sense, or no steady state was found:
/// there is none within the bounds, or none is near where the search from the reference ended.
pub fn steady_state(
    plant: &Plant,
    x_ref: &[f64],
    weights: &[f64],
) -> Result<SteadyState, MpcError> {
    let names = Names::new(plant);
    let x_ref = names.finite(Axis::States, "x_ref", x_ref)?;
    let q = names.finite(Axis::States, "weights", weights)?;
    if let Some(i) = weights.iter().position(|weight| !(*weight >= 0.0)) {
        let fault = format!(
            "{} is {}; it must not be negative",
            names.states[i], weights[i]
        );
        return Err(MpcError::new("weights", fault));
    }
    let about = (SVector::zeros(), SVector::zeros());
    let model =
        Model::<MOST_STATES, MOST_INPUTS, BOTH>::new(plant, LinearModels::AlongMotion, about)?;
    let data = plant.data();
    let found = model.steady_state(&SteadyStateProblem {
        x_ref,
        q,
        r: SVector::repeat(1.0),
        x: names.bounds(Axis::States, "bounds", &limits(&None, &data.states))?,
        u: names.bounds(Axis::Inputs, "bounds", &limits(&None, &data.inputs))?,
    });
    let Some(found) = found else {
        let fault = "no steady state within the plant's bounds was found from it; there is none, or \
                     a reference nearer to it is needed";
        return Err(MpcError::new("x_ref", fault));
    };
    Ok(SteadyState {
        x: found.x.as_slice()[..data.states.len()].to_vec(),
        u: found.u.as_slice()[..data.inputs.len()].to_vec(),
        reached: found.reached,
    })
}
