//! The controller of a size that was compiled, behind one that was chosen.

use crate::answers::Said;
use crate::check::{Axis, Names};
use crate::controller_settings::{StageBounds, check_prediction, controller_settings};
use crate::error::MpcError;
use crate::last_input::{LastInput, Sampled};
use crate::model::Model;
use crate::plan::{Plan, Target};
use crate::preview::Preview;
use crate::settings::{MpcSettings, StateBounds};
use crate::stage_lists::{StageLists, held};
use lpvmpc::{
    Bounds, Controller, GeneralRow, List, Penalty, Reference, Rk4, SoftBounds, Workspace,
};
use lpvmpc_plant::{Plant, SizedPlant};
use nalgebra::SVector;

/// A controller whose size nobody sees.
pub(crate) trait AnySize: Send + Sync {
    /// See [`crate::Mpc::step`]; what is `acting` beside the input, and on the states, is there besides.
    fn step(
        &mut self,
        x: &[f64],
        acting: Option<Acting<'_>>,
        preview: &Preview,
    ) -> Result<Plan, MpcError>;
    /// See [`crate::Mpc::set_settings`]; they fit into the places.
    fn set_settings(&mut self, settings: &MpcSettings) -> Result<(), MpcError>;
    /// The same plant with other parameters: see [`crate::Mpc::set_parameters`].
    fn set_plant(&mut self, plant: &Plant) -> Result<(), MpcError>;
    /// See [`crate::Mpc::set_last_input`].
    fn set_last_input(&mut self, u: &[f64]) -> Result<(), MpcError>;
    /// See [`crate::Mpc::reset`].
    fn reset(&mut self);
    /// Forgets the last plan.
    fn forget_plan(&mut self);
    /// The plant, with its parameters as they are now.
    fn plant(&self) -> &Plant;
    /// The input that was applied last; `None` before the first step, when it is that of the plant's steady state.
    fn last_input(&self) -> Option<Vec<f64>>;
    /// The settings as they are now.
    fn settings(&self) -> &MpcSettings;
    /// The places for states.
    fn places(&self) -> usize;
    /// The input `u`, of the plant's size, is applied in place of the last plan's.
    fn apply(&mut self, u: &[f64]);
}

/// What acts on a plant besides its input.
#[derive(Clone, Copy)]
pub(crate) struct Acting<'a> {
    /// Beside the input.
    pub on_inputs: &'a [f64],
    /// On the states; nothing where there are none.
    pub on_states: &'a [f64],
}

type Planner<const NX: usize, const NU: usize, const NS: usize> =
    Controller<Sampled<NX, NU, NS>, f64, NX, NU, NS>;

/// A controller in the places of `NX` states and `NU` inputs; `NS` is their sum.
pub(crate) struct Sized<const NX: usize, const NU: usize, const NS: usize> {
    pub plant: Plant,
    pub names: Names,
    pub settings: MpcSettings,
    pub bounds: StageBounds<NX, NU>,
    /// The plant's steady state.
    pub rest: (SVector<f64, NX>, SVector<f64, NU>),
    pub controller: Planner<NX, NU, NS>,
    workspace: Workspace<f64, NX, NU>,
    /// Rows of a stage that the workspace has room for.
    room: usize,
    /// Where the last input stands among the states, if it does.
    pub last_input: Option<LastInput>,
    /// The input that was applied last; `None` before the first step.
    applied: Option<SVector<f64, NU>>,
    /// The parameters by stage of which the last step was told, for which the prediction's steps are short enough.
    sound: Vec<Vec<f64>>,
}

/// What is made of settings.
struct Made<const NX: usize, const NU: usize, const NS: usize> {
    model: Sampled<NX, NU, NS>,
    of_controller: lpvmpc::ControllerSettings<f64, NX, NU, NS>,
    bounds: StageBounds<NX, NU>,
    rows: Vec<GeneralRow<f64, NX, NU>>,
}

impl<const NX: usize, const NU: usize, const NS: usize> Made<NX, NU, NS> {
    fn new(
        plant: &Plant,
        names: &Names,
        settings: &MpcSettings,
        rest: (SVector<f64, NX>, SVector<f64, NU>),
    ) -> Result<Self, MpcError> {
        let model = Model::new(plant, settings.linear_models, rest)?;
        let last_input = settings.with_last_input().then_some(LastInput {
            at: names.states.len(),
            inputs: names.inputs.len(),
            t_s: settings.t_s,
            rk4: Rk4 {
                substeps: settings.substeps,
            },
        });
        settings.check_tasks(names)?;
        let about = (rest, last_input);
        let (of_controller, bounds) = controller_settings(plant, names, settings, &model, about)?;
        Ok(Self {
            model: Sampled::new(model, last_input),
            of_controller,
            bounds,
            rows: names.rows("rows", &settings.rows)?,
        })
    }
}

/// A controller for `plant` in so many places.
pub(crate) fn controller_of_size<const NX: usize, const NU: usize, const NS: usize>(
    plant: &Plant,
    settings: &MpcSettings,
) -> Result<Box<dyn AnySize>, MpcError> {
    Ok(Box::new(Sized::<NX, NU, NS>::new(plant, settings)?))
}

