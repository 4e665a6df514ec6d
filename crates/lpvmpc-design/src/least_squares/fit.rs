//! What a least-squares iteration hands back.

use std::fmt;

use nalgebra::{DMatrix, DVector, SVD};

use super::{LeastSquaresError, Point, ResidualModel, Weighted};
use crate::matrix_check::QR_ITERATION_CAP;

/// The end of a least-squares iteration, converged or not: see `termination`.
#[derive(Debug, Clone, PartialEq)]
pub struct Fit {
    /// b: the last iterate whose residual and Jacobian are finite.
    pub parameters: DVector<f64>,
    /// F(b), without weights.
    pub residual: DVector<f64>,
    /// ||W F(b)||, with weights.
    pub residual_norm: f64,
    /// dF/db at b, m x n, without weights.
    pub jacobian: DMatrix<f64>,
    /// Covariance of the parameters, n x n: ||W F||^2 / (m - n) (J'W^2 J)^-1, for independent errors
    /// whose standard deviations are in proportion to 1/w_i. `None` without spare equations (m = n),
    /// or where the Jacobian is rank deficient.
    pub covariance: Option<DMatrix<f64>>,
    /// Every accepted iterate; the first is the start, the last is `parameters`.
    pub history: Vec<Iteration>,
    /// Why the iteration ended.
    pub termination: Termination,
}

/// One accepted iterate.
#[derive(Debug, Clone, PartialEq)]
pub struct Iteration {
    /// b_k.
    pub parameters: DVector<f64>,
    /// ||W F(b_k)||, with weights.
    pub residual_norm: f64,
    /// ||b_k - b_(k-1)||; 0 for the start.
    pub step_norm: f64,
}

/// Why an iteration ended.
#[derive(Debug, Clone, PartialEq)]
pub enum Termination {
    /// Converged: every equation holds exactly.
    ResidualZero,
    /// Converged: the residual is orthogonal to the Jacobian's columns, no direction leads down.
    Orthogonal,
    /// Converged: the last step was within the step tolerance.
    SmallStep,
    /// Converged: the sum of squares can be reduced by no more than the reduction tolerance.
    SmallReduction,
    /// Not converged: the cap was reached (steps for Gauss-Newton, residual evaluations for
    /// Levenberg-Marquardt).
    IterationCap {
        /// The cap.
        cap: usize,
    },
    /// Not converged: NaN or infinity.
    NonFinite {
        /// What was not finite.
        what: Evaluated,
        /// The parameters where this happened.
        at: Vec<f64>,
    },
    /// Not converged, or not to a unique minimum: some change of the parameters has no effect.
    RankDeficient(RankDeficiency),
    /// Not converged: the tolerances ask for more than rounding gives, or the steps no longer
    /// shrink.
    Stagnation,
}

impl Termination {
    /// Whether a minimum was reached.
    pub fn is_converged(&self) -> bool {
        matches!(
            self,
            Self::ResidualZero | Self::Orthogonal | Self::SmallStep | Self::SmallReduction
        )
    }
}

impl fmt::Display for Termination {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::ResidualZero => write!(f, "the residual is zero"),
            Self::Orthogonal => write!(f, "the residual is orthogonal to the Jacobian"),
            Self::SmallStep => write!(f, "the step is within its tolerance"),
            Self::SmallReduction => write!(f, "the sum of squares is reduced no further"),
            Self::IterationCap { cap } => write!(f, "the cap of {cap} was reached"),
            Self::NonFinite { what, at } => write!(f, "{what} is not finite at b = {at:?}"),
            Self::RankDeficient(deficiency) => write!(f, "{deficiency}"),
            Self::Stagnation => write!(
                f,
                "the iteration stagnated: its steps no longer shrink or improve the residual"
            ),
        }
    }
}

/// Something that is evaluated at an iterate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Evaluated {
    /// The parameters b.
    Parameters,
    /// F(b).
    Residual,
    /// dF/db.
    Jacobian,
    /// The next step: it overflowed, or had no solution, although residual and Jacobian are finite.
    Step,
}

impl fmt::Display for Evaluated {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Parameters => "a parameter",
            Self::Residual => "the residual",
            Self::Jacobian => "the Jacobian",
            Self::Step => "the next step",
        })
    }
}

/// A Jacobian whose columns, each scaled to length one, are linearly dependent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RankDeficiency {
    /// Its rank.
    pub rank: usize,
    /// n.
    pub parameters: usize,
    /// The parameter, counted from 0, with the largest part in the change that has no effect.
    pub weakest_parameter: usize,
}

