//! The controller of a size that was compiled, behind one that was chosen.

use crate::check::{Axis, Names};
use crate::controller_settings::{StageBounds, controller_settings};
use crate::error::MpcError;
use crate::model::Model;
use crate::plan::{ActiveBound, Plan};
use crate::preview::Preview;
use crate::settings::MpcSettings;
use crate::stage_lists::{StageLists, held};
use crate::words::{Bounded, Named};
use lpvmpc::{BoundId, Controller, GeneralRow, List, Quantity, Reference, Workspace};
use lpvmpc_plant::{Plant, Signal, SizedPlant};
use nalgebra::{DMatrix, SVector};

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
        let rows = self.names.rows("rows", &self.settings.rows)?;
        let rows = List::Owned(rows.into_boxed_slice());
        let set = self.controller.set_rows(rows);
        set.map_err(|error| MpcError::new("rows", error.to_string()))
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
        let set = plant.set_parameters(values);
        set.map_err(|error| MpcError::new(place, error.to_string()))?;
        Model::new(&plant, self.settings.linear_models, self.rest)
    }

    /// The answer of the last step, in the plant's sizes and names.
    fn plan(
        &self,
        x: &SVector<f64, NX>,
        rows: &[Vec<String>],
        lists: &StageLists<NX, NU, NS>,
        cost: f64,
    ) -> Plan {
        let solution = self.controller.solution();
        let (n, m) = (self.names.states.len(), self.names.inputs.len());
        let horizon = self.settings.horizon;
        let of = |bound: BoundId| self.named(bound, rows, lists);
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
        lists: &StageLists<NX, NU, NS>,
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
                let x = held(&lists.x_bounds, stage).unwrap_or(&self.bounds.x);
                of(&data.states, i, x.lower[i], x.upper[i])
            }
            Quantity::Input(i) => {
                let u = held(&lists.u_bounds, stage).unwrap_or(&self.bounds.u);
                of(&data.inputs, i, u.lower[i], u.upper[i])
            }
            Quantity::Row(i) => {
                let own = held(&lists.rows, stage).and_then(|rows| rows.get(i));
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

impl<const NX: usize, const NU: usize, const NS: usize> AnySize for Sized<NX, NU, NS> {
    fn step(&mut self, x: &[f64], preview: &Preview) -> Result<Plan, MpcError> {
        let x: SVector<f64, NX> = self.names.vector(Axis::States, "x", x)?;
        let lists = StageLists::new(&self.names, preview, |place, values| {
            self.model_with(place, values)
        })?;
        // Rows are a matter of memory, which is there for those of the settings.
        let most = lists.rows.iter().map(Vec::len).max().unwrap_or(0);
        if most > self.room {
            let capacity = self.controller.settings().capacity().with_own_stages();
            self.workspace = Workspace::allocate(capacity.with_general_rows(most));
            self.room = most;
        }
        let rows: Vec<&[GeneralRow<f64, NX, NU>]> = lists.rows.iter().map(Vec::as_slice).collect();
        let terminal = lists.x_ref.last().copied().unwrap_or(self.rest.0);
        let preview_of_controller = lpvmpc::Preview {
            u_ref: &lists.u_ref,
            weights: &lists.weights,
            cross: &lists.cross,
            linear_x: &lists.linear_x,
            linear_u: &lists.linear_u,
            x: &lists.x_bounds,
            u: &lists.u_bounds,
            rows: &rows,
            disturbance: &lists.disturbance,
            models: &lists.models,
            ..lpvmpc::Preview::new(Reference {
                stages: &lists.x_ref,
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
        Ok(self.plan(&x, &names, &lists, cost))
    }

    fn set_settings(&mut self, settings: &MpcSettings) -> Result<(), MpcError> {
        let model = Model::new(&self.plant, settings.linear_models, self.rest)?;
        let (of_controller, bounds) =
            controller_settings(&self.plant, &self.names, settings, &model, self.rest)?;
        let rows = self.names.rows("rows", &settings.rows)?;
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
