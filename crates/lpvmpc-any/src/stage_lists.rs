//! A preview in the places that were compiled.

use crate::check::{Axis, Names};
use crate::controller_settings::StageCost;
use crate::error::MpcError;
use crate::last_input::Sampled;
use crate::preview::Preview;
use crate::settings::MpcSettings;
use lpvmpc::{Bounds, GeneralRow, Weights};
use nalgebra::{DVector, SMatrix, SVector};

/// The lists of a preview.
pub(crate) struct StageLists<const NX: usize, const NU: usize, const NS: usize> {
    pub x_ref: Vec<SVector<f64, NX>>,
    pub u_ref: Vec<SVector<f64, NU>>,
    pub weights: Vec<Weights<f64, NX, NU>>,
    pub cross: Vec<SMatrix<f64, NU, NX>>,
    pub linear_x: Vec<SVector<f64, NX>>,
    pub linear_u: Vec<SVector<f64, NU>>,
    pub x_bounds: Vec<Bounds<f64, NX>>,
    pub u_bounds: Vec<Bounds<f64, NU>>,
    pub rows: Vec<Vec<GeneralRow<f64, NX, NU>>>,
    pub disturbance: Vec<SVector<f64, NX>>,
    pub models: Vec<Sampled<NX, NU, NS>>,
}

impl<const NX: usize, const NU: usize, const NS: usize> StageLists<NX, NU, NS> {
    /// The lists of `preview`, whose shapes are checked, with the `models` of its samples. Of those that are looked at
    /// as a whole, what is beyond the horizon is left out.
    pub fn new(
        names: &Names,
        preview: &Preview,
        models: Vec<Sampled<NX, NU, NS>>,
        settings: &MpcSettings,
    ) -> Result<Self, MpcError> {
        let axes = (Axis::Inputs, Axis::States);
        let mut lists = Self {
            x_ref: names.vectors(Axis::States, "x_ref", &preview.x_ref)?,
            u_ref: names.vectors(Axis::Inputs, "u_ref", &preview.u_ref)?,
            weights: by_stage("weights", &preview.weights, |place, (q, r)| {
                names.weights(place, q, r)
            })?,
            cross: by_stage("cross", &preview.cross, |place, s| {
                names.matrix(axes, place, s, 0.0)
            })?,
            linear_x: names.vectors(Axis::States, "linear_x", &preview.linear_x)?,
            linear_u: names.vectors(Axis::Inputs, "linear_u", &preview.linear_u)?,
            x_bounds: by_stage("x_bounds", &preview.x_bounds, |place, limits| {
                names.bounds(Axis::States, place, limits)
            })?,
            u_bounds: by_stage("u_bounds", &preview.u_bounds, |place, limits| {
                names.bounds(Axis::Inputs, place, limits)
            })?,
            rows: by_stage("rows", &preview.rows, |place, rows| names.rows(place, rows))?,
            disturbance: names.vectors(Axis::States, "disturbance", &preview.disturbance)?,
            models,
        };
        check_cross(settings, preview)?;
        lists.x_ref.truncate(settings.horizon + 1);
        lists.u_ref.truncate(settings.horizon);
        lists.x_bounds.truncate(settings.horizon + 1);
        Ok(lists)
    }
}

/// Refuses cross weights, of the right shapes, with which the cost of a stage would have no minimum.
fn check_cross(settings: &MpcSettings, preview: &Preview) -> Result<(), MpcError> {
    let stages = preview.cross.len().max(preview.weights.len());
    for stage in 0..stages.min(settings.horizon) {
        let Some(s) = held(&preview.cross, stage) else {
            return Ok(());
        };
        let (q, r) = match held(&preview.weights, stage) {
            Some((q, r)) => (q, r),
            None => (&settings.q, &settings.r),
        };
        let (q, r, s) = (q.clone(), r.clone(), s.clone());
        if !(StageCost { q, r, s }).is_semidefinite() {
            let fault = "with the weights there Q - S'R^-1 S is not positive semidefinite, as it must be for the cost \
                         to have a minimum";
            return Err(MpcError::new(format!("cross, stage {stage}"), fault));
        }
    }
    Ok(())
}

/// The entry that holds at a stage: the list's last one from where it ends.
pub(crate) fn held<V>(list: &[V], stage: usize) -> Option<&V> {
    list.get(stage).or(list.last())
}

/// Each entry of a list, with its place in messages: "x_ref, stage 3".
pub(crate) fn by_stage<V, W>(
    name: &str,
    list: &[V],
    fill: impl Fn(&str, &V) -> Result<W, MpcError>,
) -> Result<Vec<W>, MpcError> {
    let list = list.iter().enumerate();
    // The place is written down where there is something to say of it.
    list.map(|(stage, entry)| {
        fill(name, entry).or_else(|_| fill(&format!("{name}, stage {stage}"), entry))
    })
    .collect()
}

impl Names {
    /// A vector of finite numbers for each stage.
    pub fn vectors<const K: usize>(
        &self,
        axis: Axis,
        name: &str,
        list: &[DVector<f64>],
    ) -> Result<Vec<SVector<f64, K>>, MpcError> {
        by_stage(name, list, |place, entries| {
            self.finite(axis, place, entries.as_slice())
        })
    }
}
