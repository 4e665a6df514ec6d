//! The proof of a certificate's claims, from its numbers alone.

use super::certificate::Certificate;
use super::cover::{Uncovered, cover};
use super::decrease::{Decrease, allowed};
use super::ellipsoid::Ellipsoid;
use super::normalised::{Normaliser, from_fn};
use super::quadratic;
use crate::enclosure::{AnalyticModel, Interval, SampledLaw};
use nalgebra::SVector;
use std::sync::{Mutex, PoisonError};
use thiserror::Error;

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

/// A claim that is false, or was not proved.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ClaimError {
    /// A number that cannot be.
    #[error("{name} = {value}: it must be {expected}")]
    Value {
        /// The key in the file.
        name: String,
        /// Its value.
        value: f64,
        /// What would be right.
        expected: &'static str,
    },
    /// A matrix that is not positive definite.
    #[error("{name} is not symmetric and positive definite")]
    NotPositive {
        /// The key in the file.
        name: &'static str,
    },
    /// The set is larger than a limit.
    #[error("{name}: the set reaches {reach}, the claimed limit is {limit}")]
    Limit {
        /// Key and component of the limit.
        name: String,
        /// The largest value in the set.
        reach: f64,
        /// The limit.
        limit: f64,
    },
    /// The decrease is false.
    #[error(
        "terminal: the claimed decrease of x'Px does not hold with this K, P, contraction and \
         plant: at the state {state:?} it misses by {excess:.1e} of x'Px"
    )]
    NoDecrease {
        /// The state, whose matrix inequality is violated.
        state: Vec<f64>,
        /// By so much.
        excess: f64,
    },
    /// The decrease was not decided.
    #[error(
        "terminal: the claimed decrease of x'Px could not be decided near the state {state:?} in \
         {boxes} boxes; a smaller set or more contraction in the design may help"
    )]
    Undecided {
        /// A state nearby.
        state: Vec<f64>,
        /// Boxes that were looked at.
        boxes: usize,
    },
    /// Quadratic stability is false or was not decided.
    #[error(
        "continuous: (A - BK)'P + P(A - BK) <= -2 rate P was not proved at the scheduling \
         {scheduling:?}"
    )]
    NotQuadraticallyStable {
        /// The scheduling.
        scheduling: Vec<f64>,
    },
}

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
    /// The first claim that does not hold or could not be proved.
    pub fn prove<M>(
        &self,
        model: &M,
        most_boxes: usize,
        progress: &dyn Fn(f64),
    ) -> Result<Proof<NX>, ClaimError>
    where
        M: AnalyticModel<NX, NU, NS> + Sync,
    {
        self.check_numbers()?;
        let positive = |name| move || ClaimError::NotPositive { name };
        let normaliser = Normaliser::of(&self.terminal.p).ok_or_else(positive("terminal.p"))?;
        let ellipsoid = Ellipsoid::new(self.terminal.p, self.terminal.level, normaliser);
        self.check_limits(model, &ellipsoid)?;
        let common = Normaliser::of(&self.continuous.p).ok_or_else(positive("continuous.p"))?;
        let stable = quadratic::prove(
            model,
            &self.terminal.k,
            &common,
            self.continuous.rate_1_s,
            &self.scheduling_limits,
        );
        let stable = stable.map_err(|open| match open {
            Uncovered::False { at, .. } | Uncovered::Undecided { at, .. } => {
                ClaimError::NotQuadraticallyStable {
                    scheduling: at.as_slice().to_vec(),
                }
            }
        })?;
        let decrease = self.decrease(model, normaliser, ellipsoid);
        let whole = decrease.ellipsoid.bounding_cell();
        let covered = cover(whole, most_boxes, |cell| decrease.examine(cell), progress);
        let state = |y: SVector<f64, NX>| decrease.normaliser.state(&y).as_slice().to_vec();
        let covered = covered.map_err(|open| match open {
            Uncovered::False { at, excess } => ClaimError::NoDecrease {
                state: state(at),
                excess,
            },
            Uncovered::Undecided { at, cells } => ClaimError::Undecided {
                state: state(at),
                boxes: cells,
            },
        })?;
        let during = decrease
            .states
            .into_inner()
            .unwrap_or_else(PoisonError::into_inner);
        let reach = SVector::from_fn(|i, _| during[i].magnitude());
        for i in 0..NX {
            check_limit(
                format!("state_limits[{i}], between samples"),
                reach[i],
                self.state_limits[i],
            )?;
        }
        Ok(Proof {
            boxes: covered.cells,
            smallest_contraction: self.terminal.contraction + covered.spare,
            scheduling_boxes: stable.cells,
            reach,
        })
    }

    fn check_numbers(&self) -> Result<(), ClaimError> {
        let numbers = [
            ("t_s".to_owned(), self.t_s),
            ("terminal.level".to_owned(), self.terminal.level),
            ("continuous.rate_1_s".to_owned(), self.continuous.rate_1_s),
        ];
        let limits = self.scheduling_limits.iter().enumerate();
        let limits = limits.map(|(i, limit)| (format!("scheduling_limits[{i}]"), *limit));
        for (name, value) in numbers.into_iter().chain(limits) {
            if !(value > 0.0 && value.is_finite()) {
                return Err(ClaimError::Value {
                    name,
                    value,
                    expected: "positive",
                });
            }
        }
        let contraction = self.terminal.contraction;
        if !(0.0..1.0).contains(&contraction) {
            return Err(ClaimError::Value {
                name: "terminal.contraction".to_owned(),
                value: contraction,
                expected: "from 0 to below 1",
            });
        }
        Normaliser::of(&self.r)
            .map(|_| ())
            .ok_or(ClaimError::NotPositive { name: "r" })
    }

    /// The limits hold wherever x'Px <= level.
    fn check_limits<M>(&self, model: &M, ellipsoid: &Ellipsoid<NX>) -> Result<(), ClaimError>
    where
        M: AnalyticModel<NX, NU, NS> + Sync,
    {
        let mut box_of_states = [Interval::EVERYTHING; NX];
        for (i, range) in box_of_states.iter_mut().enumerate() {
            let reach = ellipsoid.bound(&axis(i));
            check_limit(format!("state_limits[{i}]"), reach, self.state_limits[i])?;
            *range = Interval::new(-reach, reach);
        }
        for i in 0..NU {
            let row = self.terminal.k.row(i).transpose();
            check_limit(
                format!("input_limits[{i}]"),
                ellipsoid.bound(&row),
                self.input_limits[i],
            )?;
        }
        let scheduling = model.scheduling(&box_of_states);
        for (i, (range, limit)) in scheduling
            .iter()
            .zip(self.scheduling_limits.iter())
            .enumerate()
        {
            check_limit(format!("scheduling_limits[{i}]"), range.magnitude(), *limit)?;
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

fn check_limit(name: String, reach: f64, limit: f64) -> Result<(), ClaimError> {
    if reach <= limit {
        Ok(())
    } else {
        Err(ClaimError::Limit { name, reach, limit })
    }
}
