//! Settings in the places that were compiled.

use crate::check::{Axis, Names, check_price};
use crate::error::MpcError;
use crate::model::Model;
use crate::settings::{Limits, MpcSettings, StateBounds, Terminal};
use lpvmpc::{
    Bounds, ControllerSettings, InputReference, LpvModel, Predictor, Rk4, TerminalIngredient,
};
use lpvmpc_design::{lqr_discrete, zero_order_hold};
use lpvmpc_plant::{Plant, Signal};
use nalgebra::{DMatrix, SMatrix, SVector};

/// The longest horizon: the memory of a working set grows with its square.
const MOST_SAMPLES: usize = 1000;

/// What stands, up to rounding: the largest change of a state, in its unit per second or per period.
const AT_REST: f64 = 1e-6;

/// Bounds that hold at every stage.
#[derive(Clone, Copy)]
pub(crate) struct StageBounds<const NX: usize, const NU: usize> {
    pub x: Bounds<f64, NX>,
    pub u: Bounds<f64, NU>,
}

/// The settings in the places that were compiled, and the bounds among them.
pub(crate) fn controller_settings<const NX: usize, const NU: usize, const NS: usize>(
    plant: &Plant,
    names: &Names,
    settings: &MpcSettings,
    model: &Model<NX, NU, NS>,
    rest: (SVector<f64, NX>, SVector<f64, NU>),
) -> Result<(ControllerSettings<f64, NX, NU, NS>, StageBounds<NX, NU>), MpcError> {
    let MpcSettings { t_s, horizon, .. } = *settings;
    if !(t_s > 0.0 && t_s.is_finite()) {
        let fault = format!("it is {t_s} s; it must be a positive number of seconds");
        return Err(MpcError::new("t_s", fault));
    }
    if let Some(period) = plant.period()
        && t_s != period
    {
        let fault =
            format!("it is {t_s} s; the plant is in discrete time with a period of {period} s");
        return Err(MpcError::new("t_s", fault));
    }
    if horizon == 0 || horizon > MOST_SAMPLES {
        let fault = format!("it is {horizon}; it must be from 1 to {MOST_SAMPLES} samples");
        return Err(MpcError::new("horizon", fault));
    }
    let data = plant.data();
    let limits = |given: &Option<Limits>, signals: &[Signal]| match given {
        Some(limits) => limits.clone(),
        None => Limits {
            lower: signals
                .iter()
                .map(|one| one.lower.unwrap_or(f64::NEG_INFINITY))
                .collect(),
            upper: signals
                .iter()
                .map(|one| one.upper.unwrap_or(f64::INFINITY))
                .collect(),
        },
    };
    let x = limits(&settings.x_bounds, &data.states);
    let u = limits(&settings.u_bounds, &data.inputs);
    let bounds = StageBounds {
        x: names.bounds(Axis::States, "x_bounds", &x)?,
        u: names.bounds(Axis::Inputs, "u_bounds", &u)?,
    };
    let weights = names.weights("settings", &settings.q, &settings.r)?;
    let terminal = match &settings.terminal {
        Terminal::Equality => TerminalIngredient::Equality,
        Terminal::Cost(p) => {
            let axes = (Axis::States, Axis::States);
            TerminalIngredient::Cost(names.matrix(axes, "terminal cost", p, 0.0)?)
        }
        Terminal::Lqr => TerminalIngredient::Cost(cost_to_go(names, settings, model, rest)?),
    };
    let mut new = ControllerSettings::new(t_s, horizon, weights, terminal, bounds.u);
    new.predictor = Predictor::StageConsistent(Rk4 {
        substeps: settings.substeps,
    });
    new.iterations = settings.iterations;
    if let Some(u_ref) = &settings.u_ref {
        let u_ref = names.finite(Axis::Inputs, "u_ref", u_ref.as_slice())?;
        new.input_reference = InputReference::Given(u_ref);
    }
    let new = match &settings.state_bounds {
        StateBounds::Soft => new.soft_bounds(bounds.x),
        StateBounds::Hard => ControllerSettings { x: bounds.x, ..new },
        StateBounds::Priced(prices) => {
            if prices.len() != names.states.len() {
                let fault = format!(
                    "there are {} prices for {} states",
                    prices.len(),
                    names.states.len()
                );
                return Err(MpcError::new("state_bounds", fault));
            }
            for (name, price) in names.states.iter().zip(prices.iter()) {
                if let Some(price) = price {
                    check_price("state_bounds", name, price)?;
                }
            }
            let mut soft_x = [None; NX];
            soft_x
                .iter_mut()
                .zip(prices)
                .for_each(|(place, price)| *place = *price);
            ControllerSettings {
                x: bounds.x,
                soft_x,
                ..new
            }
        }
    };
    Ok((new, bounds))
}

/// The cost of the linear-quadratic regulator about the plant's steady state, sampled.
fn cost_to_go<const NX: usize, const NU: usize, const NS: usize>(
    names: &Names,
    settings: &MpcSettings,
    model: &Model<NX, NU, NS>,
    (x, u): (SVector<f64, NX>, SVector<f64, NU>),
) -> Result<SMatrix<f64, NX, NX>, MpcError> {
    let (n, m) = (names.states.len(), names.inputs.len());
    let discrete = model.period().is_some();
    let motion = model.derivative(&x, &u);
    let largest = if discrete { motion - x } else { motion }.amax();
    if !(largest <= AT_REST) {
        let fault = format!(
            "the plant does not stand where its regulator is designed, at {:?} under {:?}: a state \
             changes by {largest} per {}. Give a steady state in the plant's file, or a cost",
            &x.as_slice()[..n],
            &u.as_slice()[..m],
            if discrete { "period" } else { "second" }
        );
        return Err(MpcError::new("terminal", fault));
    }
    let (a, b) = model.jacobian(&x, &u);
    let a = DMatrix::from_fn(n, n, |i, j| a[(i, j)]);
    let b = DMatrix::from_fn(n, m, |i, j| b[(i, j)]);
    let refused = |error: String| {
        let fault = format!(
            "no linear-quadratic regulator about the plant's steady state: {error}. Give a cost, or \
             a steady state in the plant's file"
        );
        MpcError::new("terminal", fault)
    };
    let (a_d, b_d) = match discrete {
        true => (a, b),
        false => {
            zero_order_hold(&a, &b, settings.t_s).map_err(|error| refused(error.to_string()))?
        }
    };
    let lqr = lqr_discrete(&a_d, &b_d, &settings.q, &settings.r);
    let lqr = lqr.map_err(|error| refused(error.to_string()))?;
    let axes = (Axis::States, Axis::States);
    names.matrix(axes, "terminal", &lqr.p, 0.0)
}
