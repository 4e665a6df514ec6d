//! What a sample's problem has of its own at a stage, and the plant as it is there.
//!
//! The loops of the controller are written once, over these traits. For `()`, nothing of its own,
//! they become the machine code of a controller that knows its settings only.

use crate::at_stage::AtStage;
use crate::controller::next_state;
use crate::embedding::Tangent;
use crate::linearization::Along;
use crate::model::{LpvModel, Scalar};
use crate::ocp::{Bounds, GeneralRow, SoftBounds};
use crate::outputs::Outputs;
use crate::predictor::Predictor;
use crate::preview::Preview;
use crate::settings::{ControllerSettings, Scheduling, TerminalIngredient, Weights};
use crate::small_matrix::product;
use crate::steady_state::{SteadyState, SteadyStateProblem};
use nalgebra::{SMatrix, SVector};

/// Cost and bounds of stage `i`, from 0 to the end of the horizon; `None`: as the settings have them.
pub(crate) trait CostByStage<T: Scalar, const NX: usize, const NU: usize>: Copy {
    /// Whether there may be anything, of the plant included.
    const SOME: bool = true;

    /// Whether a stage may have a cost, bounds or rows of its own: without, it is not asked for them.
    #[inline(always)]
    fn any(&self) -> bool {
        false
    }
    /// Whether a stage may have weights or bounds of its own.
    fn has_own_stages(&self) -> bool {
        false
    }
    fn u_ref(&self, _i: usize) -> Option<&SVector<T, NU>> {
        None
    }
    fn weights(&self, _i: usize) -> Option<&Weights<T, NX, NU>> {
        None
    }
    fn cross(&self, _i: usize) -> Option<&SMatrix<T, NU, NX>> {
        None
    }
    /// Whether a stage may have linear costs.
    fn has_linear_costs(&self) -> bool {
        false
    }
    fn linear_x(&self, _i: usize) -> Option<&SVector<T, NX>> {
        None
    }
    fn linear_u(&self, _i: usize) -> Option<&SVector<T, NU>> {
        None
    }
    fn terminal(&self) -> Option<&TerminalIngredient<T, NX>> {
        None
    }
    fn x(&self, _i: usize) -> Option<&Bounds<T, NX>> {
        None
    }
    fn soft_x(&self, _i: usize) -> Option<&SoftBounds<T, NX>> {
        None
    }
    /// Bounds of the input, which are `all` where the stage has none of its own.
    #[inline(always)]
    fn u(&self, _i: usize, all: &Bounds<T, NU>) -> Bounds<T, NU> {
        *all
    }
    fn rows(&self, _i: usize) -> &[GeneralRow<T, NX, NU>] {
        &[]
    }
    fn outputs(&self) -> Option<&dyn Outputs<T, NX, NU>> {
        None
    }
}

/// The plant over the sample `i` of the horizon.
pub(crate) trait PlantByStage<P, T: Scalar, const NX: usize, const NU: usize, const NS: usize>:
    CostByStage<T, NX, NU>
{
    /// One sample after `x` under `u`.
    fn next_state(
        &self,
        i: usize,
        plant: &P,
        settings: &ControllerSettings<T, NX, NU, NS>,
        x: &SVector<T, NX>,
        u: &SVector<T, NU>,
    ) -> SVector<T, NX>;

    /// The matrices of a descent at a state and an input.
    fn sample_matrices(
        &self,
        i: usize,
        plant: &P,
        settings: &ControllerSettings<T, NX, NU, NS>,
        at: (&SVector<T, NX>, &SVector<T, NU>),
        along: Along,
    ) -> (SMatrix<T, NX, NX>, SMatrix<T, NX, NU>);

    /// The same of several samples, with the states in which they end; `None` where the plant is not the same in all.
    fn sample_matrices_each<const POINTS: usize>(
        &self,
        plant: &P,
        settings: &ControllerSettings<T, NX, NU, NS>,
        at: (&[SVector<T, NX>; POINTS], &[SVector<T, NU>; POINTS]),
        along: Along,
    ) -> Option<[Tangent<T, NX, NU>; POINTS]>;

    /// A, B and c of the predictor, for a sample that is expected to begin at `x` with `u`.
    fn predict(
        &self,
        i: usize,
        plant: &P,
        settings: &ControllerSettings<T, NX, NU, NS>,
        x: &SVector<T, NX>,
        u: &SVector<T, NU>,
    ) -> (SMatrix<T, NX, NX>, SMatrix<T, NX, NU>, SVector<T, NX>);

    /// The same for several samples, c first; `None` where the plant is not the same in all, or the predictor does not
    /// follow the scheduling.
    fn predict_each<const POINTS: usize>(
        &self,
        plant: &P,
        settings: &ControllerSettings<T, NX, NU, NS>,
        motion: (&[SVector<T, NX>; POINTS], &[SVector<T, NU>; POINTS]),
    ) -> Option<[Tangent<T, NX, NU>; POINTS]>;

    /// The steady state of the plant as it is in the last sample of the horizon; `None` where that is
    /// the one that the settings have.
    fn steady_state(
        &self,
        plant: &P,
        settings: &ControllerSettings<T, NX, NU, NS>,
        x_ref: &SVector<T, NX>,
    ) -> Option<Option<SteadyState<T, NX, NU>>>;
}