impl fmt::Display for RankDeficiency {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "the Jacobian has rank {} for {} parameters: a change of the parameters, most of \
             b[{}] (counted from 0), has no effect on the equations",
            self.rank, self.parameters, self.weakest_parameter
        )
    }
}

impl Fit {
    /// This fit if it converged.
    ///
    /// # Errors
    /// [`LeastSquaresError::DidNotConverge`] with reason, iterate and residual if it did not.
    pub fn require_converged(self) -> Result<Self, LeastSquaresError> {
        if self.termination.is_converged() {
            return Ok(self);
        }
        Err(LeastSquaresError::DidNotConverge {
            iterations: self.steps(),
            parameters: self.parameters.as_slice().to_vec(),
            residual_norm: self.residual_norm,
            termination: self.termination,
        })
    }

    /// The number of steps taken from the start to `parameters`.
    pub fn steps(&self) -> usize {
        self.history.len().saturating_sub(1)
    }

    pub(super) fn at<M: ResidualModel>(
        weighted: &Weighted<'_, M>,
        point: &Point,
        history: Vec<Iteration>,
        termination: Termination,
    ) -> Self {
        Self {
            residual: weighted.model.residual(&point.b),
            jacobian: weighted.model.jacobian(&point.b),
            covariance: covariance(point),
            residual_norm: point.residual.norm(),
            parameters: point.b.clone(),
            history,
            termination,
        }
    }
}

impl Iteration {
    /// The iterate `b` with its weighted residual, reached from the last one of `history`.
    pub(super) fn after(history: &[Self], b: &DVector<f64>, residual: &DVector<f64>) -> Self {
        Self {
            parameters: b.clone(),
            residual_norm: residual.norm(),
            step_norm: history
                .last()
                .map_or(0.0, |previous| (b - &previous.parameters).norm()),
        }
    }
}

/// See [`Fit::covariance`].
fn covariance(point: &Point) -> Option<DMatrix<f64>> {
    let (m, n) = point.jacobian.shape();
    let scaled = ScaledJacobian::new(&point.jacobian)?;
    if m == n || scaled.deficiency.is_some() {
        return None;
    }
    let v = scaled.svd.v_t?.transpose();
    // J = U S V' D with D the column norms, so (J'J)^-1 = (D^-1 V S^-1)(D^-1 V S^-1)'.
    let root = DMatrix::from_fn(n, n, |row, column| {
        v[(row, column)] / (scaled.svd.singular_values[column] * scaled.column_norms[row])
    });
    Some(&root * root.transpose() * (point.residual.norm_squared() / (m - n) as f64))
}

/// The Jacobian of a point with its columns scaled to length one, decomposed.
pub(super) struct ScaledJacobian {
    /// Lengths of the columns; 1 for a zero column.
    pub(super) column_norms: DVector<f64>,
    pub(super) svd: SVD<f64, nalgebra::Dyn, nalgebra::Dyn>,
    pub(super) deficiency: Option<RankDeficiency>,
}

impl ScaledJacobian {
    /// `None` if the singular values do not converge.
    ///
    /// Scaling makes the rank a matter of the columns' directions, whatever the parameters' units.
    pub(super) fn new(jacobian: &DMatrix<f64>) -> Option<Self> {
        let (m, n) = jacobian.shape();
        let column_norms = DVector::from_iterator(
            n,
            jacobian
                .column_iter()
                .map(|column| column.norm())
                .map(|norm| if norm > 0.0 { norm } else { 1.0 }),
        );
        let mut scaled = jacobian.clone();
        for (mut column, norm) in scaled.column_iter_mut().zip(column_norms.iter()) {
            column /= *norm;
        }
        let svd = SVD::try_new(scaled, true, true, f64::EPSILON, QR_ITERATION_CAP)?;
        let threshold = m as f64 * f64::EPSILON * svd.singular_values.max();
        let rank = svd
            .singular_values
            .iter()
            .filter(|s| **s > threshold)
            .count();
        let deficiency = (rank < n).then(|| RankDeficiency {
            rank,
            parameters: n,
            weakest_parameter: weakest_parameter(&svd),
        });
        Some(Self {
            column_norms,
            svd,
            deficiency,
        })
    }
}

fn weakest_parameter(svd: &SVD<f64, nalgebra::Dyn, nalgebra::Dyn>) -> usize {
    let without_effect = svd.singular_values.imin();
    svd.v_t
        .as_ref()
        .map_or(0, |v_t| v_t.row(without_effect).transpose().iamax())
}
