//! A horizon made of what a step is told: models, outputs, and where to go.

use crate::check::{Axis, Names, check_price};
use crate::controller_settings::{limits, output_prices};
use crate::error::MpcError;
use crate::last_input::{Disturbed, Sampled};
use crate::linear_model::LinearModel;
use crate::model::Model;
use crate::plan::Target;
use crate::preview::{Preview, StageMatrices};
use crate::settings::{Limits, LinearModels, MpcSettings, StateBounds};
use crate::sized::Sized;
use crate::stage_lists::{StageLists, by_stage, held};
use crate::target::{Wanted, nearest};
use crate::tasks::{About, Tasks, factor, outputs_of_input};
use lpvmpc::{Bounds, LpvModel, SteadyStateProblem};
use lpvmpc_plant::Plant;
use nalgebra::{DMatrix, DVector, SVector};

impl MpcSettings {
    /// Whether changes of the input cost something or are bounded.
    pub(crate) fn with_last_input(&self) -> bool {
        self.r_du.is_some() || self.du_bounds.is_some()
    }

    /// Whether what is said of outputs and changes makes sense.
    pub(crate) fn check_tasks(&self, names: &Names) -> Result<(), MpcError> {
        if let Some(q_y) = &self.q_y {
            if names.outputs.is_empty() {
                return Err(MpcError::new("q_y", "the plant has no outputs"));
            }
            names.check_weight(Axis::Outputs, "q_y", "Q_y", q_y)?;
        }
        if let Some(y_bounds) = &self.y_bounds {
            names.check_limits(Axis::Outputs, "y_bounds", y_bounds)?;
        }
        if let StateBounds::Priced(prices) = &self.output_bounds {
            let count = names.outputs.len();
            if prices.len() != count {
                let fault = format!("there are {} prices for {count} outputs", prices.len());
                return Err(MpcError::new("output_bounds", fault));
            }
            for (name, price) in names.outputs.iter().zip(prices) {
                if let Some(price) = price {
                    check_price("output_bounds", name, price)?;
                }
            }
        }
        if let Some(r_du) = &self.r_du {
            names.check_weight(Axis::Inputs, "r_du", "R_du", r_du)?;
        }
        if let Some(du_bounds) = &self.du_bounds {
            names.check_limits(Axis::Inputs, "du_bounds", du_bounds)?;
        }
        Ok(())
    }
}

/// A list of the preview that is of use only where the settings have its like.
fn needs(given: bool, place: &str, setting: bool) -> Result<(), MpcError> {
    if given && !setting {
        let fault = "the settings have none, and must for a preview to have any";
        return Err(MpcError::new(place, fault));
    }
    Ok(())
}

impl<const NX: usize, const NU: usize, const NS: usize> Sized<NX, NU, NS> {
    /// The plant with other parameters.
    pub fn plant_with(&self, place: &str, values: &[f64]) -> Result<Plant, MpcError> {
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
        Ok(plant)
    }

    /// The plant with the parameters of each stage; none where these are the plant's own.
    fn plants(&self, preview: &Preview) -> Result<Vec<Plant>, MpcError> {
        by_stage("parameters", &preview.parameters, |place, values| {
            self.plant_with(place, values)
        })
    }

    /// Whether measured disturbances are in the models: these act on the plant, not on the last input, and where matrices
    /// are given their rates are not those of the model.
    fn disturbs_models(&self, preview: &Preview) -> bool {
        self.last_input.is_some() || !preview.matrices.is_empty()
    }

    /// The models of the samples; none where they are the controller's.
    pub fn models(
        &self,
        preview: &Preview,
        acting: Option<(SVector<f64, NU>, SVector<f64, NX>)>,
    ) -> Result<Vec<Sampled<NX, NU, NS>>, MpcError> {
        let plants = self.plants(preview)?;
        let matrices = by_stage("matrices", &preview.matrices, |place, matrices| {
            self.given(place, matrices)
        })?;
        if let (Some(_), Some(_)) = (preview.matrices.first(), preview.scheduling.first()) {
            let fault = "a step has either matrices or a scheduling from outside";
            return Err(MpcError::new("scheduling", fault));
        }
        for (stage, s) in preview.scheduling.iter().enumerate() {
            self.check_scheduling(&format!("scheduling, stage {stage}"), s)?;
        }
        let disturbances = match self.disturbs_models(preview) {
            true => {
                let given = &preview.disturbance;
                self.names.vectors(Axis::States, "disturbance", given)?
            }
            false => Vec::new(),
        };
        let counts = [
            plants.len(),
            matrices.len(),
            preview.scheduling.len(),
            disturbances.len(),
            usize::from(acting.is_some()),
        ];
        let count = counts.into_iter().max().unwrap_or(0);
        (0..count.min(self.settings.horizon))
            .map(|i| {
                let plant = held(&plants, i).unwrap_or(&self.plant);
                let model = match (held(&matrices, i), held(&preview.scheduling, i)) {
                    (Some(matrices), _) => Model::Given(Box::new(*matrices)),
                    (None, Some(s)) => self.frozen(plant, s)?,
                    (None, None) => Model::new(plant, self.settings.linear_models, self.rest)?,
                };
                let mut model = Sampled::new(model, self.last_input);
                let known = held(&disturbances, i).copied();
                let found = acting.map(|(_, disturbance)| disturbance);
                let parts = [known, found].into_iter().flatten();
                let disturbance = parts.reduce(|sum, part| sum + part);
                model.rates.disturbance = match held(&matrices, i) {
                    Some(sampled) if plant.period().is_none() => {
                        disturbance.map(|rate| sampled.of_rate(&rate, self.settings.t_s))
                    }
                    _ => disturbance,
                };
                model.rates.beside = acting.map(|(beside, _)| beside);
                Ok(model)
            })
            .collect()
    }