impl<T: Scalar, const NX: usize, const NU: usize> CostByStage<T, NX, NU> for () {
    const SOME: bool = false;
}

impl<P, T, const NX: usize, const NU: usize, const NS: usize> PlantByStage<P, T, NX, NU, NS> for ()
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
{
    #[inline(always)]
    fn next_state(
        &self,
        _: usize,
        plant: &P,
        settings: &ControllerSettings<T, NX, NU, NS>,
        x: &SVector<T, NX>,
        u: &SVector<T, NU>,
    ) -> SVector<T, NX> {
        next_state(plant, settings, x, u)
    }

    #[inline(always)]
    fn sample_matrices(
        &self,
        _: usize,
        plant: &P,
        settings: &ControllerSettings<T, NX, NU, NS>,
        at: (&SVector<T, NX>, &SVector<T, NU>),
        along: Along,
    ) -> (SMatrix<T, NX, NX>, SMatrix<T, NX, NU>) {
        along.matrices(plant, settings, at)
    }

    #[inline(always)]
    fn sample_matrices_each<const POINTS: usize>(
        &self,
        plant: &P,
        settings: &ControllerSettings<T, NX, NU, NS>,
        at: (&[SVector<T, NX>; POINTS], &[SVector<T, NU>; POINTS]),
        along: Along,
    ) -> Option<[Tangent<T, NX, NU>; POINTS]> {
        Some(along.matrices_each(plant, settings, at))
    }

    #[inline(always)]
    fn predict_each<const POINTS: usize>(
        &self,
        plant: &P,
        settings: &ControllerSettings<T, NX, NU, NS>,
        motion: (&[SVector<T, NX>; POINTS], &[SVector<T, NU>; POINTS]),
    ) -> Option<[Tangent<T, NX, NU>; POINTS]> {
        predicted_each(plant, settings, motion)
    }

    #[inline(always)]
    fn predict(
        &self,
        _: usize,
        plant: &P,
        settings: &ControllerSettings<T, NX, NU, NS>,
        x: &SVector<T, NX>,
        u: &SVector<T, NU>,
    ) -> (SMatrix<T, NX, NX>, SMatrix<T, NX, NU>, SVector<T, NX>) {
        predicted(plant, settings.scheduling.held(), settings, (x, u))
    }

    #[inline(always)]
    fn steady_state(
        &self,
        _: &P,
        _: &ControllerSettings<T, NX, NU, NS>,
        _: &SVector<T, NX>,
    ) -> Option<Option<SteadyState<T, NX, NU>>> {
        None
    }
}

/// A, B and c of the settings' predictor for a sample from (x, u), where the scheduling may be `held`.
#[inline(always)]
fn predicted<P, T, const NX: usize, const NU: usize, const NS: usize>(
    plant: &P,
    held: Option<&SVector<T, NS>>,
    settings: &ControllerSettings<T, NX, NU, NS>,
    (x, u): (&SVector<T, NX>, &SVector<T, NU>),
) -> (SMatrix<T, NX, NX>, SMatrix<T, NX, NU>, SVector<T, NX>)
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
{
    let ControllerSettings { predictor, t_s, .. } = settings;
    let pair = predictor.linearize_along(plant, held, x, u, *t_s);
    let c = predictor.offset_along(plant, held, (x, u), *t_s, &pair);
    let (a, b) = pair;
    (a, b, c.unwrap_or_else(SVector::zeros))
}

