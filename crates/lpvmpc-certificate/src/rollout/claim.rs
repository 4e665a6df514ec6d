//! What is claimed of a rollout, and its proof.

use super::rays::{Place, Rays, Variable};
use super::sample::{EnclosedSample, Samples};
use crate::cover::{Cell, Uncovered, cover};
use crate::enclosure::{Arithmetic, Interval};
use lpvmpc::{Bounds, Embedding};
use nalgebra::SVector;
use thiserror::Error;

/// What the [`Rollout`](lpvmpc::Rollout) of a guaranteed loop says of its own error. Over every sample from (x, u), u
/// held, whose Runge-Kutta states, both ends included, lie within the bounds:
///
/// - at the end the rollout's state and the plant's differ by at most `error` times
///   [`share_of_bounds`](lpvmpc::share_of_bounds) of (x, u), component by component;
/// - from the beginning to the end of every Runge-Kutta step the plant's state goes at most `between` beyond the
///   rollout's states at both ends of the step.
///
/// Nothing is asked of the plant's own motion. The rollout is that of real numbers: the rounding of a computed one
/// comes on top.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RolloutClaim<const NX: usize, const NU: usize> {
    /// Sampling time, s.
    pub t_s: f64,
    /// Runge-Kutta steps of a sample.
    pub substeps: usize,
    /// State bounds. A state without bounds must be one that the plant's motion does not depend on: it starts at zero.
    pub x: Bounds<f64, NX>,
    /// Input bounds.
    pub u: Bounds<f64, NU>,
    /// Difference per share of the bounds, state units.
    pub error: SVector<f64, NX>,
    /// State units.
    pub between: SVector<f64, NX>,
}

/// What a proof found, beyond that the claim holds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RolloutProof {
    /// Boxes of states and inputs on which it was proved.
    pub boxes: usize,
    /// The part of the claimed bounds that no enclosure used.
    pub spare: f64,
}

/// A claim that is false, or was not proved.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum RolloutError {
    /// The numbers are none of a claim.
    #[error("a claim needs a sampling time, steps and bounds that are positive and finite numbers")]
    Numbers,
    /// The dimension that the caller chose is not that of the claim.
    #[error(
        "D is {given}; it must be {needed}, one more than there are states and inputs with bounds"
    )]
    Dimension {
        /// D.
        given: usize,
        /// What it must be.
        needed: usize,
    },
    /// A plant in discrete time has no Runge-Kutta steps.
    #[error("the plant is in discrete time: there is nothing to integrate")]
    DiscreteTime,
    /// Without motion there would be an error.
    #[error(
        "the plant has an affine term: zero is no equilibrium, from which the error could be counted"
    )]
    AffineTerm,
    /// The error is larger than claimed, for certain.
    #[error("the claim is false: the error from x = {x:?} under u = {u:?} is larger")]
    False {
        /// State, where a sample begins.
        x: Vec<f64>,
        /// Input.
        u: Vec<f64>,
    },
    /// It may hold all the same.
    #[error("the claim could not be shown with {boxes} boxes, near x = {x:?} under u = {u:?}")]
    NotShown {
        /// State, where a sample begins.
        x: Vec<f64>,
        /// Input.
        u: Vec<f64>,
        /// Boxes that were looked at.
        boxes: usize,
    },
}

impl<const NX: usize, const NU: usize> RolloutClaim<NX, NU> {
    /// Proves it for `model`, on at most `most_boxes` boxes for each side of each bound. `D` is one more than there
    /// are states and inputs with bounds. `progress` hears which share is done. The boxes that it takes grow with the
    /// power D - 1 of the motion within a sample: two states and an input are a matter of seconds.
    ///
    /// # Errors
    /// The claim is false or could not be shown, or it is none.
    pub fn prove<M, const NS: usize, const D: usize>(
        &self,
        model: &M,
        most_boxes: usize,
        progress: &dyn Fn(f64),
    ) -> Result<RolloutProof, RolloutError>
    where
        M: Embedding<NX, NU, NS> + Sync,
    {
        let variables = self.checked::<M, NS, D>(model)?;
        let mut proof = RolloutProof {
            boxes: 0,
            spare: 1.0,
        };
        let faces = 2.0 * variables.len() as f64;
        for (done, rays) in Rays::all(model, &variables).enumerate() {
            let samples = Samples { claim: self, rays };
            let examine = |cell: &Cell<D>| samples.examine(cell);
            let progress = |share: f64| progress((done as f64 + share) / faces);
            let whole = samples.rays.whole::<D>();
            let covered = cover(whole, most_boxes, examine, &progress).map_err(|open| {
                let (at, boxes) = match open {
                    Uncovered::False { at } => (at, None),
                    Uncovered::Undecided { at, cells } => (at, Some(cells)),
                };
                let (x, u) = self.start(&samples.rays, &at);
                match boxes {
                    None => RolloutError::False { x, u },
                    Some(boxes) => RolloutError::NotShown { x, u, boxes },
                }
            })?;
            proof.boxes += covered.cells;
            proof.spare = proof.spare.min(covered.spare);
        }
        Ok(proof)
    }

