//! What defines a guaranteed controller besides its model.

use crate::memory::Capacity;
use crate::model::{LpvModel, Scalar};
use crate::ocp::Bounds;
use crate::predictor::Rk4;
use crate::settings::ControllerError;
use crate::settings::{Weights, check_bounds, check_horizon, check_weight};
use crate::solver_settings::SolverSettings;
use core::fmt;
use nalgebra::{SMatrix, SVector, convert};

/// A terminal law with a set that it keeps: for every state with (x - z d)'P (x - z d) <= level,
/// u = -K (x - z d) held for one sample stays within all bounds, leads into the set again, and
/// lowers the terminal cost by at least the stage cost. Whether it does is for a certificate to
/// say (`ballbot certify`); the controller takes it at its word.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TerminalSet<T, const NX: usize, const NU: usize> {
    /// K, `NU` x `NX`, for u = -K (x - z d).
    pub gain: SMatrix<T, NU, NX>,
    /// P, `NX` x `NX`, symmetric positive definite, in the unit of the cost.
    pub p: SMatrix<T, NX, NX>,
    /// Largest terminal cost in the set, > 0.
    pub level: T,
}

impl<T: Scalar, const NX: usize, const NU: usize> TerminalSet<T, NX, NU> {
    /// The largest |z| for which z `direction` lies in the set.
    pub(super) fn extent(&self, direction: &SVector<T, NX>) -> T {
        (self.level / (self.p * direction).dot(direction)).sqrt()
    }
}

/// Quadratic programs per sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GuaranteedIterations {
    /// With the rest of a plan at hand; with 0 the rest is what is applied.
    pub known: usize,
    /// Without one (at the start, after a push), at least 1: they look for a plan, and go on to the
    /// best one.
    pub unknown: usize,
}

/// How plans are rolled out, and what is known of it. The bounds are for motions within the bounds of
/// states and inputs; what they rest on is for whoever computes them to say.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rollout<T, const NX: usize> {
    /// Runge-Kutta steps of a sample.
    pub rk4: Rk4,
    /// W, half axes in its columns: plant and rollout differ after one sample from (x, u) by W v, with |v_j| at most
    /// [`share_of_bounds`] of it, in state units: without motion there is no error. A diagonal W bounds each
    /// component by itself; what all errors have in common is for the axes to follow.
    pub error: SMatrix<T, NX, NX>,
    /// How far a state may lie beyond its values at both ends of a Runge-Kutta step, in state units,
    /// not negative.
    pub between: SVector<T, NX>,
}

/// The largest |x_i| or |u_j| as a share of its bounds, the larger one of both in size: 0 for nothing,
/// 1 where one is met. What is unbounded or bounded by 0 alone does not count.
pub fn share_of_bounds<T: Scalar, const NX: usize, const NU: usize>(
    x: &SVector<T, NX>,
    x_bounds: &Bounds<T, NX>,
    u: &SVector<T, NU>,
    u_bounds: &Bounds<T, NU>,
) -> T {
    largest_share(x, x_bounds).max(largest_share(u, u_bounds))
}

fn largest_share<T: Scalar, const K: usize>(v: &SVector<T, K>, bounds: &Bounds<T, K>) -> T {
    let sides = bounds.lower.iter().zip(bounds.upper.iter());
    let shares = v.iter().zip(sides).map(|(value, (lower, upper))| {
        let size = lower.abs().max(upper.abs());
        let share = value.abs() / size;
        if size > T::zero() && share.is_finite() {
            share
        } else {
            T::zero()
        }
    });
    shares.fold(T::zero(), T::max)
}