/// The same of several samples, c first, of a predictor that follows the scheduling.
#[inline(always)]
fn predicted_each<P, T, const NX: usize, const NU: usize, const NS: usize, const POINTS: usize>(
    plant: &P,
    settings: &ControllerSettings<T, NX, NU, NS>,
    (x, u): (&[SVector<T, NX>; POINTS], &[SVector<T, NU>; POINTS]),
) -> Option<[Tangent<T, NX, NU>; POINTS]>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
{
    let (Predictor::StageConsistent(rk4), None) = (settings.predictor, settings.scheduling.held())
    else {
        return None;
    };
    let mut reached = rk4.linearize_each(plant, x, u, settings.t_s);
    let has_offset = plant.has_offset();
    for ((next, a, b), (x, u)) in reached.iter_mut().zip(x.iter().zip(u)) {
        // What was the state that is reached makes room for c.
        *next = if has_offset {
            *next - product(a, x) - product(b, u)
        } else {
            SVector::zeros()
        };
    }
    Some(reached)
}

impl<T: Scalar, const NS: usize> Scheduling<T, NS> {
    /// The constant one, if it is.
    #[inline(always)]
    pub(crate) fn held(&self) -> Option<&SVector<T, NS>> {
        match self {
            Self::Predicted => None,
            Self::Held(held) => Some(held),
        }
    }
}

/// A preview, beside what holds where it has nothing.
pub(crate) struct Given<'a, P, T, const NX: usize, const NU: usize, const NS: usize> {
    pub preview: &'a Preview<'a, P, T, NX, NU, NS>,
    pub rows: &'a [GeneralRow<T, NX, NU>],
    /// What acts on the plant besides the input that is planned. With it that input is a command to
    /// actuators, whose bounds in the settings hold whatever the preview says.
    pub beside: Option<&'a SVector<T, NU>>,
    /// Whether there are rows, or more in the preview than a reference and what it says of the plant.
    pub any: bool,
}

impl<'a, P, T, const NX: usize, const NU: usize, const NS: usize> Given<'a, P, T, NX, NU, NS> {
    /// The `preview`, beside the controller's own `rows`.
    pub fn new(
        preview: &'a Preview<'a, P, T, NX, NU, NS>,
        rows: &'a [GeneralRow<T, NX, NU>],
    ) -> Self {
        Self {
            preview,
            rows,
            beside: None,
            any: preview.has_costs_or_bounds() || !rows.is_empty(),
        }
    }
}

impl<P, T, const NX: usize, const NU: usize, const NS: usize> Clone
    for Given<'_, P, T, NX, NU, NS>
{
    fn clone(&self) -> Self {
        *self
    }
}

impl<P, T, const NX: usize, const NU: usize, const NS: usize> Copy for Given<'_, P, T, NX, NU, NS> {}

/// Entry `i`; beyond the last, the last.
pub(crate) fn entry<V>(list: &[V], i: usize) -> Option<&V> {
    list.get(i).or(list.last())
}

impl<P, T: Scalar, const NX: usize, const NU: usize, const NS: usize> CostByStage<T, NX, NU>
    for Given<'_, P, T, NX, NU, NS>
{
    #[inline(always)]
    fn any(&self) -> bool {
        self.any
    }
    fn has_own_stages(&self) -> bool {
        self.preview.has_own_stages()
    }
    fn u_ref(&self, i: usize) -> Option<&SVector<T, NU>> {
        entry(self.preview.u_ref, i)
    }
    fn weights(&self, i: usize) -> Option<&Weights<T, NX, NU>> {
        entry(self.preview.weights, i)
    }
    fn cross(&self, i: usize) -> Option<&SMatrix<T, NU, NX>> {
        entry(self.preview.cross, i)
    }
    fn has_linear_costs(&self) -> bool {
        !(self.preview.linear_x.is_empty() && self.preview.linear_u.is_empty())
    }
    fn linear_x(&self, i: usize) -> Option<&SVector<T, NX>> {
        entry(self.preview.linear_x, i)
    }
    fn linear_u(&self, i: usize) -> Option<&SVector<T, NU>> {
        entry(self.preview.linear_u, i)
    }
    fn terminal(&self) -> Option<&TerminalIngredient<T, NX>> {
        self.preview.terminal.as_ref()
    }
    fn x(&self, i: usize) -> Option<&Bounds<T, NX>> {
        entry(self.preview.x, i)
    }
    fn soft_x(&self, i: usize) -> Option<&SoftBounds<T, NX>> {
        entry(self.preview.soft_x, i)
    }
    fn u(&self, i: usize, all: &Bounds<T, NU>) -> Bounds<T, NU> {
        match (entry(self.preview.u, i), self.beside) {
            (None, _) => *all,
            (Some(own), None) => *own,
            (Some(own), Some(_)) => {
                let within = |bound: &SVector<T, NU>| bound.sup(&all.lower).inf(&all.upper);
                Bounds {
                    lower: within(&own.lower),
                    upper: within(&own.upper),
                }
            }
        }
    }
    fn rows(&self, i: usize) -> &[GeneralRow<T, NX, NU>] {
        entry(self.preview.rows, i).copied().unwrap_or(self.rows)
    }
    fn outputs(&self) -> Option<&dyn Outputs<T, NX, NU>> {
        self.preview.outputs
    }
}

