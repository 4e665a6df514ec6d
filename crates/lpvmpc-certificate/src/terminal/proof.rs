//! The proof of a certificate's claims, from its numbers alone.

use super::certificate::Certificate;
use super::claim::ClaimError;
use super::cover::{Covered, Uncovered, cover};
use super::decrease::{Decrease, allowed};
use super::ellipsoid::Ellipsoid;
use super::normalised::{Normaliser, from_fn};
use super::quadratic;
use crate::enclosure::{Interval, SampledLaw};
use lpvmpc::Embedding;
use nalgebra::SVector;
use std::sync::{Mutex, PoisonError};

/// What a proof found, beyond that the claims hold.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Proof<const NX: usize> {
    /// Boxes of initial states on which the decrease was proved.
    pub boxes: usize,
    /// The smallest contraction that a box would have carried, estimated.
    pub smallest_contraction: f64,
    /// Boxes of schedulings on which quadratic stability was proved.
    pub scheduling_boxes: usize,
    /// Where the states are at and between the samples, at most; state units.
    pub reach: SVector<f64, NX>,
}

/// Changes whenever a proof could come to another answer than before: what was proved by another
/// revision is to be proved again.
pub const PROOF_REVISION: u32 = 2;
/// Boxes that a proof may take.
pub const MOST_BOXES: usize = 100_000;
/// 2^3 time steps with a remainder of order 6: what proves the ballbot fastest.
const HALVINGS: u8 = 3;

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
        let (ellipsoid, normaliser) = self.set()?;
        self.check_limits(model, &ellipsoid)?;
        let stable = self.prove_quadratic_stability(model)?;
        let decrease = self.decrease(model, normaliser, ellipsoid);
        // First of all, so that what is false does not wait for the boxes to run out.
        refute(&decrease, &[])?;
        let whole = decrease.ellipsoid.bounding_cell();
        let covered = cover(whole, most_boxes, |cell| decrease.examine(cell), progress);
        let covered = match covered {
            Ok(covered) => covered,
            Err(Uncovered::False { at }) => return Err(not_shown(&decrease, at, 0)),
            Err(Uncovered::Undecided { at, cells }) => {
                refute(&decrease, &[at])?;
                return Err(not_shown(&decrease, at, cells));
            }
        };
        let during = decrease
            .states
            .into_inner()
            .unwrap_or_else(PoisonError::into_inner);
        let reach = SVector::from_fn(|i, _| during[i].magnitude());
        for i in 0..NX {
            let limit = self.state_limits[i];
            let kept = reach[i] <= limit;
            if !kept {
                return Err(ClaimError::LimitNotShown {
                    name: format!("state_limits[{i}], between samples"),
                    reach: reach[i],
                    limit,
                });
            }
        }
        Ok(Proof {
            boxes: covered.cells,
            smallest_contraction: self.terminal.contraction + covered.spare,
            scheduling_boxes: stable.cells,
            reach,
        })
    }

    /// The set, and coordinates for it.
    fn set(&self) -> Result<(Ellipsoid<NX>, Normaliser<NX>), ClaimError> {
        let normaliser = Normaliser::of(&self.terminal.p)
            .ok_or(ClaimError::NotPositive { name: "terminal.p" })?;
        let set = Ellipsoid::new(self.terminal.p, self.terminal.level, normaliser);
        Ok((set, normaliser))
    }

    /// The largest |u_i| in the set; infinite where it could not be shown.
    pub(super) fn input_reach(&self) -> SVector<f64, NU> {
        let set = self.set();
        SVector::from_fn(|i, _| match &set {
            Ok((set, _)) => set.bound(&self.terminal.k.row(i).transpose()),
            Err(_) => f64::INFINITY,
        })
    }

    /// The smallest box of schedulings that the set was shown to lie in.
    pub(super) fn scheduling_reach<M>(&self, model: &M) -> Result<SVector<f64, NS>, ClaimError>
    where
        M: Embedding<NX, NU, NS> + Sync,
    {
        let (set, _) = self.set()?;
        let states = SVector::from_fn(|i, _| symmetric(set.bound(&axis(i))));
        let inputs = self.input_reach().map(symmetric);
        let scheduling = model.scheduling(&states, &inputs);
        Ok(SVector::from_fn(|i, _| scheduling[i].magnitude()))
    }

    /// The largest violation of the matrix inequality that samples of the set show, were `level` its
    /// level; below zero where there is none.
    pub(super) fn tightest_at(&self, level: f64) -> Option<f64>
    where
        Plant: Embedding<NX, NU, NS> + Sync,
    {
        let (_, normaliser) = self.set().ok()?;
        let set = Ellipsoid::new(self.terminal.p, level, normaliser);
        Some(self.decrease(&self.plant, normaliser, set).tightest())
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

    /// The limits hold wherever x'Px <= level.
    fn check_limits<M>(&self, model: &M, ellipsoid: &Ellipsoid<NX>) -> Result<(), ClaimError>
    where
        M: Embedding<NX, NU, NS> + Sync,
    {
        let mut box_of_states = SVector::<_, NX>::repeat(Interval::EVERYTHING);
        for (i, range) in box_of_states.iter_mut().enumerate() {
            let name = || format!("state_limits[{i}]");
            let reach = check_row(ellipsoid, &axis(i), self.state_limits[i], &name)?;
            *range = symmetric(reach);
        }
        let mut box_of_inputs = SVector::<_, NU>::repeat(Interval::EVERYTHING);
        for (i, range) in box_of_inputs.iter_mut().enumerate() {
            let row = self.terminal.k.row(i).transpose();
            let name = || format!("input_limits[{i}]");
            let reach = check_row(ellipsoid, &row, self.input_limits[i], &name)?;
            *range = symmetric(reach);
        }
        if model.period().is_some() {
            return Err(ClaimError::DiscreteTime);
        }
        let scheduling = model.scheduling(&box_of_states, &box_of_inputs);
        if model.offset(&scheduling).is_some() {
            return Err(ClaimError::AffineTerm);
        }
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

    fn decrease<'a, M>(
        &self,
        model: &'a M,
        normaliser: Normaliser<NX>,
        ellipsoid: Ellipsoid<NX>,
    ) -> Decrease<'a, M, NX, NU> {
        let terminal = &self.terminal;
        let allowed = allowed(
            &terminal.p,
            &self.q,
            &self.r,
            &terminal.k,
            terminal.contraction,
        );
        let allowed = normaliser.congruent(&allowed);
        // x+'P x+ <= unit.upper |G y|^2.
        let unit = crate::enclosure::Arithmetic::reciprocal(Interval::point(normaliser.unit.upper));
        Decrease {
            model,
            law: SampledLaw {
                k: terminal.k,
                t_s: self.t_s,
                halvings: HALVINGS,
            },
            normaliser,
            allowed: from_fn(|i, j| allowed[i][j] * unit),
            ellipsoid,
            states: Mutex::new([Interval::point(0.0); NX]),
        }
    }
}