    /// The sample from `x` under `u`, both within their bounds and not all zero; of the claim only bounds and steps
    /// count. `None` where the rollout leaves the bounds, or the motion was not enclosed. `D` is as in
    /// [`prove`](Self::prove).
    ///
    /// # Errors
    /// The claim is none.
    pub fn enclose<M, const NS: usize, const D: usize>(
        &self,
        model: &M,
        x: &SVector<f64, NX>,
        u: &SVector<f64, NU>,
    ) -> Result<Option<EnclosedSample<NX>>, RolloutError>
    where
        M: Embedding<NX, NU, NS> + Sync,
    {
        let variables = self.checked::<M, NS, D>(model)?;
        let share = |variable: &Variable| match variable.place {
            Place::State(i) => x[i] / variable.limit,
            Place::Input(i) => u[i] / variable.limit,
        };
        let shares = variables.iter().map(share).enumerate();
        let largest = shares.max_by(|(_, a), (_, b)| a.abs().total_cmp(&b.abs()));
        let Some((face, largest)) = largest.filter(|(_, share)| *share != 0.0) else {
            return Ok(None);
        };
        let rays = Rays {
            model,
            variables: &variables,
            face,
            side: largest.signum(),
        };
        let mut cell = rays.whole::<D>().middle();
        for (j, variable) in variables.iter().enumerate() {
            // Rounded: the cell is wide enough for the quotient's true value.
            cell.centre[j] = match j == face {
                true => largest.abs(),
                false => share(variable) / largest.abs(),
            };
            cell.half_widths[j] = 4.0 * f64::EPSILON * cell.centre[j].abs();
        }
        Ok(Samples { claim: self, rays }.enclose(&cell).ok().flatten())
    }

    pub(super) fn step_length(&self) -> Interval {
        Interval::point(self.t_s) * Interval::point(self.substeps as f64).reciprocal()
    }

    /// The states and inputs with bounds, of a claim that is one.
    fn checked<M, const NS: usize, const D: usize>(
        &self,
        model: &M,
    ) -> Result<Vec<Variable>, RolloutError>
    where
        M: Embedding<NX, NU, NS>,
    {
        let known = self.error.iter().chain(self.between.iter());
        let sizes = known.copied().all(|size| size >= 0.0 && size.is_finite());
        if !(self.t_s > 0.0 && self.t_s.is_finite() && self.substeps > 0 && sizes) {
            return Err(RolloutError::Numbers);
        }
        if model.period().is_some() {
            return Err(RolloutError::DiscreteTime);
        }
        let (x, u) = (SVector::<f64, NX>::zeros(), SVector::<f64, NU>::zeros());
        let rest = model.scheduling(&x.map(Interval::point), &u.map(Interval::point));
        if model.offset(&rest).is_some() {
            return Err(RolloutError::AffineTerm);
        }
        let sides = |bounds: (f64, f64)| bounds.0.abs().max(bounds.1.abs());
        let states = (0..NX).map(|i| (Place::State(i), (self.x.lower[i], self.x.upper[i])));
        let inputs = (0..NU).map(|i| (Place::Input(i), (self.u.lower[i], self.u.upper[i])));
        let mut variables = Vec::new();
        for (place, bounds) in states.chain(inputs) {
            let is_range = bounds.0 <= bounds.1;
            let limit = sides(bounds);
            let free = bounds == (f64::NEG_INFINITY, f64::INFINITY);
            match place {
                Place::State(_) if free => {}
                _ if is_range && limit > 0.0 && limit.is_finite() => {
                    variables.push(Variable { place, limit })
                }
                _ => return Err(RolloutError::Numbers),
            }
        }
        let needed = variables.len() + 1;
        if needed != D {
            return Err(RolloutError::Dimension { given: D, needed });
        }
        Ok(variables)
    }

    /// State and input in the middle of a cell, roughly.
    fn start<M, const D: usize>(
        &self,
        rays: &Rays<'_, M>,
        at: &SVector<f64, D>,
    ) -> (Vec<f64>, Vec<f64>) {
        let (mut x, mut u) = (vec![0.0; NX], vec![0.0; NU]);
        let share = at[rays.face];
        for (j, variable) in rays.variables.iter().enumerate() {
            let value = share * variable.limit * if j == rays.face { rays.side } else { at[j] };
            match variable.place {
                Place::State(i) => x[i] = value,
                Place::Input(i) => u[i] = value,
            }
        }
        (x, u)
    }
}
