//! From a problem to a certificate.

use super::certificate::{Certificate, QuadraticClaim, Record, TerminalClaim};
use super::claim::ClaimError;
use super::proof::Proof;
use super::quadratic;
use super::sampled::SampledClaim;
use super::synthesis::{SynthesisError, TerminalIngredients, TerminalProblem, synthesize_terminal};

use lpvmpc::{Embedding, LpvModel};
use lpvmpc_design::{FrozenError, SchedulingGrid};
use nalgebra::{SMatrix, SVector};
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
        let grid = grid(&self.scheduling_limits)?;
        Ok(synthesize_terminal(model, &grid, &self.terminal)?)
    }
}

/// Designs terminal ingredients for the `plant`, and proves them; at most `most_boxes` boxes are
/// looked at, and `progress` hears which share of the proof is done.
///
/// # Errors
/// No ingredients at the points of the grid, or no proof.
pub fn certify_terminal<Plant, const NX: usize, const NU: usize, const NS: usize>(
    plant: Plant,
    problem: &CertificateProblem<NX, NU, NS>,
    most_boxes: usize,
    progress: &dyn Fn(f64),
) -> Result<(Certificate<Plant, NX, NU, NS>, Proof<NX>), CertifyError>
where
    Plant: Embedding<NX, NU, NS> + Sync,
{
    let terminal = &problem.terminal;
    let ingredients = problem.design(&plant)?;
    let limits = problem.scheduling_limits;
    let continuous = continuous(
        &plant,
        &limits,
        &ingredients.k,
        &ingredients.p,
        terminal.level,
    )?;
    let symmetric = |m: &SMatrix<f64, NX, NX>| (m + m.transpose()) * 0.5;
    let certificate = Certificate {
        written_by: problem.written_by.clone(),
        plant,
        t_s: terminal.t_s,
        q: symmetric(&terminal.q),
        r: (terminal.r + terminal.r.transpose()) * 0.5,
        state_limits: problem.state_limits,
        input_limits: terminal.input_limits,
        scheduling_limits: limits,
        terminal: TerminalClaim {
            k: ingredients.k,
            p: ingredients.p,
            level: ingredients.level * INSIDE,
            contraction: terminal.contraction * CLAIMED_SHARE,
        },
        continuous,
        record: Record::default(),
    };
    let proof = certificate.prove(&certificate.plant, most_boxes, progress)?;
    Ok((certificate.with(&proof), proof))
}

/// The claim of quadratic stability in a box of schedulings.
fn continuous<M, const NX: usize, const NU: usize, const NS: usize>(
    model: &M,
    limits: &SVector<f64, NS>,
    k: &SMatrix<f64, NU, NX>,
    p: &SMatrix<f64, NX, NX>,
    level: f64,
) -> Result<QuadraticClaim<NX>, CertifyError>
where
    M: LpvModel<f64, NX, NU, NS>,
{
    let scale = p.diagonal().map(|p| (level / p).sqrt());
    let (p, rate) = quadratic::synthesize(model, &grid(limits)?, k, &scale)
        .ok_or(CertifyError::NoCommonLyapunov)?;
    Ok(QuadraticClaim {
        p,
        rate_1_s: rate * RATE_SHARE,
    })
}

impl<Plant, const NX: usize, const NU: usize, const NS: usize> Certificate<Plant, NX, NU, NS> {
    /// With what the proof found: its record, and limits of the states as tight as they were shown,
    /// so that the claim fits into as many other bounds as it can.
    fn with(mut self, proof: &Proof<NX>) -> Self {
        self.record = Record {
            boxes: proof.boxes,
            smallest_contraction: proof.smallest_contraction,
            scheduling_boxes: proof.scheduling_boxes,
        };
        self.state_limits = self.state_limits.zip_map(&proof.reach, |limit, reach| {
            limit.min(reach * (2.0 - INSIDE))
        });
        self
    }
}

/// How much work it is worth to raise the level of a certificate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Effort {
    /// Levels that are tried.
    pub trials: usize,
    /// Boxes of states that the proof at one level may look at.
    pub most_boxes: usize,
}