    /// The matrices of a sample.
    fn given(
        &self,
        place: &str,
        StageMatrices { a, b, affine }: &StageMatrices,
    ) -> Result<LinearModel<NX, NU>, MpcError> {
        let (states, inputs) = ((Axis::States, Axis::States), (Axis::States, Axis::Inputs));
        let c = match affine {
            Some(c) => {
                self.names
                    .finite(Axis::States, &format!("{place}, affine"), c.as_slice())?
            }
            None => SVector::zeros(),
        };
        Ok(LinearModel {
            a: self.names.matrix(states, &format!("{place}, a"), a, 0.0)?,
            // No input that is left over moves a state.
            b: {
                let place = format!("{place}, b");
                self.names.check_matrix(inputs, &place, b)?;
                nalgebra::SMatrix::from_fn(|i, j| b.get((i, j)).copied().unwrap_or(0.0))
            },
            c,
            period: Some(self.settings.t_s),
        })
    }

    fn check_scheduling(&self, place: &str, s: &DVector<f64>) -> Result<(), MpcError> {
        let Some(embedding) = &self.plant.data().embedding else {
            let fault = "the plant has no embedding of its own, and so no scheduling";
            return Err(MpcError::new(place, fault));
        };
        if self.settings.linear_models != LinearModels::Own {
            let fault =
                "the linear models are others than the plant's own, which have no scheduling";
            return Err(MpcError::new(place, fault));
        }
        let count = embedding.scheduling.len();
        if s.len() != count {
            let fault = format!("it has {} entries; there must be {count}", s.len());
            return Err(MpcError::new(place, fault));
        }
        match s.iter().find(|entry| !entry.is_finite()) {
            Some(entry) => Err(MpcError::new(
                place,
                format!("an entry is {entry}; it must be finite"),
            )),
            None => Ok(()),
        }
    }

    /// The plant's own embedding at a scheduling from outside.
    fn frozen(&self, plant: &Plant, s: &DVector<f64>) -> Result<Model<NX, NU, NS>, MpcError> {
        let model = Model::<NX, NU, NS>::new(plant, LinearModels::Own, self.rest)?;
        let s = SVector::from_fn(|i, _| s.get(i).copied().unwrap_or(0.0));
        let (a, b) = model.matrices(&s);
        Ok(Model::Given(Box::new(LinearModel {
            a,
            b,
            c: model.offset(&s).unwrap_or_else(SVector::zeros),
            period: model.period(),
        })))
    }

