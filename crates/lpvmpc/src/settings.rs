//! What defines a controller besides its model, and what can be wrong with it.

use crate::memory::Capacity;
use crate::model::Scalar;
use crate::ocp::{Bounds, SoftBounds};
use crate::predictor::{Predictor, Rk4, periods};
use crate::preview::PreviewMistake;
use crate::soft_bounds::exact_prices;
use crate::solver_settings::SolverSettings;
use core::fmt;
use nalgebra::{Cholesky, Const, SMatrix, SVector, convert};

/// Weights of the cost sum ||x - x_ref||_Q^2 + ||u - u_ref||_R^2 (eq. (7) of the paper, whose u_ref
/// is zero).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weights<T, const NX: usize, const NU: usize> {
    /// Q, `NX` x `NX`, symmetric positive semidefinite.
    pub q: SMatrix<T, NX, NX>,
    /// R, `NU` x `NU`, symmetric positive definite.
    pub r: SMatrix<T, NU, NU>,
}

/// What stands at the end of the horizon.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TerminalIngredient<T, const NX: usize> {
    /// The cost ||x_N - x_ref||_P^2 with P symmetric positive semidefinite.
    Cost(SMatrix<T, NX, NX>),
    /// x_N = x_ref, without terminal cost (eq. (9) of the paper).
    Equality,
}

/// Where the predictor's scheduling comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Scheduling<T, const NS: usize> {
    /// From the nonlinear rollout of the previous plan (Algorithm 2): LPV MPC.
    Predicted,
    /// Constant: linear MPC, the paper's comparison, with the scheduling of the equilibrium. Not with
    /// [`Iterations::Descent`], which follows the nonlinear model.
    Held(SVector<T, NS>),
}

/// The input u_ref that costs nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum InputReference<T, const NU: usize> {
    /// The input that holds the plant at the end of the reference, from the nonlinear model
    /// ([`LpvModel::steady_state`](crate::LpvModel::steady_state)), worked out whenever that changes.
    /// Where the plant cannot stand there within its bounds, a reference that is constant along the
    /// horizon is replaced by the nearest steady state; [`Controller::target`](crate::Controller::target)
    /// tells it. Without any, u_ref is zero.
    #[default]
    SteadyState,
    /// This one; zero in the paper.
    Given(SVector<T, NU>),
}

/// How many quadratic programs a sample gets. Each one is built along the plan of the one
/// before; the first, along the last sample's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Iterations<T> {
    /// So many, at least 1, each answer taken as it is; the paper takes 1.
    Fixed(usize),
    /// Each one an improvement: a descent on the cost of the nonlinear rollout, in which the answer
    /// of a program is taken as far as the cost falls, and not at all where it does not.
    Descent {
        /// No more programs after a full step that lowers the cost by less than this part of it (ten
        /// times that for the first program of a sample), or once one is expected to lower it by less
        /// than the square of this part.
        tolerance: T,
        /// At most so many, at least 1.
        most: usize,
        /// At most so many in a sample without a plan from the one before: in the first, after a reset, after a plan
        /// that was none. At least 1.
        first: usize,
    },
}

impl<T: Scalar> Default for Iterations<T> {
    /// A descent of at most eight programs to a hundred-thousandth of the cost.
    fn default() -> Self {
        Self::descent(convert(Self::TOLERANCE), Self::MOST)
    }
}

/// More programs than these are not counted.
const LARGEST: usize = u16::MAX as usize;

impl<T: Scalar> Iterations<T> {
    /// The tolerance of a descent where none is given.
    pub const TOLERANCE: f64 = 1e-5;
    /// Quadratic programs of a descent, at most, where no number is given.
    pub const MOST: usize = 8;

    /// A descent with so many programs in every sample, at most.
    pub const fn descent(tolerance: T, most: usize) -> Self {
        Self::Descent {
            tolerance,
            most,
            first: most,
        }
    }

    /// The largest number in a sample that has a plan from the one before.
    pub fn most(&self) -> usize {
        match self {
            Self::Fixed(most) | Self::Descent { most, .. } => *most,
        }
    }

    /// The largest number in a sample that has none.
    pub fn first(&self) -> usize {
        match self {
            Self::Fixed(first) | Self::Descent { first, .. } => *first,
        }
    }

    fn make_sense(&self) -> bool {
        let tolerance = match self {
            Self::Fixed(_) => T::one(),
            Self::Descent { tolerance, .. } => *tolerance,
        };
        let counts = [self.most(), self.first()];
        let counted = counts.iter().all(|most| (1..=LARGEST).contains(most));
        counted && tolerance > T::zero() && tolerance.is_finite()
    }
}

