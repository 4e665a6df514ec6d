//! What a sample is told beside its state: references, weights, bounds, rows, disturbances and the
//! plant itself, stage by stage.

use crate::by_stage::entry;
use crate::controller::Reference;
use crate::model::Scalar;
use crate::ocp::{Bounds, GeneralRow, Penalty, SoftBounds};
use crate::outputs::{OutputGoal, Outputs};
use crate::settings::{ControllerError, TerminalIngredient, Weights, check_bounds, check_weight};
use core::fmt;
use nalgebra::{Cholesky, Const, SMatrix, SVector, Vector1, convert};

/// What is known ahead of a sample, for [`Controller::step_with`](crate::Controller::step_with).
///
/// Each list has one entry per stage, from the present one (0) on. From where it ends, its last entry
/// holds; an empty one means what the settings say. So a list of one entry is a value for the whole
/// horizon. Entries beyond the horizon are not read. `NX` states, `NU` inputs, `NS` scheduling
/// parameters, a plant of type `P`.
///
/// ```
/// # use lpvmpc::*;
/// # use nalgebra::Vector2;
/// # fn preview<P>(wind: &[Vector2<f64>]) {
/// let upright = Reference::constant(Vector2::zeros());
/// let preview: Preview<P, f64, 2, 1, 1> = Preview {
///     disturbance: wind,
///     ..Preview::new(upright)
/// };
/// # let _ = preview;
/// # }
/// ```
#[derive(Debug)]
pub struct Preview<'a, P, T, const NX: usize, const NU: usize, const NS: usize> {
    /// x_ref.
    pub reference: Reference<'a, T, NX>,
    /// u_ref, the input that costs nothing, at the stages 0 to N - 1. With one there is no
    /// [`target`](crate::Controller::target): x_ref is taken as it is.
    pub u_ref: &'a [SVector<T, NU>],
    /// Weights of the stages 0 to N - 1.
    pub weights: &'a [Weights<T, NX, NU>],
    /// Cross weights S of the stages 0 to N - 1, `NU` x `NX`: 2 (u - u_ref)'S (x - x_ref) on top. With
    /// them, as without, no stage may cost less than nothing: Q - S' R^-1 S is positive semidefinite.
    pub cross: &'a [SMatrix<T, NU, NX>],
    /// Linear costs of the stages 0 to N, in cost per unit of the state: linear_x'x on top. They may
    /// be negative, and J with them.
    pub linear_x: &'a [SVector<T, NX>],
    /// Linear costs of the stages 0 to N - 1, in cost per unit of the input: linear_u'u on top.
    pub linear_u: &'a [SVector<T, NU>],
    /// What stands at the end of the horizon.
    pub terminal: Option<TerminalIngredient<T, NX>>,
    /// Bounds of x_0 to x_N. The present state x_0 is given: its entry counts nothing.
    pub x: &'a [Bounds<T, NX>],
    /// Which of them may be exceeded, and at what price in the unit of the cost J.
    pub soft_x: &'a [SoftBounds<T, NX>],
    /// Bounds of u_0 to u_{N-1}, always hard.
    pub u: &'a [Bounds<T, NU>],
    /// General rows lower <= x'x_i + u'u_i <= upper of the stages 0 to N, any number of them at each;
    /// prices in the unit of the cost J. A row without an input's coefficient counts nothing at stage
    /// 0, where the state is given; one with an input's counts nothing at the end, where there is no
    /// input.
    pub rows: &'a [&'a [GeneralRow<T, NX, NU>]],
    /// Measured disturbances or affine terms d of the samples 0 to N - 1, in state units per second:
    /// x_dot = f(x, u) + d, constant over each sample; of a model with a period, in state units: x+ = F(x, u) + d.
    pub disturbance: &'a [SVector<T, NX>],
    /// Scheduling from outside, constant over each of the samples 0 to N - 1: the plant is then
    /// x_dot = A(s_i) x + B(s_i) u + c(s_i) + d_i, whatever its state.
    pub scheduling: &'a [SVector<T, NS>],
    /// The plant over the samples 0 to N - 1, where it changes along the horizon.
    pub models: &'a [P],
    /// Outputs that cost something or are bounded, which are linear about the plan in each program.
    pub outputs: Option<&'a dyn Outputs<T, NX, NU>>,
}