    /// What outputs and changes of the input are to do; `None` where that is nothing.
    pub fn tasks(&self, preview: &Preview) -> Result<Option<Tasks<NX, NU, NS>>, MpcError> {
        let (names, settings) = (&self.names, &self.settings);
        let check = |place: &str, q_y: &DMatrix<f64>| {
            names.check_weight(Axis::Outputs, place, "Q_y", q_y)?;
            Ok(factor(q_y))
        };
        let mut y_factors = by_stage("q_y", &preview.q_y, check)?;
        needs(!y_factors.is_empty(), "q_y", settings.q_y.is_some())?;
        let y_ref = by_stage("y_ref", &preview.y_ref, |place, y_ref| {
            names.check_finite(Axis::Outputs, place, y_ref.as_slice())?;
            Ok(y_ref.clone())
        })?;
        needs(!y_ref.is_empty(), "y_ref", settings.q_y.is_some()).map_err(|error| {
            MpcError::new(error.place, "the settings have no weight q_y for it")
        })?;
        let mut y_bounds = by_stage("y_bounds", &preview.y_bounds, |place, limits| {
            names.check_limits(Axis::Outputs, place, limits)?;
            Ok(limits.clone())
        })?;
        let check = |place: &str, r_du: &DMatrix<f64>| {
            names.check_weight(Axis::Inputs, place, "R_du", r_du)?;
            Ok(factor(r_du))
        };
        let mut du_factors = by_stage("r_du", &preview.r_du, check)?;
        needs(!du_factors.is_empty(), "r_du", settings.r_du.is_some())?;
        let mut du_bounds = by_stage("du_bounds", &preview.du_bounds, |place, limits| {
            names.check_limits(Axis::Inputs, place, limits)?;
            Ok(limits.clone())
        })?;
        needs(
            !du_bounds.is_empty(),
            "du_bounds",
            settings.du_bounds.is_some(),
        )?;
        if y_factors.is_empty() {
            y_factors.extend(settings.q_y.as_ref().map(factor));
        }
        if du_factors.is_empty() {
            du_factors.extend(settings.r_du.as_ref().map(factor));
        }
        let data = self.plant.data();
        let own = limits(&settings.y_bounds, &data.outputs);
        if y_bounds.is_empty() {
            y_bounds.push(own.clone());
        }
        if du_bounds.is_empty() {
            du_bounds.extend(settings.du_bounds.clone());
        }
        let any = |list: &[Limits], k: usize| {
            list.iter()
                .any(|limits| limits.lower[k].is_finite() || limits.upper[k].is_finite())
        };
        let outputs = (0..names.outputs.len()).filter(|k| any(&y_bounds, *k));
        let changes = (0..names.inputs.len()).filter(|k| any(&du_bounds, *k));
        let bounded: Vec<About> = { outputs.map(About::Output) }
            .chain(changes.map(About::Change))
            .collect();
        if bounded.is_empty() && y_factors.is_empty() && du_factors.is_empty() {
            return Ok(None);
        }
        let of_controller = self.controller.settings();
        let kept: Vec<&Limits> = y_bounds.iter().chain([&own]).collect();
        let prices = output_prices(
            &self.plant,
            names,
            settings,
            (&kept, of_controller),
            self.rest,
        );
        let mut plants = self.plants(preview)?;
        if plants.is_empty() {
            plants.push(self.plant.clone());
        }
        Ok(Some(Tasks {
            plants,
            last_input: self.last_input.map(|last| last.at),
            bounded,
            of_input: outputs_of_input(data),
            y_bounds,
            y_prices: prices,
            du_bounds,
            y_factors,
            y_ref,
            du_factors,
        }))
    }

    /// Writes where to go into the lists where the controller cannot work it out: where outputs have weights, and
    /// where the last input is a state. Returns the steady state.
    pub fn aim(
        &self,
        preview: &Preview,
        lists: &mut StageLists<NX, NU, NS>,
        tasks: Option<&mut Tasks<NX, NU, NS>>,
    ) -> Option<Target> {
        let mut tasks = tasks;
        let weighted = tasks
            .as_ref()
            .is_some_and(|tasks| !tasks.y_factors.is_empty());
        let disturbed = match self.disturbs_models(preview) {
            true => {
                lists.disturbance.clear();
                Vec::new()
            }
            false => lists.disturbance.clone(),
        };
        if self.last_input.is_none() && !weighted {
            return None;
        }
        let given = match (lists.u_ref.is_empty(), &self.settings.u_ref) {
            (false, _) => lists.u_ref.clone(),
            (true, Some(u_ref)) => vec![filled(u_ref.as_slice())],
            (true, None) => Vec::new(),
        };
        let last = self.settings.horizon - 1;
        let mut found = None;
        // Without a reference of the state it is where the outputs are nearest to theirs, whatever input costs nothing.
        let by_outputs = lists.x_ref.is_empty() && weighted && !preview.y_ref.is_empty();
        if given.is_empty() || by_outputs {
            let model = held(&lists.models, last).unwrap_or(self.controller.model());
            let mut model = model.rates.clone();
            let parts = [model.disturbance, held(&disturbed, last).copied()];
            let parts = parts.into_iter().flatten();
            model.disturbance = parts.reduce(|sum, part| sum + part);
            found = self.stand(preview, lists, tasks.as_deref_mut(), &model);
        }
        if let Some(tasks) = tasks
            && tasks.y_ref.is_empty()
        {
            // The outputs of where it is to go.
            let x = held(&lists.x_ref, last).unwrap_or(&self.rest.0);
            let u = held(&given, last).unwrap_or(&self.rest.1);
            let (x, u) = found.unwrap_or((*x, *u));
            let (n, m) = (self.names.states.len(), self.names.inputs.len());
            let plant = held(&tasks.plants, last).unwrap_or(&self.plant);
            let y = plant.output(&x.as_slice()[..n], &u.as_slice()[..m]);
            tasks.y_ref = vec![DVector::from_vec(y.unwrap_or_default())];
        }
        let is_given = !given.is_empty();
        let u_ref = match (&found, is_given) {
            (_, true) => given,
            (Some((_, u)), false) => vec![*u],
            (None, false) => vec![SVector::zeros()],
        };
        let first = lists.x_ref.first().copied();
        let rests = lists.x_ref.iter().all(|x_ref| Some(*x_ref) == first);
        if let (Some((x, _)), true) = (&found, rests) {
            lists.x_ref = vec![*x];
        } else if lists.x_ref.is_empty() {
            lists.x_ref = vec![self.rest.0];
        }
        if let Some(last_input) = &self.last_input {
            let count = lists.x_ref.len().max(u_ref.len());
            let stages = 0..count;
            lists.x_ref = stages
                .filter_map(|i| {
                    let mut x_ref = *held(&lists.x_ref, i)?;
                    last_input.write(&mut x_ref, held(&u_ref, i)?);
                    Some(x_ref)
                })
                .collect();
        }
        lists.u_ref = u_ref;
        found.filter(|_| !is_given).map(|(x, u)| Target {
            x: x.as_slice()[..self.names.states.len()].to_vec(),
            u: u.as_slice()[..self.names.inputs.len()].to_vec(),
        })
    }

