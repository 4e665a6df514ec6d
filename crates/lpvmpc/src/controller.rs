//! The LPVMPC controller: Algorithm 2 of the paper for any LPV model.

use crate::model::{LpvModel, Scalar};
use crate::ocp::{Bounds, Ocp};
use crate::predictor::Rk4;
use crate::solution::Solution;
use crate::solver::{SolverSettings, Workspace};
use core::fmt;
use nalgebra::{Cholesky, Const, SMatrix, SVector, convert};

/// Weights of the cost sum ||x - x_ref||_Q^2 + ||u||_R^2 (eq. (7) of the paper).
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
    /// Constant: linear MPC, the paper's comparison, with the scheduling of the equilibrium.
    Held(SVector<T, NS>),
}

/// Everything that defines a controller besides its model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ControllerSettings<T, const NX: usize, const NU: usize, const NS: usize> {
    /// Sampling time in seconds.
    pub t_s: T,
    /// Prediction horizon in samples, from 1 to the controller's `N`.
    pub horizon: usize,
    /// The discrete-time predictor.
    pub predictor: Rk4,
    /// Stage weights.
    pub weights: Weights<T, NX, NU>,
    /// Terminal ingredient.
    pub terminal: TerminalIngredient<T, NX>,
    /// State bounds, at the stages 1 to N.
    pub x: Bounds<T, NX>,
    /// Input bounds, at the stages 0 to N - 1.
    pub u: Bounds<T, NU>,
    /// Where the scheduling comes from.
    pub scheduling: Scheduling<T, NS>,
    /// Settings of the solver.
    pub solver: SolverSettings<T>,
}

/// A mistake in the [`ControllerSettings`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ControllerError {
    /// The sampling time is not a positive number.
    SamplingTime,
    /// The horizon is not between 1 and the largest that the controller is made for.
    Horizon {
        /// What was asked for.
        given: usize,
        /// The largest possible.
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
    /// The constant scheduling contains a number that is not finite.
    HeldScheduling,
    /// The solver's tolerance is not a positive number.
    Tolerance,
}

impl fmt::Display for ControllerError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::SamplingTime => {
                write!(f, "the sampling time must be a positive number of seconds")
            }
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
                "the lower bound of {quantity} {component} must not exceed its upper bound"
            ),
            Self::HeldScheduling => write!(f, "the held scheduling must be finite"),
            Self::Tolerance => write!(f, "the solver's tolerance must be a positive number"),
        }
    }
}

impl core::error::Error for ControllerError {}

/// The state reference along the horizon, in state units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reference<T, const NX: usize, const N: usize> {
    /// x_ref at the stages 0 to N - 1.
    pub stages: [SVector<T, NX>; N],
    /// x_ref at the end of the horizon.
    pub terminal: SVector<T, NX>,
}

impl<T: Scalar, const NX: usize, const N: usize> Reference<T, NX, N> {
    /// The same state at every stage.
    pub fn constant(x: SVector<T, NX>) -> Self {
        Self {
            stages: [x; N],
            terminal: x,
        }
    }
}

/// The LPVMPC controller of one plant.
///
/// `NX` states, `NU` inputs, `NS` scheduling parameters, at most `N` stages, at most `M`
/// simultaneously active bounds. It holds everything that lives from sample to sample; the
/// solver's [`Workspace`] is handed in and may be shared between controllers.
#[derive(Clone, Debug)]
pub struct Controller<
    P,
    T,
    const NX: usize,
    const NU: usize,
    const NS: usize,
    const N: usize,
    const M: usize,
> {
    model: P,
    settings: ControllerSettings<T, NX, NU, NS>,
    ocp: Ocp<T, NX, NU, N>,
    scheduling: [SVector<T, NS>; N],
    initialised: bool,
    rollout: [SVector<T, NX>; N],
    solution: Solution<T, NX, NU, N, M>,
}

