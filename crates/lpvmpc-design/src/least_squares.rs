//! Nonlinear least squares: plain Gauss-Newton and damped Levenberg-Marquardt.
//!
//! Both minimise the weighted sum of squares of a residual F(b) of m equations in n <= m unknowns
//! and report every iterate. [`gauss_newton`] takes full, undamped steps: it is the iteration of
//! Karachalios and Abbas (eq. (Newton)), where the inverse of the non-square Jacobian is its
//! pseudo-inverse. It converges only from near a solution whose residual is small.
//! [`levenberg_marquardt`] shortens its steps until they help and is the one to use on a new
//! problem.

mod fit;
mod gauss_newton;
mod levenberg_marquardt;

use crate::number_text;
use nalgebra::{DMatrix, DVector};
use thiserror::Error;

pub use fit::{Evaluated, Fit, Iteration, RankDeficiency, Termination};
pub use gauss_newton::gauss_newton;
pub use levenberg_marquardt::levenberg_marquardt;

/// A residual F(b) to be made small, with its derivative.
pub trait ResidualModel {
    /// F(b): m equations at the n parameters `b`.
    fn residual(&self, b: &DVector<f64>) -> DVector<f64>;

    /// dF/db: m x n, row i is the gradient of equation i.
    fn jacobian(&self, b: &DVector<f64>) -> DMatrix<f64>;
}

/// When an iteration ends, and how the equations are weighted. The one place of the defaults.
#[derive(Debug, Clone, PartialEq)]
pub struct LeastSquaresSettings {
    /// Converged when a step changes the parameters by less than this, relative to their size,
    /// each parameter measured by the norm of its Jacobian column. Default 1e-10.
    pub step_tolerance: f64,
    /// Levenberg-Marquardt only: converged when neither the actual nor the predicted reduction of
    /// the sum of squares is above this part of it. Default 1e-14.
    pub reduction_tolerance: f64,
    /// Levenberg-Marquardt only: converged when the cosine of the angle between the residual and
    /// each Jacobian column is below this. Default 1e-14.
    pub orthogonality_tolerance: f64,
    /// Gauss-Newton stops after this many steps; Levenberg-Marquardt after this many times (n + 1)
    /// evaluations of the residual, as MINPACK counts. Default 200.
    pub max_iterations: usize,
    /// Gauss-Newton only: it has stagnated when this many steps in a row were not smaller than the
    /// smallest before them. Default 30.
    pub stagnation_steps: usize,
    /// One weight w_i > 0 per equation: minimised is the sum of (w_i F_i)^2, so w_i = 1/sigma_i
    /// for an equation with standard deviation sigma_i. Default `None`: all weights are 1.
    pub weights: Option<DVector<f64>>,
}

impl Default for LeastSquaresSettings {
    fn default() -> Self {
        Self {
            step_tolerance: 1e-10,
            reduction_tolerance: 1e-14,
            orthogonality_tolerance: 1e-14,
            max_iterations: 200,
            stagnation_steps: 30,
            weights: None,
        }
    }
}

/// A mistake in the problem, or (from [`Fit::require_converged`] alone) a fit without result.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum LeastSquaresError {
    /// There is nothing to fit.
    #[error(
        "there are {equations} equations for {parameters} parameters: at least one parameter, \
         and at least as many equations as parameters, are needed"
    )]
    TooFewEquations {
        /// m.
        equations: usize,
        /// n.
        parameters: usize,
    },
    /// The Jacobian does not fit residual and parameters.
    #[error(
        "the Jacobian is {rows} x {columns}: with {equations} equations and {parameters} \
         parameters it must be {equations} x {parameters}"
    )]
    JacobianShape {
        /// Rows of the Jacobian.
        rows: usize,
        /// Columns of the Jacobian.
        columns: usize,
        /// m.
        equations: usize,
        /// n.
        parameters: usize,
    },
    /// The residual changed its length from one iterate to another.
    #[error("the residual has {found} equations at b = {at:?}, but had {expected} at the start")]
    ResidualLength {
        /// Length at the start.
        expected: usize,
        /// Length now.
        found: usize,
        /// The parameters now.
        at: Vec<f64>,
    },
    /// The weights do not fit the residual.
    #[error("there are {weights} weights for {equations} equations: one per equation is needed")]
    WeightCount {
        /// Number of weights.
        weights: usize,
        /// m.
        equations: usize,
    },
    /// A weight is not a positive number.
    #[error(
        "weight {index} (counted from 0) is {value}: it must be finite and > 0",
        value = number_text(*value)
    )]
    Weight {
        /// Which weight, counted from 0.
        index: usize,
        /// The weight.
        value: f64,
    },
    /// A setting is out of its range.
    #[error("the setting {name} is {value}: it must be {allowed}", value = number_text(*value))]
    Setting {
        /// Name of the field of [`LeastSquaresSettings`].
        name: &'static str,
        /// Its value.
        value: f64,
        /// What it may be.
        allowed: &'static str,
    },
    /// The start, or the residual or Jacobian there, is not finite.
    #[error("{what} is not finite at the start b = {start:?}")]
    NonFiniteStart {
        /// What is not finite.
        what: Evaluated,
        /// The start.
        start: Vec<f64>,
    },
    /// The iteration ended without reaching a minimum.
    #[error(
        "the fit did not converge: {termination}. Last good iterate after {iterations} steps: \
         b = {parameters:?}, weighted residual norm {residual_norm}",
        residual_norm = number_text(*residual_norm)
    )]
    DidNotConverge {
        /// Why it ended.
        termination: Termination,
        /// Steps taken.
        iterations: usize,
        /// The last iterate with finite residual and Jacobian.
        parameters: Vec<f64>,
        /// The weighted residual norm there.
        residual_norm: f64,
    },
}