/// The certificate with the same K and P and the highest level that was proved: what is designed
/// for a box of schedulings holds in a larger set, as a rule. The scheduling limits and the claim
/// in continuous time grow with the set; `problem` says which limits it may not exceed. Each trial
/// is a proof, by halves (in ratio) between what is proved and what cannot be; `progress` hears the
/// trial, counted from 0, and which share of it is done. Returns what was handed in where no higher
/// level could be proved.
pub fn raise_level<Plant, const NX: usize, const NU: usize, const NS: usize>(
    problem: &CertificateProblem<NX, NU, NS>,
    proved: (Certificate<Plant, NX, NU, NS>, Proof<NX>),
    effort: Effort,
    progress: &dyn Fn(usize, f64),
) -> (Certificate<Plant, NX, NU, NS>, Proof<NX>)
where
    Plant: Embedding<NX, NU, NS> + Clone + Sync,
{
    let base = Certificate {
        state_limits: problem.state_limits,
        ..proved.0.clone()
    };
    let mut best = proved;
    let (mut low, mut high) = (
        1.0,
        base.sampled().highest_factor(&base.plant, &best.1.reach),
    );
    for trial in 0..effort.trials {
        if high < low * WORTH_IT {
            break;
        }
        let factor = f64::sqrt(low * high);
        let heard = |share| progress(trial, share);
        match base.raised(factor, effort.most_boxes, &heard) {
            Ok(found) => {
                low = factor;
                best = found;
            }
            Err(_) => high = factor,
        }
    }
    best
}

/// A level that is higher by less is not worth a proof.
const WORTH_IT: f64 = 1.05;
/// No level higher than this many times is looked at.
const MOST_FACTOR: f64 = 1e3;
/// Levels that samples are looked at for, before any proof.
const SAMPLED_LEVELS: usize = 10;

impl<const NX: usize, const NU: usize> SampledClaim<NX, NU> {
    /// The factor of the level from which on there is no proof for `model`: a limit is in the way, or the matrix
    /// inequality is violated at a sampled state. Where the states go grows with the root; `reach` is where they go
    /// at the level.
    pub fn highest_factor<M, const NS: usize>(&self, model: &M, reach: &SVector<f64, NX>) -> f64
    where
        M: Embedding<NX, NU, NS> + Sync,
    {
        let states = self.state_limits.iter().zip(reach.iter());
        let states = states.map(|(limit, reach)| (limit / reach).powi(2));
        let inputs = self.input_reach();
        let inputs = self.input_limits.iter().zip(inputs.iter());
        let inputs = inputs.map(|(limit, reach)| (limit / reach).powi(2));
        let limited = states.chain(inputs).fold(MOST_FACTOR, f64::min);
        let holds = |factor: f64| {
            let level = self.terminal.level * factor;
            self.tightest_at(model, level)
                .is_some_and(|excess| excess < 0.0)
        };
        if holds(limited) {
            return limited;
        }
        let (mut low, mut high) = (1.0, limited);
        for _ in 0..SAMPLED_LEVELS {
            let middle = f64::sqrt(low * high);
            if holds(middle) {
                low = middle;
            } else {
                high = middle;
            }
        }
        high
    }
}

impl<Plant, const NX: usize, const NU: usize, const NS: usize> Certificate<Plant, NX, NU, NS>
where
    Plant: Embedding<NX, NU, NS> + Clone + Sync,
{
    /// The same claims with a level that is `factor` times as high, in the limits of the schedulings
    /// that this takes; proved.
    fn raised(
        &self,
        factor: f64,
        most_boxes: usize,
        progress: &dyn Fn(f64),
    ) -> Result<(Self, Proof<NX>), CertifyError> {
        let mut raised = self.clone();
        raised.terminal.level *= factor;
        raised.scheduling_limits = raised.scheduling_reach(&self.plant)?;
        let TerminalClaim { k, p, level, .. } = &raised.terminal;
        raised.continuous = continuous(&raised.plant, &raised.scheduling_limits, k, p, *level)?;
        let proof = raised.prove(&raised.plant, most_boxes, progress)?;
        Ok((raised.with(&proof), proof))
    }
}

fn grid<const NS: usize>(limits: &SVector<f64, NS>) -> Result<SchedulingGrid<NS>, FrozenError> {
    SchedulingGrid::new(-limits, *limits, [GRID_POINTS; NS])
}