/// Everything that defines a controller besides its model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ControllerSettings<T, const NX: usize, const NU: usize, const NS: usize> {
    /// Sampling time in seconds.
    pub t_s: T,
    /// Prediction horizon in samples, at least 1.
    pub horizon: usize,
    /// The discrete-time predictor. A descent takes its Runge-Kutta steps alone: its matrices follow the scheduling
    /// within a sample in any case.
    pub predictor: Predictor,
    /// Stage weights.
    pub weights: Weights<T, NX, NU>,
    /// Terminal ingredient.
    pub terminal: TerminalIngredient<T, NX>,
    /// State bounds, at the stages 1 to N.
    pub x: Bounds<T, NX>,
    /// Which state bounds may be exceeded, and at what price in the unit of the cost.
    pub soft_x: SoftBounds<T, NX>,
    /// Whether far from the end of the reference these prices, and those of a preview, are raised to what the way ahead may
    /// make of a bound's multiplier: in each sample the linear price of state j is at least 4 (P_jj V)^(1/2), where
    /// V = w'(P + N Q)w is the cost of a plan that stands still, w before its goal, and at least |(A - I)'p|_j, where
    /// p = 2 (P + N Q)w is its slope and A the derivative of a sample's motion from the present state under the input
    /// reference: what an excess of one sample brings by moving the other states. With a terminal equality, without a
    /// terminal cost, and where V is too much for the number type, they stay as they are.
    pub raise_prices: bool,
    /// Input bounds, at the stages 0 to N - 1.
    pub u: Bounds<T, NU>,
    /// Where the scheduling comes from.
    pub scheduling: Scheduling<T, NS>,
    /// Quadratic programs per sample.
    pub iterations: Iterations<T>,
    /// The input that costs nothing.
    pub input_reference: InputReference<T, NU>,
    /// Settings of the solver.
    pub solver: SolverSettings<T>,
}

impl<T: Scalar, const NX: usize, const NU: usize, const NS: usize>
    ControllerSettings<T, NX, NU, NS>
{
    /// What a controller needs to be told; the rest is what serves as a rule: the stage-consistent
    /// predictor with one Runge-Kutta step per sample, LPV MPC as a descent, the input that holds the
    /// set point as the one that costs nothing, no bounds of the state.
    ///
    /// Say state bounds by [`soft_bounds`](Self::soft_bounds), or hard by `x` alone.
    pub fn new(
        t_s: T,
        horizon: usize,
        weights: Weights<T, NX, NU>,
        terminal: TerminalIngredient<T, NX>,
        u: Bounds<T, NU>,
    ) -> Self {
        Self {
            t_s,
            horizon,
            predictor: Predictor::StageConsistent(Rk4 { substeps: 1 }),
            weights,
            terminal,
            x: Bounds::none(),
            soft_x: [None; NX],
            raise_prices: false,
            u,
            scheduling: Scheduling::Predicted,
            input_reference: InputReference::SteadyState,
            iterations: Iterations::default(),
            solver: SolverSettings::default(),
        }
    }

    /// What a controller with these settings needs: room for its horizon and for every bound that can be
    /// active at once.
    pub fn capacity(&self) -> Capacity {
        let soft = self.soft_x.iter().flatten();
        let quadratic = soft.filter(|price| price.quadratic > T::zero());
        let rows = self.horizon * (NU + quadratic.count()) + NX;
        Capacity {
            stages: self.horizon,
            rows,
            active: rows + (self.horizon + 1) * NX,
            ..Capacity::default()
        }
    }

    /// The same with these bounds of the state, each soft at an exact price: kept where that is
    /// possible, exceeded as little as possible where it is not, so that a start outside of them
    /// has a plan. With hard bounds the same start is infeasible.
    ///
    /// The prices are [`exact_prices`] of the terminal cost, which is to be that of an infinite horizon
    /// (of the LQR), or of Q, sample by sample, with a terminal equality; far from the end of the reference they are
    /// [raised](Self::raise_prices).
    pub fn soft_bounds(self, x: Bounds<T, NX>) -> Self {
        let samples: T = convert(self.horizon as f64);
        let cost = match &self.terminal {
            TerminalIngredient::Cost(p) if p.amax() > T::zero() => *p,
            _ => self.weights.q * samples,
        };
        Self {
            x,
            soft_x: exact_prices(&cost, &x),
            raise_prices: true,
            ..self
        }
    }
}

