//! The controller of a size that was compiled, behind one that was chosen.

use crate::check::{Axis, Names, check_price};
use crate::error::MpcError;
use crate::model::Model;
use crate::plan::{ActiveBound, Plan};
use crate::preview::Preview;
use crate::settings::{Limits, MpcSettings, Row, StateBounds, Terminal};
use crate::words::{Bounded, Named};
use lpvmpc::{
    BoundId, Bounds, Controller, ControllerSettings, GeneralRow, InputReference, List, LpvModel,
    Predictor, Quantity, Reference, Rk4, TerminalIngredient, Weights, Workspace,
};
use lpvmpc_design::{
    MatrixError, check_positive_definite, check_positive_semidefinite, checked_symmetric,
    lqr_discrete, zero_order_hold,
};
use lpvmpc_plant::{Plant, Signal, SizedPlant};
use nalgebra::{DMatrix, DVector, SMatrix, SVector};

/// The longest horizon: the memory of a working set grows with its square.
pub(crate) const MOST_SAMPLES: usize = 1000;

/// What stands, up to rounding: the largest derivative of a state, in its unit per second.
const AT_REST: f64 = 1e-6;

/// A controller whose size nobody sees.
pub(crate) trait AnySize: Send {
    /// See [`crate::Mpc::step`].
    fn step(&mut self, x: &[f64], preview: &Preview) -> Result<Plan, MpcError>;
    /// See [`crate::Mpc::set_settings`].
    fn set_settings(&mut self, settings: &MpcSettings) -> Result<(), MpcError>;
    /// See [`crate::Mpc::set_parameter`].
    fn set_parameter(&mut self, name: &str, value: f64) -> Result<(), MpcError>;
    /// See [`crate::Mpc::reset`].
    fn reset(&mut self);
}

type Planner<const NX: usize, const NU: usize, const NS: usize> =
    Controller<Model<NX, NU, NS>, f64, NX, NU, NS>;

/// A controller in the places of `NX` states and `NU` inputs; `NS` is their sum.
pub(crate) struct Sized<const NX: usize, const NU: usize, const NS: usize> {
    plant: Plant,
    names: Names,
    settings: MpcSettings,
    bounds: StageBounds<NX, NU>,
    /// The plant's steady state.
    rest: (SVector<f64, NX>, SVector<f64, NU>),
    controller: Planner<NX, NU, NS>,
    workspace: Workspace<f64, NX, NU>,
    /// Rows of a stage that the workspace has room for.
    room: usize,
}

/// Bounds that hold at every stage.
#[derive(Clone, Copy)]
struct StageBounds<const NX: usize, const NU: usize> {
    x: Bounds<f64, NX>,
    u: Bounds<f64, NU>,
}

impl<const NX: usize, const NU: usize, const NS: usize> Sized<NX, NU, NS> {
    /// A controller for `plant`, which fits into the places.
    pub fn new(plant: &Plant, settings: &MpcSettings) -> Result<Self, MpcError> {
        let names = names(plant);
        let sized = SizedPlant::<NX, NU>::new(plant.clone());
        let sized = sized.map_err(|error| MpcError::new(error.place, error.fault))?;
        let rest = sized
            .equilibrium()
            .unwrap_or((SVector::zeros(), SVector::zeros()));
        let model = Model::new(plant, settings.linear_models, rest)?;
        let (of_controller, bounds) = controller_settings(plant, &names, settings, &model, rest)?;
        let capacity = of_controller.capacity().with_own_stages();
        let controller = Controller::allocate(model, of_controller)
            .map_err(|error| MpcError::new("settings", error.to_string()))?;
        let mut new = Self {
            plant: plant.clone(),
            names,
            settings: settings.clone(),
            bounds,
            rest,
            controller,
            workspace: Workspace::allocate(capacity.with_general_rows(settings.rows.len())),
            room: settings.rows.len(),
        };
        new.set_rows()?;
        Ok(new)
    }

    /// The rows of the settings, for every sample.
    fn set_rows(&mut self) -> Result<(), MpcError> {
        let rows = self.rows("rows", &self.settings.rows)?;
        let rows = List::Owned(rows.into_boxed_slice());
        let set = self.controller.set_rows(rows);
        set.map_err(|error| MpcError::new("rows", error.to_string()))
    }