    /// The steady state nearest to the ends of the references.
    fn stand(
        &self,
        preview: &Preview,
        lists: &StageLists<NX, NU, NS>,
        tasks: Option<&mut Tasks<NX, NU, NS>>,
        model: &Disturbed<NX, NU, NS>,
    ) -> Option<(SVector<f64, NX>, SVector<f64, NU>)> {
        let end = self.settings.horizon;
        let x_ref = held(&lists.x_ref, end).copied().unwrap_or(self.rest.0);
        let x = *held(&lists.x_bounds, end).unwrap_or(&self.bounds.x);
        let u = *held(&lists.u_bounds, end - 1).unwrap_or(&self.bounds.u);
        let weights = held(&preview.weights, end - 1);
        let q = weights.map_or(&self.settings.q, |(q, _)| q);
        let r = weights.map_or(&self.settings.r, |(_, r)| r);
        if let Some(tasks) = tasks
            && let Some(y_ref) = held(&tasks.y_ref, end - 1)
            && let Some(factor) = held(&tasks.y_factors, end - 1)
        {
            // Without a reference of the state it is for the outputs to say.
            let none = DMatrix::zeros(q.nrows(), q.ncols());
            let q = if preview.x_ref.is_empty() { &none } else { q };
            let plant = held(&tasks.plants, end - 1).unwrap_or(&self.plant);
            let outputs = Some((plant, factor, y_ref));
            return nearest(
                model,
                &Wanted {
                    x_ref,
                    q,
                    r,
                    outputs,
                    x,
                    u,
                },
            );
        }
        let diagonal = |weight: &DMatrix<f64>, k: usize| weight.get((k, k)).copied();
        let found = model.steady_state(&SteadyStateProblem {
            x_ref,
            q: SVector::from_fn(|k, _| diagonal(q, k).unwrap_or(0.0)),
            r: SVector::from_fn(|k, _| diagonal(r, k).unwrap_or(1.0)),
            x,
            u,
        });
        match found {
            Some(found) => Some((found.x, found.u)),
            None => nearest(
                model,
                &Wanted {
                    x_ref,
                    q,
                    r,
                    outputs: None,
                    x,
                    u,
                },
            ),
        }
    }

    /// The bounds of the first input with those of its change from the last one. Returns what they were without, where
    /// there are any of the change.
    pub fn bound_first_change(
        &self,
        lists: &mut StageLists<NX, NU, NS>,
        tasks: &Tasks<NX, NU, NS>,
    ) -> Option<Bounds<f64, NU>> {
        let change = tasks.du_bounds.first()?;
        let before = *lists.u_bounds.first().unwrap_or(&self.bounds.u);
        let (mut first, applied) = (before, self.applied());
        for j in 0..self.names.inputs.len() {
            let last = applied[j];
            let (lower, upper) = (last + change.lower[j], last + change.upper[j]);
            // What the input's own bounds ask for comes first.
            let within = |bound: f64| bound.max(before.lower[j]).min(before.upper[j]);
            (first.lower[j], first.upper[j]) = (within(lower), within(upper));
        }
        match lists.u_bounds.len() {
            0 | 1 => lists.u_bounds = vec![first, before],
            _ => lists.u_bounds[0] = first,
        }
        Some(before)
    }
}

fn filled<const K: usize>(values: &[f64]) -> SVector<f64, K> {
    SVector::from_fn(|i, _| values.get(i).copied().unwrap_or(0.0))
}