/// Memory for a step: every stage may have weights and bounds of its own and so many general rows, and there is room for a
/// second plan.
fn make_room<const NX: usize, const NU: usize, const NS: usize>(
    controller: &mut Planner<NX, NU, NS>,
    rows: usize,
) -> Workspace<f64, NX, NU> {
    let settings = controller.settings().capacity();
    let capacity = settings.with_own_stages().with_second_plan();
    let capacity = capacity.with_general_rows(rows);
    controller.make_room(capacity);
    Workspace::allocate(capacity)
}

impl<const NX: usize, const NU: usize, const NS: usize> Sized<NX, NU, NS> {
    /// A controller for `plant`, which fits into the places.
    fn new(plant: &Plant, settings: &MpcSettings) -> Result<Self, MpcError> {
        let names = Names::new(plant);
        let sized = SizedPlant::<NX, NU>::new(plant.clone())?;
        let rest = sized
            .equilibrium()
            .unwrap_or((SVector::zeros(), SVector::zeros()));
        let made = Made::new(plant, &names, settings, rest)?;
        let refused = |error: lpvmpc::ControllerError| MpcError::new("settings", error.to_string());
        let last_input = made.model.last_input;
        let mut controller =
            Controller::allocate(made.model, made.of_controller).map_err(refused)?;
        let rows = List::Owned(made.rows.into_boxed_slice());
        controller.set_rows(rows).map_err(refused)?;
        let room = settings.rows.len();
        let workspace = make_room(&mut controller, room);
        Ok(Self {
            plant: plant.clone(),
            names,
            settings: settings.clone(),
            bounds: made.bounds,
            rest,
            controller,
            workspace,
            room,
            last_input,
            applied: None,
            sound: Vec::new(),
        })
    }

    /// The input that was applied last; before the first step that of the plant's steady state.
    pub fn applied(&self) -> SVector<f64, NU> {
        self.applied.unwrap_or(self.rest.1)
    }

    /// The prices of the states' bounds where those that are `told` by stage are dearer than those of the settings.
    fn prices_of(&self, told: &[Bounds<f64, NX>]) -> Option<SoftBounds<f64, NX>> {
        let settings = self.controller.settings();
        if self.settings.state_bounds != StateBounds::Soft {
            return None;
        }
        let mut prices = settings.soft_x;
        // A state has one price, that of its dearest bound.
        for bounds in told {
            for (price, one) in prices.iter_mut().zip(settings.soft_bounds(*bounds).soft_x) {
                let dearer =
                    |one: &Penalty<f64>| price.is_none_or(|price| one.linear > price.linear);
                *price = one.filter(dearer).or(*price);
            }
        }
        (prices != settings.soft_x).then_some(prices)
    }

    /// Refuses parameters under which the prediction's steps are too long, as [`AnySize::set_plant`] does. Those that the
    /// last step was told, at the same stage or one later, are known.
    fn check_parameters(&mut self, preview: &Preview) -> Result<(), MpcError> {
        if !(preview.matrices.is_empty() && preview.scheduling.is_empty()) {
            // The prediction is not of the plant's formulas.
            return Ok(());
        }
        let told = preview.parameters.iter().take(self.settings.horizon);
        let mut before = None;
        for (stage, values) in told.clone().enumerate() {
            let known = [
                held(&self.sound, stage),
                held(&self.sound, stage + 1),
                before,
            ];
            if !known.contains(&Some(values)) {
                let plant = self.plant_with("parameters", values)?;
                let model =
                    Model::<NX, NU, NS>::new(&plant, self.settings.linear_models, self.rest)?;
                check_prediction(&plant, &self.settings, &model, &self.rest)?;
            }
            before = Some(values);
        }
        self.sound.clear();
        self.sound.extend(told.cloned());
        Ok(())
    }