/// A model with its weights, checked; evaluates the weighted residual W F and Jacobian W J.
struct Weighted<'a, M> {
    model: &'a M,
    weights: Option<&'a DVector<f64>>,
    equations: usize,
    parameters: usize,
}

/// Everything the methods need at one b.
#[derive(Debug, Clone)]
struct Point {
    b: DVector<f64>,
    /// W F(b).
    residual: DVector<f64>,
    /// W J(b).
    jacobian: DMatrix<f64>,
}

/// Why there is no [`Point`] at some b.
enum NoPoint {
    NonFinite(Evaluated),
    Mistake(LeastSquaresError),
}

impl From<LeastSquaresError> for NoPoint {
    fn from(mistake: LeastSquaresError) -> Self {
        Self::Mistake(mistake)
    }
}

impl<'a, M: ResidualModel> Weighted<'a, M> {
    /// Checks model, start and settings against each other; returns the first point with them.
    fn start(
        model: &'a M,
        start: &DVector<f64>,
        settings: &'a LeastSquaresSettings,
    ) -> Result<(Self, Point), LeastSquaresError> {
        check_settings(settings)?;
        let (equations, parameters) = (model.residual(start).len(), start.len());
        if parameters == 0 || equations < parameters {
            return Err(LeastSquaresError::TooFewEquations {
                equations,
                parameters,
            });
        }
        if let Some(weights) = &settings.weights {
            check_weights(weights, equations)?;
        }
        let weighted = Self {
            model,
            weights: settings.weights.as_ref(),
            equations,
            parameters,
        };
        match weighted.point(start) {
            Ok(point) => Ok((weighted, point)),
            Err(NoPoint::Mistake(mistake)) => Err(mistake),
            Err(NoPoint::NonFinite(what)) => Err(LeastSquaresError::NonFiniteStart {
                what,
                start: start.as_slice().to_vec(),
            }),
        }
    }

    fn point(&self, b: &DVector<f64>) -> Result<Point, NoPoint> {
        if !b.iter().all(|x| x.is_finite()) {
            return Err(NoPoint::NonFinite(Evaluated::Parameters));
        }
        let residual = self.residual(b)?;
        if !residual.iter().all(|x| x.is_finite()) {
            return Err(NoPoint::NonFinite(Evaluated::Residual));
        }
        let jacobian = self.jacobian(b)?;
        if !jacobian.iter().all(|x| x.is_finite()) {
            return Err(NoPoint::NonFinite(Evaluated::Jacobian));
        }
        Ok(Point {
            b: b.clone(),
            residual,
            jacobian,
        })
    }

    /// W F(b), of the right length but not checked for being finite.
    fn residual(&self, b: &DVector<f64>) -> Result<DVector<f64>, LeastSquaresError> {
        let mut residual = self.model.residual(b);
        if residual.len() != self.equations {
            return Err(LeastSquaresError::ResidualLength {
                expected: self.equations,
                found: residual.len(),
                at: b.as_slice().to_vec(),
            });
        }
        if let Some(weights) = self.weights {
            residual.component_mul_assign(weights);
        }
        Ok(residual)
    }

    /// W J(b), of the right shape but not checked for being finite.
    fn jacobian(&self, b: &DVector<f64>) -> Result<DMatrix<f64>, LeastSquaresError> {
        let mut jacobian = self.model.jacobian(b);
        if jacobian.shape() != (self.equations, self.parameters) {
            return Err(LeastSquaresError::JacobianShape {
                rows: jacobian.nrows(),
                columns: jacobian.ncols(),
                equations: self.equations,
                parameters: self.parameters,
            });
        }
        if let Some(weights) = self.weights {
            for (mut row, weight) in jacobian.row_iter_mut().zip(weights.iter()) {
                row *= *weight;
            }
        }
        Ok(jacobian)
    }
}

fn check_weights(weights: &DVector<f64>, equations: usize) -> Result<(), LeastSquaresError> {
    if weights.len() != equations {
        return Err(LeastSquaresError::WeightCount {
            weights: weights.len(),
            equations,
        });
    }
    match weights.iter().position(|w| !(w.is_finite() && *w > 0.0)) {
        Some(index) => Err(LeastSquaresError::Weight {
            index,
            value: weights[index],
        }),
        None => Ok(()),
    }
}

fn check_settings(settings: &LeastSquaresSettings) -> Result<(), LeastSquaresError> {
    let tolerances = [
        ("step_tolerance", settings.step_tolerance),
        ("reduction_tolerance", settings.reduction_tolerance),
        ("orthogonality_tolerance", settings.orthogonality_tolerance),
    ];
    for (name, value) in tolerances {
        if !(value.is_finite() && value >= 0.0) {
            return Err(LeastSquaresError::Setting {
                name,
                value,
                allowed: "finite and >= 0",
            });
        }
    }
    let counts = [
        ("max_iterations", settings.max_iterations),
        ("stagnation_steps", settings.stagnation_steps),
    ];
    for (name, value) in counts {
        if !(1..=1_000_000).contains(&value) {
            return Err(LeastSquaresError::Setting {
                name,
                value: value as f64,
                allowed: "from 1 to 1000000",
            });
        }
    }
    Ok(())
}