/// A mistake in the [`ControllerSettings`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ControllerError {
    /// The sampling time is not a positive number.
    SamplingTime,
    /// The sampling time is not a whole number of the periods of a model that is sampled itself.
    Period,
    /// The horizon is not between 1 and the largest that there is memory for.
    Horizon {
        /// What was asked for.
        given: usize,
        /// The largest that there is memory for; 65 535 on the heap.
        largest: usize,
    },
    /// The predictor needs at least one sub-step.
    Substeps,
    /// A weight contains a number that is not finite, or is not symmetric: its name.
    WeightEntries(&'static str),
    /// A weight is not positive definite (R) or semidefinite (Q, P): its name.
    WeightSign(&'static str),
    /// A lower bound above its upper bound, or not a number: the quantity and its component.
    Bounds {
        /// "state" or "input".
        quantity: &'static str,
        /// Component, from 0.
        component: usize,
    },
    /// A price of a state's bounds that is negative or not finite: the component, from 0.
    Price(usize),
    /// The constant scheduling contains a number that is not finite.
    HeldScheduling,
    /// The scheduling is held, and each sample's plan a descent, which works out its own.
    HeldDescent,
    /// The given input reference contains a number that is not finite.
    InputReference,
    /// No quadratic program per sample, or more than 65 535, or a tolerance of the iteration that is not
    /// a positive number.
    Iterations,
    /// The solver's tolerance is not a positive number.
    Tolerance,
    /// Another horizon or sampling time than the controller was built with.
    Another,
    /// General rows for every sample that make no sense.
    Rows(PreviewMistake),
}

impl fmt::Display for ControllerError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::SamplingTime => {
                write!(f, "the sampling time must be a positive number of seconds")
            }
            Self::Period => write!(
                f,
                "the sampling time must be a whole number of periods of the model, which is sampled itself"
            ),
            Self::Horizon { given, largest } => {
                write!(
                    f,
                    "the horizon is {given}; it must be from 1 to {largest} samples"
                )
            }
            Self::Substeps => write!(f, "the predictor needs at least one sub-step per sample"),
            Self::WeightEntries(name) => {
                write!(f, "the weight {name} must be symmetric with finite entries")
            }
            Self::WeightSign("R") => write!(f, "the weight R must be positive definite"),
            Self::WeightSign(name) => {
                write!(f, "the weight {name} must be positive semidefinite")
            }
            Self::Bounds {
                quantity,
                component,
            } => write!(
                f,
                "the lower bound of {quantity} {component} must not exceed its upper bound, and neither \
                 be NaN or infinite on the other's side"
            ),
            Self::Price(component) => write!(
                f,
                "the price of exceeding the bounds of state {component} must be finite and not negative"
            ),
            Self::HeldScheduling => write!(f, "the held scheduling must be finite"),
            Self::HeldDescent => write!(
                f,
                "a descent plans with the nonlinear model: linear MPC, whose scheduling is held, takes \
                 Iterations::Fixed"
            ),
            Self::InputReference => write!(f, "the input reference must be finite"),
            Self::Iterations => write!(
                f,
                "a sample needs from 1 to {LARGEST} quadratic programs, and their tolerance must be a \
                 positive number"
            ),
            Self::Tolerance => write!(f, "the solver's tolerance must be a positive number"),
            Self::Another => write!(
                f,
                "horizon and sampling time cannot change while a controller runs: build another \
                 one, which takes over"
            ),
            Self::Rows(mistake) => write!(f, "the general rows: {mistake}"),
        }
    }
}

impl core::error::Error for ControllerError {}

/// The first setting that makes no sense for a controller of at most `largest` samples.
pub(crate) fn check<T: Scalar, const NX: usize, const NU: usize, const NS: usize>(
    settings: &ControllerSettings<T, NX, NU, NS>,
    largest: usize,
) -> Result<(), ControllerError> {
    if !(settings.t_s > T::zero() && settings.t_s.is_finite()) {
        return Err(ControllerError::SamplingTime);
    }
    check_horizon(settings.horizon, largest)?;
    if settings.predictor.rk4().substeps == 0 {
        return Err(ControllerError::Substeps);
    }
    let tolerance = settings.solver.tolerance;
    if !(tolerance > T::zero() && tolerance.is_finite()) {
        return Err(ControllerError::Tolerance);
    }
    if !settings.iterations.make_sense() {
        return Err(ControllerError::Iterations);
    }
    check_weight(&settings.weights.q, "Q", T::default_epsilon())?;
    check_weight(&settings.weights.r, "R", T::zero())?;
    if let TerminalIngredient::Cost(p) = &settings.terminal {
        check_weight(p, "P", T::default_epsilon())?;
    }
    check_bounds(&settings.x, "state")?;
    check_bounds(&settings.u, "input")?;
    let mut prices = settings.soft_x.iter();
    if let Some(component) =
        prices.position(|price| price.is_some_and(|price| !price.makes_sense()))
    {
        return Err(ControllerError::Price(component));
    }
    if let InputReference::Given(u) = &settings.input_reference
        && !u.iter().all(|entry| entry.is_finite())
    {
        return Err(ControllerError::InputReference);
    }
    match settings.scheduling {
        Scheduling::Held(held) if !held.iter().all(|entry| entry.is_finite()) => {
            Err(ControllerError::HeldScheduling)
        }
        Scheduling::Held(_) if matches!(settings.iterations, Iterations::Descent { .. }) => {
            Err(ControllerError::HeldDescent)
        }
        _ => Ok(()),
    }
}