    fn rows(&self, place: &str, rows: &[Row]) -> Result<Vec<GeneralRow<f64, NX, NU>>, MpcError> {
        let rows = rows.iter();
        rows.map(|row| self.names.row(place, row)).collect()
    }

    /// The preview in the places that were compiled.
    fn filled(&self, preview: &Preview) -> Result<Filled<NX, NU, NS>, MpcError> {
        let names = &self.names;
        let stages = |name: &str, i: usize| format!("{name}, stage {i}");
        let vectors = |name: &str, axis: Axis, list: &[DVector<f64>]| -> Result<Vec<_>, MpcError> {
            let list = list.iter().enumerate();
            list.map(|(i, one)| names.finite(axis, &stages(name, i), one.as_slice()))
                .collect()
        };
        let inputs = |name: &str, list: &[DVector<f64>]| -> Result<Vec<_>, MpcError> {
            let list = list.iter().enumerate();
            list.map(|(i, one)| names.finite(Axis::Inputs, &stages(name, i), one.as_slice()))
                .collect()
        };
        let x_bounds = preview.x_bounds.iter().enumerate();
        let u_bounds = preview.u_bounds.iter().enumerate();
        let weights = preview.weights.iter().enumerate();
        let cross = preview.cross.iter().enumerate();
        let rows = preview.rows.iter().enumerate();
        let parameters = preview.parameters.iter().enumerate();
        Ok(Filled {
            x_ref: vectors("x_ref", Axis::States, &preview.x_ref)?,
            u_ref: inputs("u_ref", &preview.u_ref)?,
            weights: weights
                .map(|(i, (q, r))| self.names.weights(&stages("weights", i), q, r))
                .collect::<Result<_, _>>()?,
            cross: cross
                .map(|(i, s)| {
                    let axes = (Axis::Inputs, Axis::States);
                    names.matrix(axes, &stages("cross", i), s, 0.0)
                })
                .collect::<Result<_, _>>()?,
            linear_x: vectors("linear_x", Axis::States, &preview.linear_x)?,
            linear_u: inputs("linear_u", &preview.linear_u)?,
            x_bounds: x_bounds
                .map(|(i, one)| names.bounds(Axis::States, &stages("x_bounds", i), one))
                .collect::<Result<_, _>>()?,
            u_bounds: u_bounds
                .map(|(i, one)| names.bounds(Axis::Inputs, &stages("u_bounds", i), one))
                .collect::<Result<_, _>>()?,
            rows: rows
                .map(|(i, rows)| self.rows(&stages("rows", i), rows))
                .collect::<Result<_, _>>()?,
            disturbance: vectors("disturbance", Axis::States, &preview.disturbance)?,
            models: parameters
                .map(|(i, values)| self.model_with(&stages("parameters", i), values))
                .collect::<Result<_, _>>()?,
        })
    }

    /// The plant with other parameters.
    fn model_with(&self, place: &str, values: &[f64]) -> Result<Model<NX, NU, NS>, MpcError> {
        let mut plant = self.plant.clone();
        let known: Vec<String> = plant
            .data()
            .parameters
            .iter()
            .map(|p| p.name.clone())
            .collect();
        if values.len() != known.len() {
            let fault = format!(
                "it has {} values; there must be {} ({})",
                values.len(),
                known.len(),
                known.join(", ")
            );
            return Err(MpcError::new(place, fault));
        }
        for (name, value) in known.iter().zip(values) {
            let set = plant.set_parameter(name, *value);
            set.map_err(|error| MpcError::new(place, error.to_string()))?;
        }
        Model::new(&plant, self.settings.linear_models, self.rest)
    }

    /// The answer of the last step, in the plant's sizes and names.
    fn plan(
        &self,
        x: &SVector<f64, NX>,
        rows: &[Vec<String>],
        filled: &Filled<NX, NU, NS>,
        cost: f64,
    ) -> Plan {
        let solution = self.controller.solution();
        let (n, m) = (self.names.states.len(), self.names.inputs.len());
        let horizon = self.settings.horizon;
        let of = |bound: BoundId| self.named(bound, rows, filled);
        let bounded = Bounded { of: &of };
        let mut active: Vec<ActiveBound> = solution
            .active
            .iter()
            .map(|row| ActiveBound {
                stage: row.bound.stage,
                bound: bounded.words(row.bound),
                multiplier: row.multiplier,
                exceeded: row.exceeded,
            })
            .collect();
        active.sort_by_key(|one| one.stage);
        Plan {
            u: DMatrix::from_fn(horizon, m, |i, j| solution.u[i][j]),
            x: DMatrix::from_fn(horizon + 1, n, |i, j| match i.checked_sub(1) {
                None => x[j],
                Some(i) => solution.x[i][j],
            }),
            status: bounded.status(&solution.status, &solution.active),
            kind: solution.status,
            cost,
            active,
            problems: self.controller.problems(),
        }
    }