impl<'a, P, T, const NX: usize, const NU: usize, const NS: usize> Given<'a, P, T, NX, NU, NS>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
{
    fn plant(&self, i: usize, plant: &'a P) -> AtStage<'a, P, T, NX, NU, NS> {
        AtStage {
            plant: entry(self.preview.models, i).unwrap_or(plant),
            scheduling: entry(self.preview.scheduling, i),
            disturbance: entry(self.preview.disturbance, i),
            beside: self.beside,
        }
    }

    /// The plant as it is in all samples, if it is the same in all.
    fn everywhere(&self, plant: &'a P) -> Option<AtStage<'a, P, T, NX, NU, NS>> {
        let preview = self.preview;
        let same = [
            preview.models.len(),
            preview.scheduling.len(),
            preview.disturbance.len(),
        ];
        { same.iter().all(|length| *length <= 1) }.then(|| self.plant(0, plant))
    }
}

impl<P, T, const NX: usize, const NU: usize, const NS: usize> PlantByStage<P, T, NX, NU, NS>
    for Given<'_, P, T, NX, NU, NS>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
{
    fn next_state(
        &self,
        i: usize,
        plant: &P,
        settings: &ControllerSettings<T, NX, NU, NS>,
        x: &SVector<T, NX>,
        u: &SVector<T, NU>,
    ) -> SVector<T, NX> {
        next_state(&self.plant(i, plant), settings, x, u)
    }

    fn sample_matrices(
        &self,
        i: usize,
        plant: &P,
        settings: &ControllerSettings<T, NX, NU, NS>,
        at: (&SVector<T, NX>, &SVector<T, NU>),
        along: Along,
    ) -> (SMatrix<T, NX, NX>, SMatrix<T, NX, NU>) {
        along.matrices(&self.plant(i, plant), settings, at)
    }

    fn sample_matrices_each<const POINTS: usize>(
        &self,
        plant: &P,
        settings: &ControllerSettings<T, NX, NU, NS>,
        at: (&[SVector<T, NX>; POINTS], &[SVector<T, NU>; POINTS]),
        along: Along,
    ) -> Option<[Tangent<T, NX, NU>; POINTS]> {
        let plant = self.everywhere(plant)?;
        Some(along.matrices_each(&plant, settings, at))
    }

    fn predict_each<const POINTS: usize>(
        &self,
        plant: &P,
        settings: &ControllerSettings<T, NX, NU, NS>,
        motion: (&[SVector<T, NX>; POINTS], &[SVector<T, NU>; POINTS]),
    ) -> Option<[Tangent<T, NX, NU>; POINTS]> {
        predicted_each(&self.everywhere(plant)?, settings, motion)
    }

    fn predict(
        &self,
        i: usize,
        plant: &P,
        settings: &ControllerSettings<T, NX, NU, NS>,
        x: &SVector<T, NX>,
        u: &SVector<T, NU>,
    ) -> (SMatrix<T, NX, NX>, SMatrix<T, NX, NU>, SVector<T, NX>) {
        let plant = self.plant(i, plant);
        let held = plant.scheduling.or(settings.scheduling.held());
        predicted(&plant, held, settings, (x, u))
    }

    fn steady_state(
        &self,
        plant: &P,
        settings: &ControllerSettings<T, NX, NU, NS>,
        x_ref: &SVector<T, NX>,
    ) -> Option<Option<SteadyState<T, NX, NU>>> {
        let end = settings.horizon;
        let last = end.saturating_sub(1);
        let here = self.plant(last, plant);
        let weights = self.weights(last);
        let x = self.x(end);
        let same = here.is_the_plant()
            && self.preview.models.is_empty()
            && weights.is_none()
            && x.is_none()
            && self.preview.u.is_empty();
        let Weights { q, r } = weights.unwrap_or(&settings.weights);
        (!same).then(|| {
            here.steady_state(&SteadyStateProblem {
                x_ref: *x_ref,
                q: q.diagonal(),
                r: r.diagonal(),
                x: *x.unwrap_or(&settings.x),
                u: self.u(last, &settings.u),
            })
        })
    }
}