    /// The plan from `x`, where more acts on the plant than its input.
    fn plan_from(
        &mut self,
        mut x: SVector<f64, NX>,
        acting: Option<(SVector<f64, NU>, SVector<f64, NX>)>,
        preview: &Preview,
    ) -> Result<Plan, MpcError> {
        if let Some(last) = &self.last_input {
            last.write(&mut x, &self.applied());
        }
        let models = self.models(preview, acting)?;
        self.check_parameters(preview)?;
        let mut lists = StageLists::new(&self.names, preview, models, &self.settings)?;
        let mut tasks = self.tasks(preview)?;
        let target = self.aim(preview, &mut lists, tasks.as_mut());
        let u_first = tasks
            .as_ref()
            .and_then(|tasks| self.bound_first_change(&mut lists, tasks));
        // Rows are a matter of memory, which is there for those of the settings.
        let of_stages = lists.rows.iter().map(Vec::len).max();
        let of_tasks = tasks.as_ref().map_or(0, |tasks| tasks.bounded.len());
        let most = of_stages.unwrap_or(self.settings.rows.len()) + of_tasks;
        if most > self.room {
            self.room = most;
            self.workspace = make_room(&mut self.controller, most);
        }
        let terminal = lists.x_ref.last().copied().unwrap_or(self.rest.0);
        let prices = self.prices_of(&lists.x_bounds);
        let rows: Vec<&[GeneralRow<f64, NX, NU>]> = lists.rows.iter().map(Vec::as_slice).collect();
        let outputs = tasks
            .as_ref()
            .map(|tasks| tasks as &dyn lpvmpc::Outputs<f64, NX, NU>);
        let preview_of_controller = lpvmpc::Preview {
            u_ref: &lists.u_ref,
            weights: &lists.weights,
            cross: &lists.cross,
            linear_x: &lists.linear_x,
            linear_u: &lists.linear_u,
            x: &lists.x_bounds,
            soft_x: prices.as_slice(),
            u: &lists.u_bounds,
            rows: &rows,
            disturbance: &lists.disturbance,
            models: &lists.models,
            outputs,
            ..lpvmpc::Preview::new(Reference {
                stages: &lists.x_ref,
                terminal,
            })
        };
        let controller = &mut self.controller;
        controller.step_with(&x, &preview_of_controller, &mut self.workspace);
        let cost = controller.tracking_cost_with(&x, &preview_of_controller);
        self.applied = Some(controller.solution().first_input());
        let target = target.or_else(|| {
            let found = self.controller.target()?;
            Some(Target {
                x: found.x.as_slice()[..self.names.states.len()].to_vec(),
                u: found.u.as_slice()[..self.names.inputs.len()].to_vec(),
            })
        });
        let names = preview.rows.iter();
        let said = Said {
            lists: &lists,
            tasks: &tasks,
            rows: names
                .map(|rows| rows.iter().map(|row| row.name.clone()).collect())
                .collect(),
            u_first,
        };
        Ok(self.plan(&x, &said, cost, target))
    }
}

impl<const NX: usize, const NU: usize, const NS: usize> AnySize for Sized<NX, NU, NS> {
    fn step(
        &mut self,
        x: &[f64],
        acting: Option<Acting<'_>>,
        preview: &Preview,
    ) -> Result<Plan, MpcError> {
        let x = self.names.vector(Axis::States, "x", x)?;
        let vector = |of, entries: &[f64]| self.names.vector::<NX>(of, "disturbance", entries);
        let acting = match acting {
            Some(Acting {
                on_inputs,
                on_states,
            }) => Some((
                self.names.vector(Axis::Inputs, "disturbance", on_inputs)?,
                match on_states {
                    [] => SVector::zeros(),
                    some => vector(Axis::States, some)?,
                },
            )),
            None => None,
        };
        self.plan_from(x, acting, preview)
    }

    fn set_settings(&mut self, settings: &MpcSettings) -> Result<(), MpcError> {
        let made = Made::new(&self.plant, &self.names, settings, self.rest)?;
        let refused = |error: lpvmpc::ControllerError| MpcError::new("settings", error.to_string());
        // A part of the changes may be refused after another one was made.
        let mut controller = self.controller.clone();
        controller
            .set_settings(made.of_controller)
            .map_err(refused)?;
        controller
            .set_rows(List::Owned(made.rows.into_boxed_slice()))
            .map_err(refused)?;
        let last_input = made.model.last_input;
        controller.set_model(made.model);
        if last_input.is_some() != self.last_input.is_some() {
            // The plan's states are others.
            controller.reset();
        }
        self.room = settings.rows.len();
        self.workspace = make_room(&mut controller, self.room);
        (self.controller, self.last_input) = (controller, last_input);
        (self.settings, self.bounds) = (settings.clone(), made.bounds);
        self.sound.clear();
        Ok(())
    }

    fn set_plant(&mut self, plant: &Plant) -> Result<(), MpcError> {
        // Where it has none any more, it is about the one before.
        let rest = SizedPlant::<NX, NU>::new(plant.clone())?.equilibrium();
        let rest = rest.unwrap_or(self.rest);
        let model = Model::new(plant, self.settings.linear_models, rest)?;
        check_prediction(plant, &self.settings, &model, &rest)?;
        self.controller
            .set_model(Sampled::new(model, self.last_input));
        (self.plant, self.rest) = (plant.clone(), rest);
        Ok(())
    }

    fn set_last_input(&mut self, u: &[f64]) -> Result<(), MpcError> {
        self.applied = Some(self.names.finite(Axis::Inputs, "last input", u)?);
        Ok(())
    }

    fn reset(&mut self) {
        self.controller.reset();
        self.applied = None;
    }

    fn forget_plan(&mut self) {
        self.controller.reset();
    }

    fn plant(&self) -> &Plant {
        &self.plant
    }

    fn last_input(&self) -> Option<Vec<f64>> {
        let applied = self.applied.as_ref()?.as_slice();
        Some(applied[..self.names.inputs.len()].to_vec())
    }

    fn settings(&self) -> &MpcSettings {
        &self.settings
    }

    fn places(&self) -> usize {
        NX
    }

    fn apply(&mut self, u: &[f64]) {
        self.applied = Some(SVector::from_fn(|j, _| u.get(j).copied().unwrap_or(0.0)));
    }
}