    /// What a bound acts on.
    fn named(
        &self,
        bound: BoundId,
        rows: &[Vec<String>],
        filled: &Filled<NX, NU, NS>,
    ) -> Option<Named> {
        let data = self.plant.data();
        let of = |signals: &[Signal], i: usize, lower: f64, upper: f64| {
            let signal = signals.get(i)?;
            Some(Named {
                name: signal.name.clone(),
                unit: signal.unit.clone(),
                lower,
                upper,
            })
        };
        let stage = bound.stage;
        match bound.quantity {
            Quantity::State(i) => {
                let x = held(&filled.x_bounds, stage).unwrap_or(&self.bounds.x);
                of(&data.states, i, x.lower[i], x.upper[i])
            }
            Quantity::Input(i) => {
                let u = held(&filled.u_bounds, stage).unwrap_or(&self.bounds.u);
                of(&data.inputs, i, u.lower[i], u.upper[i])
            }
            Quantity::Row(i) => {
                let own = held(&filled.rows, stage).and_then(|rows| rows.get(i));
                let (lower, upper) = match own {
                    Some(row) => (row.lower, row.upper),
                    None => {
                        let row = self.settings.rows.get(i)?;
                        (row.lower, row.upper)
                    }
                };
                let names: Option<&Vec<String>> = held(rows, stage);
                let name = match names {
                    Some(names) => names.get(i)?.clone(),
                    None => self.settings.rows.get(i)?.name.clone(),
                };
                Some(Named {
                    name,
                    unit: String::new(),
                    lower,
                    upper,
                })
            }
        }
    }
}

/// The entry that holds at a stage: the list's last one from where it ends.
fn held<V>(list: &[V], stage: usize) -> Option<&V> {
    list.get(stage).or(list.last())
}

/// A preview in the places that were compiled.
struct Filled<const NX: usize, const NU: usize, const NS: usize> {
    x_ref: Vec<SVector<f64, NX>>,
    u_ref: Vec<SVector<f64, NU>>,
    weights: Vec<Weights<f64, NX, NU>>,
    cross: Vec<SMatrix<f64, NU, NX>>,
    linear_x: Vec<SVector<f64, NX>>,
    linear_u: Vec<SVector<f64, NU>>,
    x_bounds: Vec<Bounds<f64, NX>>,
    u_bounds: Vec<Bounds<f64, NU>>,
    rows: Vec<Vec<GeneralRow<f64, NX, NU>>>,
    disturbance: Vec<SVector<f64, NX>>,
    models: Vec<Model<NX, NU, NS>>,
}

impl<const NX: usize, const NU: usize, const NS: usize> AnySize for Sized<NX, NU, NS> {
    fn step(&mut self, x: &[f64], preview: &Preview) -> Result<Plan, MpcError> {
        let x: SVector<f64, NX> = self.names.vector(Axis::States, "x", x)?;
        let filled = self.filled(preview)?;
        // Rows are a matter of memory, which is there for those of the settings.
        let most = filled.rows.iter().map(Vec::len).max().unwrap_or(0);
        if most > self.room {
            let capacity = self.controller.settings().capacity().with_own_stages();
            self.workspace = Workspace::allocate(capacity.with_general_rows(most));
            self.room = most;
        }
        let rows: Vec<&[GeneralRow<f64, NX, NU>]> = filled.rows.iter().map(Vec::as_slice).collect();
        let terminal = filled.x_ref.last().copied().unwrap_or(self.rest.0);
        let preview_of_controller = lpvmpc::Preview {
            u_ref: &filled.u_ref,
            weights: &filled.weights,
            cross: &filled.cross,
            linear_x: &filled.linear_x,
            linear_u: &filled.linear_u,
            x: &filled.x_bounds,
            u: &filled.u_bounds,
            rows: &rows,
            disturbance: &filled.disturbance,
            models: &filled.models,
            ..lpvmpc::Preview::new(Reference {
                stages: &filled.x_ref,
                terminal,
            })
        };
        let controller = &mut self.controller;
        controller.step_with(&x, &preview_of_controller, &mut self.workspace);
        let cost = controller.tracking_cost_with(&x, &preview_of_controller);
        let names = preview.rows.iter();
        let names: Vec<Vec<String>> = names
            .map(|rows| rows.iter().map(|row| row.name.clone()).collect())
            .collect();
        Ok(self.plan(&x, &names, &filled, cost))
    }