impl<P, T, const NX: usize, const NU: usize, const NS: usize> Clone
    for Preview<'_, P, T, NX, NU, NS>
where
    T: Copy,
{
    fn clone(&self) -> Self {
        *self
    }
}

impl<P, T, const NX: usize, const NU: usize, const NS: usize> Copy for Preview<'_, P, T, NX, NU, NS> where
    T: Copy
{
}

impl<'a, P, T, const NX: usize, const NU: usize, const NS: usize> Preview<'a, P, T, NX, NU, NS> {
    /// A reference of the state; all else is as the settings say.
    pub fn new(reference: Reference<'a, T, NX>) -> Self {
        Self {
            reference,
            u_ref: &[],
            weights: &[],
            cross: &[],
            linear_x: &[],
            linear_u: &[],
            terminal: None,
            x: &[],
            soft_x: &[],
            u: &[],
            rows: &[],
            disturbance: &[],
            scheduling: &[],
            models: &[],
            outputs: None,
        }
    }

    /// Whether there is more than a reference and what is said of the plant.
    pub(crate) fn has_costs_or_bounds(&self) -> bool {
        !(self.u_ref.is_empty()
            && self.linear_x.is_empty()
            && self.linear_u.is_empty()
            && self.terminal.is_none()
            && self.rows.is_empty())
            || self.has_own_stages()
    }

    /// Whether a stage may have weights or bounds of its own.
    pub(crate) fn has_own_stages(&self) -> bool {
        !(self.weights.is_empty()
            && self.cross.is_empty()
            && self.x.is_empty()
            && self.soft_x.is_empty()
            && self.u.is_empty()
            && self.outputs.is_none())
    }
}

/// A part of a [`Preview`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PreviewPart {
    /// `u_ref`.
    InputReference,
    /// Q of `weights`.
    StateWeight,
    /// R of `weights`.
    InputWeight,
    /// `cross`.
    CrossWeight,
    /// `linear_x`.
    LinearStateCost,
    /// `linear_u`.
    LinearInputCost,
    /// `terminal`.
    Terminal,
    /// `x`.
    StateBounds,
    /// `soft_x`.
    Prices,
    /// `u`.
    InputBounds,
    /// `rows`, also those of the controller.
    Rows,
    /// `disturbance`.
    Disturbance,
    /// `scheduling`.
    Scheduling,
    /// `outputs`.
    Outputs,
}

/// What is wrong with it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PreviewMistake {
    /// A number is not finite (of bounds: not a number).
    NotFinite,
    /// A weight is not symmetric, or has a number that is not finite.
    NotSymmetric,
    /// A weight is not positive definite (R) or semidefinite (Q, P, and Q - S' R^-1 S).
    NotDefinite,
    /// A lower bound above its upper bound, or not a number.
    Crossed,
    /// A price that is negative or not finite.
    Price,
    /// The workspace has no room for it: see [`Capacity`](crate::Capacity).
    NoRoom,
}

/// The first part of a [`Preview`] that makes no sense.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PreviewError {
    /// Which part.
    pub part: PreviewPart,
    /// At which stage, from 0.
    pub stage: usize,
    /// What is wrong.
    pub mistake: PreviewMistake,
}

impl fmt::Display for PreviewMistake {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NotFinite => "every number must be finite",
            Self::NotSymmetric => "it must be symmetric with finite entries",
            Self::NotDefinite => {
                "it must be positive definite (R) or semidefinite (Q, P, and Q - S' R^-1 S)"
            }
            Self::Crossed => "a lower bound must not exceed its upper bound",
            Self::Price => "a price must be finite and not negative",
            Self::NoRoom => "the workspace has no room for them",
        })
    }
}

