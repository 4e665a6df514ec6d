//! Settings in the places that were compiled.

use crate::check::{Axis, Names, check_price};
use crate::error::MpcError;
use crate::last_input::LastInput;
use crate::model::Model;
use crate::sampling::check_substeps;
use crate::settings::{Limits, MpcSettings, StateBounds, Terminal};
use crate::target::output_tangent;
use lpvmpc::{
    Bounds, ControllerSettings, InputReference, LpvModel, Penalty, Predictor, Rk4,
    TerminalIngredient, exact_prices,
};
use lpvmpc_design::{lqr_discrete, zero_order_hold};
use lpvmpc_plant::{Plant, Signal};
use nalgebra::{DMatrix, Matrix1, SMatrix, SVector, Vector1};

/// The longest horizon: the memory of a working set grows with its square.
const MOST_SAMPLES: usize = 1000;

/// What stands, up to rounding: the largest change of a state, in its unit per second or per period.
pub const AT_REST: f64 = 1e-6;

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
    (rest, last_input): ((SVector<f64, NX>, SVector<f64, NU>), Option<LastInput>),
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
    let x = limits(&settings.x_bounds, &data.states);
    let u = limits(&settings.u_bounds, &data.inputs);
    let bounds = StageBounds {
        x: names.bounds(Axis::States, "x_bounds", &x)?,
        u: names.bounds(Axis::Inputs, "u_bounds", &u)?,
    };
    check_prediction(plant, settings, model, &rest)?;
    let weights = names.weights("settings", &settings.q, &settings.r)?;
    let terminal = match &settings.terminal {
        Terminal::Equality => TerminalIngredient::Equality,
        Terminal::Certified(set) => {
            let axes = (Axis::States, Axis::States);
            TerminalIngredient::Cost(names.matrix(axes, "terminal cost", &set.p, 0.0)?)
        }
        Terminal::Cost(p) => {
            let p = names.symmetric(Axis::States, "terminal cost", "P", p, 0.0)?;
            TerminalIngredient::Cost(p)
        }
        Terminal::Lqr => TerminalIngredient::Cost(cost_to_go(
            plant,
            names,
            settings,
            model,
            (rest, last_input),
        )?),
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

/// The bounds that are given, or those of the `signals`.
pub(crate) fn limits(given: &Option<Limits>, signals: &[Signal]) -> Limits {
    let bounds = |of: &dyn Fn(&Signal) -> f64| signals.iter().map(of).collect();
    match given {
        Some(limits) => limits.clone(),
        None => Limits {
            lower: bounds(&|one| one.lower.unwrap_or(f64::NEG_INFINITY)),
            upper: bounds(&|one| one.upper.unwrap_or(f64::INFINITY)),
        },
    }
}

/// Refuses a point (`x`, `u`) at which states `change`, per second or per period, by more than [`AT_REST`].
pub(crate) fn check_rest(
    change: &[f64],
    (x, u): (&[f64], &[f64]),
    discrete: bool,
) -> Result<(), String> {
    // A change that is no number is none that is small.
    let moves = change.iter().find(|one| !(one.abs() <= AT_REST));
    let Some(moves) = moves else {
        return Ok(());
    };
    let per = if discrete { "period" } else { "second" };
    Err(format!(
        "the plant does not stand where its regulator is designed, at {x:?} under {u:?}: a state changes by {moves} \
         per {per}"
    ))
}

/// The cost of the linear-quadratic regulator about the plant's steady state, sampled.
fn cost_to_go<const NX: usize, const NU: usize, const NS: usize>(
    plant: &Plant,
    names: &Names,
    settings: &MpcSettings,
    model: &Model<NX, NU, NS>,
    ((x, u), last_input): ((SVector<f64, NX>, SVector<f64, NU>), Option<LastInput>),
) -> Result<SMatrix<f64, NX, NX>, MpcError> {
    let (n, m) = (names.states.len(), names.inputs.len());
    let discrete = model.period().is_some();
    let motion = model.derivative(&x, &u);
    let change = if discrete { motion - x } else { motion };
    let about = (&x.as_slice()[..n], &u.as_slice()[..m]);
    check_rest(change.as_slice(), about, discrete).map_err(|fault| {
        let advice = "Give a steady state in the plant's file, or a cost";
        MpcError::new("terminal", format!("{fault}. {advice}"))
    })?;
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
    let mut cost = StageCost {
        q: settings.q.clone(),
        r: settings.r.clone(),
        s: DMatrix::zeros(m, n),
    };
    if let Some(q_y) = &settings.q_y {
        let tangent = output_tangent(plant, &x.as_slice()[..n], &u.as_slice()[..m]);
        let (_, slopes) =
            tangent.ok_or_else(|| refused("the outputs have no value there".into()))?;
        let (c, d) = (slopes.columns(0, n), slopes.columns(n, m));
        cost.q += c.transpose() * q_y * c;
        cost.r += d.transpose() * q_y * d;
        cost.s += d.transpose() * q_y * c;
    }
    let with_last = last_input.is_some();
    let (a_d, b_d) = match with_last {
        true => cost.join_last_input(&a_d, &b_d, settings.r_du.as_ref()),
        false => (a_d, b_d),
    };
    let without_cross = cost.without_cross();
    let (along, q) = without_cross.ok_or_else(|| refused("R is not positive definite".into()))?;
    let lqr = lqr_discrete(&(a_d - &b_d * along), &b_d, &q, &cost.r);
    let lqr = lqr.map_err(|error| refused(error.to_string()))?;
    Ok(SMatrix::from_fn(|i, j| {
        lqr.p.get((i, j)).copied().unwrap_or(0.0)
    }))
}

/// x'Q x + u'R u + 2 u'S x.
pub(crate) struct StageCost {
    pub q: DMatrix<f64>,
    pub r: DMatrix<f64>,
    pub s: DMatrix<f64>,
}

impl StageCost {
    /// Of what the input is beside -R^-1 S x the cost has no cross weight: R^-1 S, and the weight of the state then,
    /// Q - S'R^-1 S. `None` where R is not positive definite.
    pub fn without_cross(&self) -> Option<(DMatrix<f64>, DMatrix<f64>)> {
        let along = self.r.clone().cholesky()?.solve(&self.s);
        let q = &self.q - self.s.transpose() * &along;
        Some((along, (&q + q.transpose()) * 0.5))
    }

    /// Whether it is never negative, up to rounding.
    pub fn is_semidefinite(&self) -> bool {
        let Some((along, q)) = self.without_cross() else {
            return false;
        };
        let n = q.nrows();
        // That of the two terms which the weight of the state is the difference of.
        let size = self.q.amax() + (self.s.transpose() * along).amax();
        let scale = if size > 0.0 { size } else { 1.0 };
        let rounding = 10.0 * n as f64 * f64::EPSILON * scale;
        (q + DMatrix::identity(n, n) * rounding)
            .cholesky()
            .is_some()
    }

    /// With the last input v as further states, v+ = u, and the cost of u - v.
    fn join_last_input(
        &mut self,
        a: &DMatrix<f64>,
        b: &DMatrix<f64>,
        r_du: Option<&DMatrix<f64>>,
    ) -> (DMatrix<f64>, DMatrix<f64>) {
        let (n, m) = b.shape();
        let place = |matrix: &DMatrix<f64>, shape: (usize, usize), at: (usize, usize)| {
            let mut larger = DMatrix::zeros(shape.0, shape.1);
            larger.view_mut(at, matrix.shape()).copy_from(matrix);
            larger
        };
        let all = (n + m, n + m);
        self.q = place(&self.q, all, (0, 0));
        self.s = place(&self.s, (m, n + m), (0, 0));
        if let Some(r_du) = r_du {
            self.q += place(r_du, all, (n, n));
            self.r += r_du;
            self.s -= place(r_du, (m, n + m), (0, n));
        }
        let unit = DMatrix::identity(m, m);
        let b = place(b, (n + m, m), (0, 0)) + place(&unit, (n + m, m), (n, 0));
        (place(a, all, (0, 0)), b)
    }
}

/// Prices of exceeding the bounds of outputs, each with its signal's place in the plant, of an output that of the dearest of
/// its bounds.
pub(crate) fn output_prices<const NX: usize, const NU: usize, const NS: usize>(
    plant: &Plant,
    names: &Names,
    settings: &MpcSettings,
    (bounds, of_controller): (&[&Limits], &ControllerSettings<f64, NX, NU, NS>),
    (x, u): (SVector<f64, NX>, SVector<f64, NU>),
) -> Vec<Option<Penalty<f64>>> {
    let count = names.outputs.len();
    match &settings.output_bounds {
        StateBounds::Hard => vec![None; count],
        StateBounds::Priced(prices) => prices.clone(),
        StateBounds::Soft => {
            let (n, m) = (names.states.len(), names.inputs.len());
            let tangent = output_tangent(plant, &x.as_slice()[..n], &u.as_slice()[..m]);
            let samples = settings.horizon as f64;
            let p = match &of_controller.terminal {
                TerminalIngredient::Cost(p) if p.amax() > 0.0 => {
                    DMatrix::from_fn(n, n, |i, j| p[(i, j)])
                }
                _ => &settings.q * samples,
            };
            let q_y = settings.q_y.as_ref();
            let prices = (0..count).map(|k| {
                // What a unit of the output costs that comes the shortest way from state and input.
                let row = tangent
                    .as_ref()
                    .map(|(_, slopes)| slopes.row(k).transpose());
                let row = row.filter(|row| row.norm() > 1e-6 && row.iter().all(|c| c.is_finite()));
                let of_motion = row.map_or(p.amax(), |row| {
                    let (c, d) = (row.rows(0, n), row.rows(n, m));
                    let cost = c.dot(&(&p * c)) + d.dot(&(&settings.r * d));
                    cost / row.norm_squared().powi(2)
                });
                let of_weight = q_y.map_or(0.0, |q_y| q_y[(k, k)] * samples);
                let largest = [of_motion + of_weight, settings.q.amax(), settings.r.amax()];
                let cost = match largest[0] > 0.0 {
                    true => largest[0],
                    false => largest[1].max(largest[2]),
                };
                let prices = bounds.iter().filter_map(|limits| {
                    let bounds = Bounds {
                        lower: Vector1::new(limits.lower[k]),
                        upper: Vector1::new(limits.upper[k]),
                    };
                    exact_prices(&Matrix1::new(cost), &bounds)[0]
                });
                prices.max_by(|one, other| one.linear.total_cmp(&other.linear))
            });
            prices.collect()
        }
    }
}

/// Refuses Runge-Kutta steps that are too long for the plant where it stands.
pub(crate) fn check_prediction<const NX: usize, const NU: usize, const NS: usize>(
    plant: &Plant,
    settings: &MpcSettings,
    model: &Model<NX, NU, NS>,
    (x, u): &(SVector<f64, NX>, SVector<f64, NU>),
) -> Result<(), MpcError> {
    if plant.period().is_some() {
        return Ok(());
    }
    let n = plant.data().states.len();
    let (a, _) = model.jacobian(x, u);
    let a = DMatrix::from_fn(n, n, |i, j| a[(i, j)]);
    check_substeps(&a, settings.t_s, settings.substeps)
}