impl<P, T, const NX: usize, const NU: usize, const NS: usize, const N: usize, const M: usize>
    Controller<P, T, NX, NU, NS, N, M>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
{
    /// A controller for `model`.
    ///
    /// # Errors
    /// A [`ControllerError`] names the first setting that makes no sense.
    pub fn new(
        model: P,
        settings: ControllerSettings<T, NX, NU, NS>,
    ) -> Result<Self, ControllerError> {
        check(&settings, N)?;
        let mut ocp = Ocp {
            horizon: settings.horizon,
            ..Ocp::default()
        };
        for stage in &mut ocp.stages {
            stage.q = settings.weights.q;
            stage.r = settings.weights.r;
            stage.x = settings.x;
            stage.u = settings.u;
        }
        ocp.terminal.x = settings.x;
        if let TerminalIngredient::Cost(p) = settings.terminal {
            ocp.terminal.p = p;
        }
        Ok(Self {
            model,
            settings,
            ocp,
            scheduling: [SVector::zeros(); N],
            initialised: false,
            rollout: [SVector::zeros(); N],
            solution: Solution::default(),
        })
    }

    /// One sample of Algorithm 2: from the measured state `x` and the reference along the
    /// horizon to the plan, whose first input is to be applied until the next sample.
    ///
    /// The inputs are finite and within the input bounds, whatever the status says.
    pub fn step(
        &mut self,
        x: &SVector<T, NX>,
        reference: &Reference<T, NX, N>,
        workspace: &mut Workspace<T, NX, NU, N, M>,
    ) -> &Solution<T, NX, NU, N, M> {
        self.initialise_scheduling(x);
        self.predict(x);
        self.track(reference);
        workspace.solve(&self.ocp, &self.settings.solver, &mut self.solution);
        self.roll_out(x);
        self.shift_scheduling();
        &self.solution
    }

    /// Forgets the past: the next step starts as the first one did.
    pub fn reset(&mut self) {
        self.initialised = false;
        self.solution = Solution::default();
    }

    /// The plan of the last step.
    pub fn solution(&self) -> &Solution<T, NX, NU, N, M> {
        &self.solution
    }

    /// The quadratic program of the last step.
    pub fn ocp(&self) -> &Ocp<T, NX, NU, N> {
        &self.ocp
    }

    /// The settings.
    pub fn settings(&self) -> &ControllerSettings<T, NX, NU, NS> {
        &self.settings
    }

    /// The states x_1 to x_N that the nonlinear model reaches under the last plan.
    pub fn rollout(&self) -> &[SVector<T, NX>] {
        &self.rollout[..self.ocp.length()]
    }

    /// The paper's cost J of the last plan (Algorithm 1), constant terms included, on the
    /// predicted states.
    pub fn tracking_cost(&self, reference: &Reference<T, NX, N>) -> T {
        let Weights { q, r } = &self.settings.weights;
        let mut total = T::zero();
        let mut x = &self.ocp.x0;
        let steps = self.solution.u.iter().zip(self.solution.x.iter());
        for ((u, x_next), x_ref) in steps.zip(&reference.stages).take(self.ocp.length()) {
            let error = x - x_ref;
            total += (q * error).dot(&error) + (r * u).dot(u);
            x = x_next;
        }
        let error = x - reference.terminal;
        total + (self.ocp.terminal.p * error).dot(&error)
    }

    /// Algorithm 2, step 1: without a past, the whole window has the scheduling of `x`.
    fn initialise_scheduling(&mut self, x: &SVector<T, NX>) {
        if !self.initialised {
            let initial = match self.settings.scheduling {
                Scheduling::Predicted => self.model.scheduling(x),
                Scheduling::Held(held) => held,
            };
            self.scheduling = [initial; N];
            self.initialised = true;
        }
    }

    /// Algorithm 1, lines 1 to 8: the predictor's matrices along the scheduling window.
    fn predict(&mut self, x: &SVector<T, NX>) {
        self.ocp.x0 = *x;
        let t_s = self.settings.t_s;
        let n = self.ocp.length();
        let window = self.ocp.stages.iter_mut().zip(&self.scheduling).take(n);
        for (stage, scheduling) in window {
            let (a, b) = self.model.matrices(scheduling);
            (stage.a, stage.b) = self.settings.predictor.discretize(&a, &b, t_s);
        }
    }

    /// Algorithm 1, cost: the reference enters the linear terms.
    fn track(&mut self, reference: &Reference<T, NX, N>) {
        for (stage, x_ref) in self.ocp.stages.iter_mut().zip(&reference.stages) {
            stage.linear_x = -(stage.q * x_ref);
        }
        let terminal = &mut self.ocp.terminal;
        match self.settings.terminal {
            TerminalIngredient::Cost(p) => terminal.linear_x = -(p * reference.terminal),
            TerminalIngredient::Equality => terminal.equality = Some(reference.terminal),
        }
    }

    /// Algorithm 2, step 4: the nonlinear model under the plan.
    fn roll_out(&mut self, x: &SVector<T, NX>) {
        let mut state = *x;
        let n = self.ocp.length();
        for (place, u) in self.rollout.iter_mut().zip(&self.solution.u).take(n) {
            let t_s = self.settings.t_s;
            state = self.settings.predictor.advance(&self.model, &state, u, t_s);
            *place = state;
        }
        // A rollout that left the numbers is no past to build on.
        self.initialised = state.iter().all(|entry| entry.is_finite());
    }

    /// Algorithm 2, steps 5 and 9: the scheduling of x_1 to x_N is the next sample's window.
    fn shift_scheduling(&mut self) {
        if let Scheduling::Predicted = self.settings.scheduling {
            for (place, x) in self.scheduling.iter_mut().zip(&self.rollout) {
                *place = self.model.scheduling(x);
            }
        }
    }
}