/// Everything that defines a guaranteed controller besides its model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GuaranteedSettings<T, const NX: usize, const NU: usize> {
    /// Sampling time in seconds.
    pub t_s: T,
    /// Prediction horizon in samples, at least 1.
    pub horizon: usize,
    /// Runge-Kutta steps of the prediction, along which quadratic programs are made.
    pub rk4: Rk4,
    /// The rollout by which plans are judged.
    pub rollout: Rollout<T, NX>,
    /// Stage weights.
    pub weights: Weights<T, NX, NU>,
    /// Terminal law and set.
    pub terminal: TerminalSet<T, NX, NU>,
    /// State bounds, at the stages 1 to N.
    pub x: Bounds<T, NX>,
    /// Input bounds.
    pub u: Bounds<T, NU>,
    /// d, with A(scheduling) d = 0 and sigma(x + z d) = sigma(x): every state z d, without input,
    /// is an equilibrium, and the plant is the same around each of them.
    pub direction: SVector<T, NX>,
    /// The admissible set points z, [lower, upper]; infinite where there is no bound. The
    /// terminal set around each of them must lie within the state bounds.
    pub set_points: [T; 2],
    /// Cost of (z - wanted)^2, > 0. Large against the stage weights, so that the set point
    /// moves on as fast as the bounds allow.
    pub offset_weight: T,
    /// Part of the bounds' width that programs keep away from them, so that their rollouts hold
    /// with what is added for the integration error; 4e-3, say.
    pub margin: T,
    /// Quadratic programs per sample.
    pub iterations: GuaranteedIterations,
    /// Linear price of soft state bounds, per width of the bound; quadratic is as much.
    pub soft_price: T,
    /// Settings of the solver.
    pub solver: SolverSettings<T>,
}

/// A mistake in the [`GuaranteedSettings`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum GuaranteedError {
    /// A mistake that a controller without a guarantee would have, too.
    Controller(ControllerError),
    /// This number must be positive and finite.
    NotPositive(&'static str),
    /// The gain contains a number that is not finite.
    Gain,
    /// The rollout has no steps, or its bounds are negative or not finite.
    Rollout,
    /// The direction is zero, not finite, or the plant notices where along it it stands: somewhere
    /// within the state bounds A d is not zero, or the scheduling moves with z d.
    Direction,
    /// No number is between the lower and the upper set point, or one of them is NaN.
    SetPoints,
    /// Without a plan, at least one quadratic program per sample is needed.
    Iterations,
}

impl fmt::Display for GuaranteedError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Controller(error) => error.fmt(f),
            Self::NotPositive(name) => write!(f, "{name} must be a positive number"),
            Self::Gain => write!(f, "the gain of the terminal law must be finite"),
            Self::Rollout => write!(
                f,
                "the rollout needs a step, and bounds of its errors that are finite and not negative"
            ),
            Self::Direction => write!(
                f,
                "the direction of the set points must be a finite, nonzero d with A d = 0 and a \
                 scheduling that is the same at x and x + z d, everywhere within the state bounds"
            ),
            Self::SetPoints => {
                write!(f, "the set points must have a number between their ends")
            }
            Self::Iterations => write!(
                f,
                "a sample without a plan needs at least one quadratic program"
            ),
        }
    }
}

impl core::error::Error for GuaranteedError {}

impl From<ControllerError> for GuaranteedError {
    fn from(error: ControllerError) -> Self {
        Self::Controller(error)
    }
}

impl<T: Scalar, const NX: usize, const NU: usize> GuaranteedSettings<T, NX, NU> {
    /// What the quadratic program of a controller with these settings needs: two stages more than the
    /// horizon, and room for every bound that can be active at once.
    pub fn capacity(&self) -> Capacity {
        let sides = self.x.lower.iter().zip(self.x.upper.iter());
        let bounded = sides.filter(|(lower, upper)| lower.is_finite() || upper.is_finite());
        let stages = self.horizon + 2;
        let soft = self.horizon * bounded.count() + NX;
        let rows = stages * NU + soft;
        Capacity {
            stages,
            rows,
            active: rows + soft + (stages + 1) * NX,
            ..Capacity::default()
        }
    }