fn axis<const N: usize>(i: usize) -> SVector<f64, N> {
    SVector::from_fn(|j, _| if i == j { 1.0 } else { 0.0 })
}

fn point<const N: usize>(values: &SVector<f64, N>) -> SVector<Interval, N> {
    values.map(Interval::point)
}

fn symmetric(reach: f64) -> Interval {
    Interval::new(-reach, reach)
}

/// Whether |row x| <= limit in the whole set; if so, what |row x| is at most.
fn check_row<const NX: usize>(
    ellipsoid: &Ellipsoid<NX>,
    row: &SVector<f64, NX>,
    limit: f64,
    name: &dyn Fn() -> String,
) -> Result<f64, ClaimError> {
    let reach = ellipsoid.bound(row);
    if reach <= limit {
        return Ok(reach);
    }
    let beyond = ellipsoid.beyond(row, limit);
    Err(limit_error(name(), reach, limit, beyond))
}

fn limit_error<const NX: usize>(
    name: String,
    reach: f64,
    limit: f64,
    beyond: Option<SVector<f64, NX>>,
) -> ClaimError {
    match beyond {
        Some(state) => ClaimError::Limit {
            name,
            reach,
            limit,
            state: state.as_slice().to_vec(),
        },
        None => ClaimError::LimitNotShown { name, reach, limit },
    }
}

/// An error if a state refutes the claimed decrease.
fn refute<M, const NX: usize, const NU: usize, const NS: usize>(
    decrease: &Decrease<'_, M, NX, NU>,
    near: &[SVector<f64, NX>],
) -> Result<(), ClaimError>
where
    M: Embedding<NX, NU, NS> + Sync,
{
    match decrease.counterexample(near) {
        Some((state, excess)) => Err(ClaimError::NoDecrease {
            state: state.as_slice().to_vec(),
            excess,
        }),
        None => Ok(()),
    }
}

fn not_shown<M, const NX: usize, const NU: usize>(
    decrease: &Decrease<'_, M, NX, NU>,
    at: SVector<f64, NX>,
    boxes: usize,
) -> ClaimError {
    ClaimError::DecreaseNotShown {
        state: decrease.normaliser.state(&at).as_slice().to_vec(),
        boxes,
    }
}
