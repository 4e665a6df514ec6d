//! From a problem to a certificate.

use super::certificate::{Certificate, QuadraticClaim, Record, TerminalClaim};
use super::proof::{ClaimError, Proof};
use super::quadratic;
use super::synthesis::{SynthesisError, TerminalIngredients, TerminalProblem, synthesize_terminal};
use crate::enclosure::AnalyticModel;
use crate::stability::{FrozenError, SchedulingGrid};
use lpvmpc::LpvModel;
use nalgebra::SVector;
use thiserror::Error;

/// What a certificate is asked for.
#[derive(Debug, Clone, PartialEq)]
pub struct CertificateProblem<const NX: usize, const NU: usize, const NS: usize> {
    /// The terminal ingredients. Its state limits must keep the scheduling within its own.
    pub terminal: TerminalProblem<NX, NU>,
    /// The state limits that are claimed, also between samples; at least those of `terminal`.
    pub state_limits: SVector<f64, NX>,
    /// |s_i| <= `scheduling_limits[i]`.
    pub scheduling_limits: SVector<f64, NS>,
    /// Program and version.
    pub written_by: String,
}

/// There is no certificate.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum CertifyError {
    /// The scheduling limits are no box.
    #[error(transparent)]
    Box(#[from] FrozenError),
    /// No terminal ingredients.
    #[error(transparent)]
    Synthesis(#[from] SynthesisError),
    /// The terminal law has no common Lyapunov function in continuous time.
    #[error(
        "no common P shows that A - BK is stable while the scheduling moves in the box; a \
         smaller box may have one"
    )]
    NoCommonLyapunov,
    /// What was designed could not be proved.
    #[error(transparent)]
    Claim(#[from] ClaimError),
}

/// Points of the design's grid along each scheduling.
const GRID_POINTS: usize = 7;
/// The contraction that is claimed, of the one that was designed: the rest is left to the proof.
const CLAIMED_SHARE: f64 = 0.01;
/// The limits are met to rounding by the design, and with this by the claim.
const INSIDE: f64 = 1.0 - 1e-6;
/// The rate that is claimed, of the one that was designed.
const RATE_SHARE: f64 = 0.5;

impl<const NX: usize, const NU: usize, const NS: usize> CertificateProblem<NX, NU, NS> {
    /// The terminal ingredients alone, designed at the points of a grid, without any proof.
    ///
    /// # Errors
    /// No ingredients at the points of the grid.
    pub fn design<M>(&self, model: &M) -> Result<TerminalIngredients<NX, NU>, CertifyError>
    where
        M: LpvModel<f64, NX, NU, NS>,
    {
        Ok(synthesize_terminal(model, &self.grid()?, &self.terminal)?)
    }

    fn grid(&self) -> Result<SchedulingGrid<NS>, FrozenError> {
        let limits = self.scheduling_limits;
        SchedulingGrid::new(-limits, limits, [GRID_POINTS; NS])
    }
}

/// Designs terminal ingredients for `model`, and proves them; at most `most_boxes` boxes are
/// looked at, and `progress` hears which share of the proof is done.
///
/// # Errors
/// No ingredients at the points of the grid, or no proof.
pub fn certify_terminal<M, Plant, const NX: usize, const NU: usize, const NS: usize>(
    (model, plant): (&M, Plant),
    problem: &CertificateProblem<NX, NU, NS>,
    most_boxes: usize,
    progress: &dyn Fn(f64),
) -> Result<(Certificate<Plant, NX, NU, NS>, Proof<NX>), CertifyError>
where
    M: LpvModel<f64, NX, NU, NS>,
    Plant: AnalyticModel<NX, NU, NS> + Sync,
{
    let terminal = &problem.terminal;
    let ingredients = problem.design(model)?;
    let scale = ingredients
        .p
        .diagonal()
        .map(|p| (terminal.level / p).sqrt());
    let (p, rate) = quadratic::synthesize(model, &problem.grid()?, &ingredients.k, &scale)
        .ok_or(CertifyError::NoCommonLyapunov)?;
    let mut certificate = Certificate {
        written_by: problem.written_by.clone(),
        plant,
        t_s: terminal.t_s,
        q: terminal.q,
        r: terminal.r,
        state_limits: problem.state_limits,
        input_limits: terminal.input_limits,
        scheduling_limits: problem.scheduling_limits,
        terminal: TerminalClaim {
            k: ingredients.k,
            p: ingredients.p,
            level: ingredients.level * INSIDE,
            contraction: terminal.contraction * CLAIMED_SHARE,
        },
        continuous: QuadraticClaim {
            p,
            rate_1_s: rate * RATE_SHARE,
        },
        record: Record::default(),
    };
    let proof = certificate.prove(&certificate.plant, most_boxes, progress)?;
    certificate.record = Record {
        boxes: proof.boxes,
        smallest_contraction: proof.smallest_contraction,
        scheduling_boxes: proof.scheduling_boxes,
    };
    Ok((certificate, proof))
}