impl fmt::Display for PreviewError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let part = match self.part {
            PreviewPart::InputReference => "input reference",
            PreviewPart::StateWeight => "weight Q",
            PreviewPart::InputWeight => "weight R",
            PreviewPart::CrossWeight => "cross weight S",
            PreviewPart::LinearStateCost => "linear cost of the state",
            PreviewPart::LinearInputCost => "linear cost of the input",
            PreviewPart::Terminal => "terminal weight",
            PreviewPart::StateBounds => "state bounds",
            PreviewPart::Prices => "prices of state bounds",
            PreviewPart::InputBounds => "input bounds",
            PreviewPart::Rows => "general rows",
            PreviewPart::Disturbance => "disturbance",
            PreviewPart::Scheduling => "scheduling",
            PreviewPart::Outputs => "outputs",
        };
        write!(f, "the {part} at stage {}: {}", self.stage, self.mistake)
    }
}

impl core::error::Error for PreviewError {}

/// General rows of a stage: an active one has eight bits for its number.
const MOST_ROWS: usize = 256;

/// What of a preview is checked against.
pub(crate) struct Room {
    /// Samples of the horizon.
    pub horizon: usize,
    /// Places for stages with weights and bounds of their own.
    pub own_stages: usize,
    /// Places for general rows, of all stages together.
    pub rows: usize,
}

impl<P, T: Scalar, const NX: usize, const NU: usize, const NS: usize>
    Preview<'_, P, T, NX, NU, NS>
{
    /// The first mistake within the horizon; the reference's numbers show in the answer's status.
    pub(crate) fn check(
        &self,
        weights: &Weights<T, NX, NU>,
        room: &Room,
    ) -> Result<(), PreviewError> {
        use PreviewPart as Part;
        let samples = room.horizon;
        let stages = samples + 1;
        each(self.u_ref, samples, Part::InputReference, finite)?;
        each(self.weights, samples, Part::StateWeight, |weights| {
            semidefinite(&weights.q, T::default_epsilon())
        })?;
        each(self.weights, samples, Part::InputWeight, |weights| {
            semidefinite(&weights.r, T::zero())
        })?;
        for stage in 0..samples.min(self.cross.len().max(self.weights.len())) {
            let weights = entry(self.weights, stage).unwrap_or(weights);
            let checked = entry(self.cross, stage).map_or(Ok(()), |s| crossed(weights, s));
            checked.map_err(|mistake| PreviewError {
                part: Part::CrossWeight,
                stage,
                mistake,
            })?;
        }
        each(self.linear_x, stages, Part::LinearStateCost, finite)?;
        each(self.linear_u, samples, Part::LinearInputCost, finite)?;
        if let Some(TerminalIngredient::Cost(p)) = &self.terminal {
            each(&[*p], 1, Part::Terminal, |p| {
                semidefinite(p, T::default_epsilon())
            })?;
        }
        each(self.x, stages, Part::StateBounds, ordered)?;
        each(self.soft_x, stages, Part::Prices, |soft| {
            soft.iter().try_for_each(price)
        })?;
        each(self.u, samples, Part::InputBounds, ordered)?;
        each(self.rows, stages, Part::Rows, |rows| check_rows(rows))?;
        each(self.disturbance, samples, Part::Disturbance, finite)?;
        each(self.scheduling, samples, Part::Scheduling, finite)?;
        if let Some(outputs) = self.outputs {
            for stage in 0..stages {
                for j in 0..outputs.count() {
                    check_goal(&outputs.goal(stage, j)).map_err(|mistake| PreviewError {
                        part: Part::Outputs,
                        stage,
                        mistake,
                    })?;
                }
            }
        }
        if self.has_own_stages() && room.own_stages < samples {
            let part = if !self.weights.is_empty() {
                Part::StateWeight
            } else if !self.cross.is_empty() {
                Part::CrossWeight
            } else if !self.u.is_empty() {
                Part::InputBounds
            } else if self.outputs.is_some() {
                Part::Outputs
            } else {
                Part::StateBounds
            };
            return Err(PreviewError {
                part,
                stage: room.own_stages,
                mistake: PreviewMistake::NoRoom,
            });
        }
        each(self.rows, stages, Part::Rows, |rows| {
            fit(rows.len() + self.output_rows(), stages, room.rows)
        })
    }

    /// Rows that the bounds of outputs take at each stage.
    pub(crate) fn output_rows(&self) -> usize {
        self.outputs
            .map_or(0, |outputs| outputs.bounded().min(outputs.count()))
    }
}