    /// `largest` is the longest horizon that there is memory for.
    pub(super) fn check<P, const NS: usize>(
        &self,
        model: &P,
        largest: usize,
    ) -> Result<(), GuaranteedError>
    where
        P: LpvModel<T, NX, NU, NS>,
    {
        check_horizon(self.horizon, largest)?;
        let positive = [
            (self.t_s, "the sampling time in seconds"),
            (self.terminal.level, "the level of the terminal set"),
            (self.offset_weight, "the offset weight"),
            (self.margin, "the margin"),
            (self.soft_price, "the price of soft bounds"),
            (self.solver.tolerance, "the solver's tolerance"),
        ];
        for (value, name) in positive {
            if !(value > T::zero() && value.is_finite()) {
                return Err(GuaranteedError::NotPositive(name));
            }
        }
        if self.rk4.substeps == 0 {
            return Err(ControllerError::Substeps.into());
        }
        check_weight(&self.weights.q, "Q", T::default_epsilon())?;
        check_weight(&self.weights.r, "R", T::zero())?;
        check_weight(&self.terminal.p, "P", T::zero())?;
        check_bounds(&self.x, "state")?;
        check_bounds(&self.u, "input")?;
        if !self.terminal.gain.iter().all(|entry| entry.is_finite()) {
            return Err(GuaranteedError::Gain);
        }
        let Rollout {
            rk4,
            error,
            between,
        } = &self.rollout;
        let known = error.iter().chain(between.iter()).all(|v| v.is_finite());
        if rk4.substeps == 0 || !known || between.iter().any(|v| *v < T::zero()) {
            return Err(GuaranteedError::Rollout);
        }
        let [lower, upper] = self.set_points;
        let infinite: T = convert(f64::INFINITY);
        if !(lower <= upper && lower < infinite && upper > -infinite) {
            return Err(GuaranteedError::SetPoints);
        }
        if self.iterations.unknown == 0 {
            return Err(GuaranteedError::Iterations);
        }
        self.check_direction(model)
    }

    /// A d = 0 and sigma(x + z d, u) = sigma(x, u), at points spread over the bounds: the plant does
    /// not notice where along d it stands (assumption 4 of `docs/guarantees.md`). Samples, no proof.
    fn check_direction<P, const NS: usize>(&self, model: &P) -> Result<(), GuaranteedError>
    where
        P: LpvModel<T, NX, NU, NS>,
    {
        let d = &self.direction;
        let size = d.amax();
        let finite = d.iter().all(|entry| entry.is_finite());
        let mut holds = finite && size > T::zero();
        let extent = self.terminal.extent(d);
        let [lower, upper] = self.set_points;
        let moves = [lower, upper, extent, extent * convert(-1.618)];
        for point in 0..CORNERS + INNER_POINTS {
            let x = sample(&self.x, point);
            let u = sample(&self.u, point);
            let scheduling = model.scheduling(&x, &u);
            let (a, _) = model.matrices(&scheduling);
            let rounding = a.amax() * size * T::default_epsilon();
            // So that NaN fails.
            holds &= (a * d).iter().all(|rate| rate.abs() <= rounding);
            for z in moves.into_iter().filter(|z| z.is_finite()) {
                let moved = model.scheduling(&(x + d * z), &u) - scheduling;
                let largest = x.amax() + z.abs() * size + scheduling.amax();
                let rounding = largest * T::default_epsilon() * convert(16.0);
                holds &= moved.iter().all(|change| change.abs() <= rounding);
            }
        }
        if holds {
            Ok(())
        } else {
            Err(GuaranteedError::Direction)
        }
    }
}

/// Corners of the state bounds that are looked at: all of them, up to six states.
const CORNERS: usize = 64;
/// Points between them.
const INNER_POINTS: usize = 64;

/// A point of the box: the corners by their number in binary, then others by multiples of the golden
/// ratio (Weyl). A side without bound is taken to be 2 units from the other one, or from -1 to 1.
fn sample<T: Scalar, const NX: usize>(bounds: &Bounds<T, NX>, point: usize) -> SVector<T, NX> {
    let width: T = convert(2.0);
    SVector::from_fn(|i, _| {
        let (lower, upper) = (bounds.lower[i], bounds.upper[i]);
        let (lower, upper) = match (lower.is_finite(), upper.is_finite()) {
            (true, true) => (lower, upper),
            (true, false) => (lower, lower + width),
            (false, true) => (upper - width, upper),
            (false, false) => (-T::one(), T::one()),
        };
        let share = if point < CORNERS {
            f64::from((point >> (i % 6)) as u32 & 1)
        } else {
            let turns = 0x9e37_79b9_u32.wrapping_mul(2 * i as u32 + 1);
            f64::from(turns.wrapping_mul(point as u32)) / f64::from(u32::MAX)
        };
        let share: T = convert(share);
        lower * (T::one() - share) + upper * share
    })
}