    fn set_settings(&mut self, settings: &MpcSettings) -> Result<(), MpcError> {
        let model = Model::new(&self.plant, settings.linear_models, self.rest)?;
        let (of_controller, bounds) =
            controller_settings(&self.plant, &self.names, settings, &model, self.rest)?;
        let rows = self.rows("rows", &settings.rows)?;
        let refused = |error: lpvmpc::ControllerError| MpcError::new("settings", error.to_string());
        self.controller
            .set_settings(of_controller)
            .map_err(refused)?;
        self.controller
            .set_rows(List::Owned(rows.into_boxed_slice()))
            .map_err(refused)?;
        self.controller.set_model(model);
        let capacity = of_controller.capacity().with_own_stages();
        self.workspace = Workspace::allocate(capacity.with_general_rows(settings.rows.len()));
        self.room = settings.rows.len();
        (self.settings, self.bounds) = (settings.clone(), bounds);
        Ok(())
    }

    fn set_parameter(&mut self, name: &str, value: f64) -> Result<(), MpcError> {
        let mut plant = self.plant.clone();
        plant
            .set_parameter(name, value)
            .map_err(|error| MpcError::new(error.place, error.fault))?;
        let model = Model::new(&plant, self.settings.linear_models, self.rest)?;
        self.controller.set_model(model);
        self.plant = plant;
        Ok(())
    }

    fn reset(&mut self) {
        self.controller.reset();
    }
}

fn names(plant: &Plant) -> Names {
    let all = |signals: &[Signal]| signals.iter().map(|one| one.name.clone()).collect();
    Names {
        states: all(&plant.data().states),
        inputs: all(&plant.data().inputs),
    }
}

impl Names {
    /// Q and R.
    fn weights<const NX: usize, const NU: usize>(
        &self,
        place: &str,
        q: &DMatrix<f64>,
        r: &DMatrix<f64>,
    ) -> Result<Weights<f64, NX, NU>, MpcError> {
        let (states, inputs) = ((Axis::States, Axis::States), (Axis::Inputs, Axis::Inputs));
        let refused = |error: MatrixError| MpcError::new(place, error.to_string());
        let weights = Weights {
            q: self.matrix(states, &format!("{place}, q"), q, 0.0)?,
            // An input that is left over must cost something to be none.
            r: self.matrix(inputs, &format!("{place}, r"), r, 1.0)?,
        };
        let q = checked_symmetric("Q", q).map_err(refused)?;
        check_positive_semidefinite("Q", &q).map_err(refused)?;
        let r = checked_symmetric("R", r).map_err(refused)?;
        check_positive_definite("R", &r).map_err(refused)?;
        Ok(weights)
    }
}

/// The settings in the places that were compiled, and the bounds among them.
fn controller_settings<const NX: usize, const NU: usize, const NS: usize>(
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
    let largest = model.derivative(&x, &u).amax();
    if !(largest <= AT_REST) {
        let fault = format!(
            "the plant does not stand where its regulator is designed, at {:?} under {:?}: a state \
             changes by {largest} per second. Give a steady state in the plant's file, or a cost",
            &x.as_slice()[..n],
            &u.as_slice()[..m]
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
    let (a_d, b_d) =
        zero_order_hold(&a, &b, settings.t_s).map_err(|error| refused(error.to_string()))?;
    let lqr = lqr_discrete(&a_d, &b_d, &settings.q, &settings.r);
    let lqr = lqr.map_err(|error| refused(error.to_string()))?;
    let axes = (Axis::States, Axis::States);
    names.matrix(axes, "terminal", &lqr.p, 0.0)
}