/// Whether `count` rows at each of so many stages fit into `room` places.
pub(crate) fn fit(count: usize, stages: usize, room: usize) -> Result<(), PreviewMistake> {
    if count <= MOST_ROWS && count.saturating_mul(stages) <= room {
        Ok(())
    } else {
        Err(PreviewMistake::NoRoom)
    }
}

/// Checks the entries that are read.
fn each<V>(
    list: &[V],
    read: usize,
    part: PreviewPart,
    check: impl Fn(&V) -> Result<(), PreviewMistake>,
) -> Result<(), PreviewError> {
    for stage in 0..list.len().min(read) {
        let checked = entry(list, stage).map_or(Ok(()), &check);
        checked.map_err(|mistake| PreviewError {
            part,
            stage,
            mistake,
        })?;
    }
    Ok(())
}

fn finite<T: Scalar, const R: usize, const C: usize>(
    v: &SMatrix<T, R, C>,
) -> Result<(), PreviewMistake> {
    if v.iter().all(|entry| entry.is_finite()) {
        Ok(())
    } else {
        Err(PreviewMistake::NotFinite)
    }
}

fn semidefinite<T: Scalar, const K: usize>(
    weight: &SMatrix<T, K, K>,
    shift: T,
) -> Result<(), PreviewMistake> {
    check_weight(weight, "", shift).map_err(|error| match error {
        ControllerError::WeightSign(_) => PreviewMistake::NotDefinite,
        _ => PreviewMistake::NotSymmetric,
    })
}

/// Whether the cost with the cross weight `s` is never negative: Q - S' R^-1 S is positive
/// semidefinite, up to the rounding of its two terms.
fn crossed<T: Scalar, const NX: usize, const NU: usize>(
    Weights { q, r }: &Weights<T, NX, NU>,
    s: &SMatrix<T, NU, NX>,
) -> Result<(), PreviewMistake> {
    finite(s)?;
    let r = Cholesky::<T, Const<NU>>::new(*r).ok_or(PreviewMistake::NotDefinite)?;
    let saved = s.tr_mul(&r.solve(s));
    let roundings: T = convert::<f64, T>(10.0 * NX as f64) * T::default_epsilon();
    let size = q.amax() + saved.amax();
    let scale = if size > T::zero() { size } else { T::one() };
    let shift = SMatrix::identity() * (scale * roundings);
    let rest = q - saved;
    let half: T = convert(0.5);
    match Cholesky::<T, Const<NX>>::new((rest + rest.transpose()) * half + shift) {
        Some(_) => Ok(()),
        None => Err(PreviewMistake::NotDefinite),
    }
}

fn ordered<T: Scalar, const K: usize>(bounds: &Bounds<T, K>) -> Result<(), PreviewMistake> {
    check_bounds(bounds, "").map_err(|_| PreviewMistake::Crossed)
}

fn price<T: Scalar>(price: &Option<Penalty<T>>) -> Result<(), PreviewMistake> {
    match price {
        Some(price) if !price.makes_sense() => Err(PreviewMistake::Price),
        _ => Ok(()),
    }
}

fn check_goal<T: Scalar>(goal: &OutputGoal<T>) -> Result<(), PreviewMistake> {
    let OutputGoal {
        weight,
        reference,
        lower,
        upper,
        soft,
    } = goal;
    if !(weight.is_finite() && reference.is_finite()) {
        return Err(PreviewMistake::NotFinite);
    }
    if *weight < T::zero() {
        return Err(PreviewMistake::NotDefinite);
    }
    let bounds = Bounds {
        lower: Vector1::new(*lower),
        upper: Vector1::new(*upper),
    };
    ordered(&bounds)?;
    price(soft)
}

/// The first mistake in the rows of a stage.
pub(crate) fn check_rows<T: Scalar, const NX: usize, const NU: usize>(
    rows: &[GeneralRow<T, NX, NU>],
) -> Result<(), PreviewMistake> {
    rows.iter().try_for_each(|row| {
        finite(&row.x)?;
        finite(&row.u)?;
        let bounds = Bounds {
            lower: Vector1::new(row.lower),
            upper: Vector1::new(row.upper),
        };
        ordered(&bounds)?;
        price(&row.soft)
    })
}
