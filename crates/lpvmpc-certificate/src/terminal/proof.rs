//! The proof of a certificate's claims, from its numbers alone.

use super::certificate::Certificate;
use super::claim::ClaimError;
use super::ellipsoid::Ellipsoid;
use super::normalised::Normaliser;
use super::quadratic;
use super::sampled::{BoxOfMotion, SampledClaim, axis, limit_error, point, symmetric};
use crate::cover::{Covered, Uncovered};
use lpvmpc::Embedding;
use nalgebra::SVector;

/// What a proof found, beyond that the claims hold.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Proof<const NX: usize> {
    /// Boxes of initial states on which the decrease was proved.
    pub boxes: usize,
    /// The smallest contraction that a box would have carried, estimated.
    pub smallest_contraction: f64,
    /// Boxes of schedulings on which quadratic stability was proved; 0 without such a claim.
    pub scheduling_boxes: usize,
    /// Where the states are at and between the samples, at most; state units. A plant in discrete time has nothing
    /// between them.
    pub reach: SVector<f64, NX>,
}

/// Changes whenever a proof could come to another answer than before: what was proved by another
/// revision is to be proved again.
pub const PROOF_REVISION: u32 = 4;
/// Boxes that a proof may take.
pub const MOST_BOXES: usize = 100_000;

impl<Plant, const NX: usize, const NU: usize, const NS: usize> Certificate<Plant, NX, NU, NS> {
    /// Proves every claim for `model`, which must be the plant with the certificate's parameters.
    /// No optimiser takes part, and nothing is taken from the run that wrote the certificate.
    /// `progress` hears which share is done; at most `most_boxes` boxes are looked at.
    ///
    /// # Errors
    /// The first claim that is false or could not be shown.
    pub fn prove<M>(
        &self,
        model: &M,
        most_boxes: usize,
        progress: &dyn Fn(f64),
    ) -> Result<Proof<NX>, ClaimError>
    where
        M: Embedding<NX, NU, NS> + Sync,
    {
        self.check_numbers()?;
        if model.period().is_some() {
            return Err(ClaimError::DiscreteTime);
        }
        let sampled = self.sampled();
        let (ellipsoid, normaliser) = sampled.set()?;
        let reach = sampled.check_limits(model, &ellipsoid)?;
        self.check_scheduling(model, &ellipsoid, &reach)?;
        let stable = self.prove_quadratic_stability(model)?;
        let proof = sampled.prove_decrease(model, (ellipsoid, normaliser), most_boxes, progress)?;
        Ok(Proof {
            scheduling_boxes: stable.cells,
            ..proof
        })
    }

    /// What it says of the sampled plant.
    pub(super) fn sampled(&self) -> SampledClaim<NX, NU> {
        SampledClaim {
            t_s: self.t_s,
            q: self.q,
            r: self.r,
            state_limits: self.state_limits,
            input_limits: self.input_limits,
            terminal: self.terminal.clone(),
            states: NX,
        }
    }

    /// The smallest box of schedulings that the set was shown to lie in.
    pub(super) fn scheduling_reach<M>(&self, model: &M) -> Result<SVector<f64, NS>, ClaimError>
    where
        M: Embedding<NX, NU, NS> + Sync,
    {
        let sampled = self.sampled();
        let (set, _) = sampled.set()?;
        let states = SVector::from_fn(|i, _| symmetric(set.bound(&axis(i))));
        let inputs = sampled.input_reach().map(symmetric);
        let scheduling = model.scheduling(&states, &inputs);
        Ok(SVector::from_fn(|i, _| scheduling[i].magnitude()))
    }

    fn prove_quadratic_stability<M>(&self, model: &M) -> Result<Covered, ClaimError>
    where
        M: Embedding<NX, NU, NS> + Sync,
    {
        let common = Normaliser::of(&self.continuous.p).ok_or(ClaimError::NotPositive {
            name: "continuous.p",
        })?;
        let rate = self.continuous.rate_1_s;
        let limits = &self.scheduling_limits;
        quadratic::prove(model, &self.terminal.k, &common, rate, limits).map_err(
            |open| match open {
                Uncovered::False { at } => ClaimError::NotQuadraticallyStable {
                    scheduling: at.as_slice().to_vec(),
                },
                Uncovered::Undecided { at, .. } => ClaimError::QuadraticStabilityNotShown {
                    scheduling: at.as_slice().to_vec(),
                },
            },
        )
    }

    /// So does the scheduling, where states and inputs are in the boxes `reach`.
    fn check_scheduling<M>(
        &self,
        model: &M,
        ellipsoid: &Ellipsoid<NX>,
        (states, inputs): &BoxOfMotion<NX, NU>,
    ) -> Result<(), ClaimError>
    where
        M: Embedding<NX, NU, NS> + Sync,
    {
        let scheduling = model.scheduling(states, inputs);
        for (i, range) in scheduling.iter().enumerate() {
            let (reach, limit) = (range.magnitude(), self.scheduling_limits[i]);
            if reach <= limit {
                continue;
            }
            let name = format!("scheduling_limits[{i}]");
            let farthest = (0..NX).filter_map(|j| ellipsoid.farthest(&axis(j)));
            let inside = farthest.map(|state| state * (1.0 - 1e-9));
            let mut beyond = inside.filter(|state| {
                let input = -(self.terminal.k * state);
                let scheduling = model.scheduling(&point(state), &point(&input))[i];
                let least = scheduling.lower.max(-scheduling.upper);
                ellipsoid.holds(state) && least > limit
            });
            return Err(limit_error(name, reach, limit, beyond.next()));
        }
        Ok(())
    }
}