fn check<T: Scalar, const NX: usize, const NU: usize, const NS: usize>(
    settings: &ControllerSettings<T, NX, NU, NS>,
    largest: usize,
) -> Result<(), ControllerError> {
    if !(settings.t_s > T::zero() && settings.t_s.is_finite()) {
        return Err(ControllerError::SamplingTime);
    }
    if settings.horizon == 0 || settings.horizon > largest {
        return Err(ControllerError::Horizon {
            given: settings.horizon,
            largest,
        });
    }
    if settings.predictor.substeps == 0 {
        return Err(ControllerError::Substeps);
    }
    let tolerance = settings.solver.tolerance;
    if !(tolerance > T::zero() && tolerance.is_finite()) {
        return Err(ControllerError::Tolerance);
    }
    check_weight(&settings.weights.q, "Q", T::default_epsilon())?;
    check_weight(&settings.weights.r, "R", T::zero())?;
    if let TerminalIngredient::Cost(p) = &settings.terminal {
        check_weight(p, "P", T::default_epsilon())?;
    }
    check_bounds(&settings.x, "state")?;
    check_bounds(&settings.u, "input")?;
    match settings.scheduling {
        Scheduling::Held(held) if !held.iter().all(|entry| entry.is_finite()) => {
            Err(ControllerError::HeldScheduling)
        }
        _ => Ok(()),
    }
}

/// Symmetric, finite, and positive definite after adding `shift` times its size.
fn check_weight<T: Scalar, const K: usize>(
    weight: &SMatrix<T, K, K>,
    name: &'static str,
    shift: T,
) -> Result<(), ControllerError> {
    let size = weight.amax();
    let asymmetry = (weight - weight.transpose()).amax();
    let rounding: T = convert::<f64, T>(1e3) * T::default_epsilon() * size;
    let finite = weight.iter().all(|entry| entry.is_finite());
    if !(finite && asymmetry <= rounding) {
        return Err(ControllerError::WeightEntries(name));
    }
    // Semidefinite up to rounding: a tiny multiple of the identity makes it definite.
    let scale = if size > T::zero() { size } else { T::one() };
    let lifted =
        weight + SMatrix::identity() * (shift * scale * convert::<f64, T>(10.0 * K as f64));
    match Cholesky::<T, Const<K>>::new(lifted) {
        Some(_) => Ok(()),
        None => Err(ControllerError::WeightSign(name)),
    }
}

fn check_bounds<T: Scalar, const K: usize>(
    bounds: &Bounds<T, K>,
    quantity: &'static str,
) -> Result<(), ControllerError> {
    let infinity: T = convert(f64::INFINITY);
    let sides = bounds.lower.iter().zip(bounds.upper.iter());
    for (component, (lower, upper)) in sides.enumerate() {
        // Negated, so that a bound that is not a number fails.
        if !(*lower <= *upper && *lower < infinity && *upper > -infinity) {
            return Err(ControllerError::Bounds {
                quantity,
                component,
            });
        }
    }
    Ok(())
}
