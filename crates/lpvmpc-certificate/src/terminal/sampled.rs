//! What is claimed of the sampled plant under the terminal law, and its proof.

use super::certificate::TerminalClaim;
use super::claim::ClaimError;
use super::decrease::{Decrease, allowed};
use super::ellipsoid::Ellipsoid;
use super::normalised::Normaliser;
use super::proof::Proof;
use crate::cover::{Uncovered, cover};
use crate::enclosure::{Interval, SampledLaw, from_fn};
use lpvmpc::Embedding;
use nalgebra::{SMatrix, SVector};
use std::sync::{Mutex, PoisonError};

/// The claims of a [`Certificate`](super::Certificate) about the sampled plant, without those about its
/// scheduling: the decrease of x'Px under u = **-K** x, held, and the limits, for every x with x'Px <= level.
#[derive(Debug, Clone, PartialEq)]
pub struct SampledClaim<const NX: usize, const NU: usize> {
    /// Sampling time, s; of a plant in discrete time its period.
    pub t_s: f64,
    /// Q of the stage cost x'Qx + u'Ru, symmetric, positive semidefinite.
    pub q: SMatrix<f64, NX, NX>,
    /// R of the stage cost, symmetric, positive definite.
    pub r: SMatrix<f64, NU, NU>,
    /// |x_i| <= `state_limits[i]`, at and between samples, state units; infinite for none.
    pub state_limits: SVector<f64, NX>,
    /// |u_i| <= `input_limits[i]`, input units.
    pub input_limits: SVector<f64, NU>,
    /// Law, cost and set.
    pub terminal: TerminalClaim<NX, NU>,
    /// So many states are there; the places behind them are left over, and zero in every state of the claim.
    /// P is zero between the two.
    pub states: usize,
}

/// Boxes of states and inputs.
pub(super) type BoxOfMotion<const NX: usize, const NU: usize> =
    (SVector<Interval, NX>, SVector<Interval, NU>);

/// 2^3 time steps with a remainder of order 6: what proves the ballbot fastest.
const HALVINGS: u8 = 3;

impl<const NX: usize, const NU: usize> SampledClaim<NX, NU> {
    /// Proves every claim for `model`, as [`Certificate::prove`](super::Certificate::prove) does; the
    /// [`Proof`] has no boxes of schedulings.
    ///
    /// # Errors
    /// The first claim that is false or could not be shown.
    pub fn prove<M, const NS: usize>(
        &self,
        model: &M,
        most_boxes: usize,
        progress: &dyn Fn(f64),
    ) -> Result<Proof<NX>, ClaimError>
    where
        M: Embedding<NX, NU, NS> + Sync,
    {
        self.check_numbers()?;
        let set = self.set()?;
        self.check_limits(model, &set.0)?;
        self.prove_decrease(model, set, most_boxes, progress)
    }

    /// The decrease, and the limits between the samples.
    pub(super) fn prove_decrease<M, const NS: usize>(
        &self,
        model: &M,
        (ellipsoid, normaliser): (Ellipsoid<NX>, Normaliser<NX>),
        most_boxes: usize,
        progress: &dyn Fn(f64),
    ) -> Result<Proof<NX>, ClaimError>
    where
        M: Embedding<NX, NU, NS> + Sync,
    {
        let decrease = self.decrease(model, normaliser, ellipsoid);
        // First of all, so that what is false does not wait for the boxes to run out.
        refute(&decrease, &[])?;
        let mut whole = decrease.ellipsoid.bounding_cell();
        for place in self.states..NX {
            whole.half_widths[place] = 0.0;
        }
        let covered = cover(whole, most_boxes, |cell| decrease.examine(cell), progress);
        let covered = match covered {
            Ok(covered) => covered,
            Err(Uncovered::False { at }) => return Err(not_shown(&decrease, at, 0)),
            Err(Uncovered::Undecided { at, cells }) => {
                refute(&decrease, &[at])?;
                return Err(not_shown(&decrease, at, cells));
            }
        };
        let reach = match model.period() {
            None => {
                let during = decrease.states.into_inner();
                let during = during.unwrap_or_else(PoisonError::into_inner);
                SVector::from_fn(|i, _| during[i].magnitude())
            }
            // No motion leads out of the set between two samples.
            Some(_) => SVector::from_fn(|i, _| decrease.ellipsoid.bound(&axis(i))),
        };
        let beyond = |i: &usize| {
            let kept = reach[*i] <= self.state_limits[*i];
            !kept
        };
        let over = |i: &usize| reach[*i] / self.state_limits[*i];
        let worst = { (0..NX).filter(beyond) }.max_by(|i, j| over(i).total_cmp(&over(j)));
        if let Some(i) = worst {
            return Err(ClaimError::LimitNotShown {
                name: format!("state_limits[{i}], between samples"),
                reach: reach[i],
                limit: self.state_limits[i],
            });
        }
        Ok(Proof {
            boxes: covered.cells,
            smallest_contraction: self.terminal.contraction + covered.spare,
            scheduling_boxes: 0,
            reach,
        })
    }

    /// The set, and coordinates for it.
    pub(super) fn set(&self) -> Result<(Ellipsoid<NX>, Normaliser<NX>), ClaimError> {
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

    /// The largest violation of the matrix inequality that samples of the set show, were `level` its
    /// level; below zero where there is none.
    pub(super) fn tightest_at<M, const NS: usize>(&self, model: &M, level: f64) -> Option<f64>
    where
        M: Embedding<NX, NU, NS> + Sync,
    {
        let (_, normaliser) = self.set().ok()?;
        let set = Ellipsoid::new(self.terminal.p, level, normaliser);
        Some(self.decrease(model, normaliser, set).tightest())
    }

    /// The limits hold wherever x'Px <= level, that is in boxes of states and inputs that are returned.
    pub(super) fn check_limits<M, const NS: usize>(
        &self,
        model: &M,
        ellipsoid: &Ellipsoid<NX>,
    ) -> Result<BoxOfMotion<NX, NU>, ClaimError>
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
        if let Some(period) = model.period()
            && period != self.t_s
        {
            let t_s = self.t_s;
            return Err(ClaimError::Period { t_s, period });
        }
        let scheduling = model.scheduling(&box_of_states, &box_of_inputs);
        if model.offset(&scheduling).is_some() {
            return Err(ClaimError::AffineTerm);
        }
        Ok((box_of_states, box_of_inputs))
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

pub(super) fn axis<const N: usize>(i: usize) -> SVector<f64, N> {
    SVector::from_fn(|j, _| if i == j { 1.0 } else { 0.0 })
}

pub(super) fn point<const N: usize>(values: &SVector<f64, N>) -> SVector<Interval, N> {
    values.map(Interval::point)
}

pub(super) fn symmetric(reach: f64) -> Interval {
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

pub(super) fn limit_error<const NX: usize>(
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