/// Whether `t_s` is a whole number of periods, at least one.
pub(crate) fn check_period<T: Scalar>(period: T, t_s: T) -> Result<(), ControllerError> {
    let count = periods(period, t_s);
    let whole: T = period * convert(count as f64);
    let rounding: T = t_s * T::default_epsilon().sqrt();
    // Negated, so that a period that is NaN fails.
    if count == 0 || !((whole - t_s).abs() <= rounding) {
        return Err(ControllerError::Period);
    }
    Ok(())
}

/// The longest horizon at all: active bounds have 16 bits for their stage.
#[cfg(feature = "alloc")]
pub(crate) const LONGEST_HORIZON: usize = 0xffff;

pub(crate) fn check_horizon(given: usize, largest: usize) -> Result<(), ControllerError> {
    if given == 0 || given > largest {
        return Err(ControllerError::Horizon { given, largest });
    }
    Ok(())
}

/// Symmetric up to rounding, finite, and positive definite after adding `shift` times its size.
/// Rounding is 10 K units of the largest entry, which an eigenvalue of a semidefinite matrix may
/// be off by, too. Definiteness is that of the symmetric part, all that x'Wx depends on, and not
/// of the triangle that a factorisation happens to read.
pub(crate) fn check_weight<T: Scalar, const K: usize>(
    weight: &SMatrix<T, K, K>,
    name: &'static str,
    shift: T,
) -> Result<(), ControllerError> {
    let roundings: T = convert::<f64, T>(10.0 * K as f64);
    let half: T = convert(0.5);
    let (mut size, mut asymmetry) = (T::zero(), T::zero());
    let mut symmetric = *weight;
    for i in 0..K {
        for j in 0..=i {
            let entry = |at: (usize, usize)| weight.get(at).copied().unwrap_or_else(T::zero);
            let (lower, upper) = (entry((i, j)), entry((j, i)));
            if !(lower.is_finite() && upper.is_finite()) {
                return Err(ControllerError::WeightEntries(name));
            }
            size = largest(size, largest(lower.abs(), upper.abs()));
            asymmetry = largest(asymmetry, (lower - upper).abs());
            // Half before the sum, which could overflow.
            if let Some(place) = symmetric.get_mut((i, j)) {
                *place = lower * half + upper * half;
            }
        }
    }
    if asymmetry > roundings * T::default_epsilon() * size {
        return Err(ControllerError::WeightEntries(name));
    }
    // Semidefinite up to rounding: a tiny multiple of the identity makes it definite.
    let scale = if size > T::zero() { size } else { T::one() };
    for i in 0..K {
        symmetric[(i, i)] += shift * scale * roundings;
    }
    match Cholesky::<T, Const<K>>::new(symmetric) {
        Some(_) => Ok(()),
        None => Err(ControllerError::WeightSign(name)),
    }
}

/// Compared once: a maximum that minds NaN takes a microcontroller three times the instructions.
pub(crate) fn largest<T: Scalar>(a: T, b: T) -> T {
    if a > b { a } else { b }
}

pub(crate) fn check_bounds<T: Scalar, const K: usize>(
    bounds: &Bounds<T, K>,
    quantity: &'static str,
) -> Result<(), ControllerError> {
    let infinity: T = convert(f64::INFINITY);
    let sides = bounds.lower.iter().zip(bounds.upper.iter());
    for (component, (lower, upper)) in sides.enumerate() {
        // Negated, so that a bound that is NaN fails.
        if !(*lower <= *upper && *lower < infinity && *upper > -infinity) {
            return Err(ControllerError::Bounds {
                quantity,
                component,
            });
        }
    }
    Ok(())
}
