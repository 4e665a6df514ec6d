//! The linear-quadratic regulator of the upright ballbot, and its loop at frozen scheduling.

use crate::linear_model::LinearModel;
use ballbot::{Ballbot, limits};
use lpvmpc::Rk4;
use lpvmpc_design::{
    FrozenError, FrozenStability, Lqr, RiccatiError, Rk4Step, Rk4StepError, SchedulingGrid,
    check_rk4_step, frozen_stability, lqr_continuous, lqr_discrete,
};
use nalgebra::{DMatrix, DVector, Matrix4, RowVector4, Vector3, Vector4};

/// What is to be designed: the gain for the cost x'Q x + R u^2.
#[derive(Clone, Debug, PartialEq)]
pub struct RegulatorProblem {
    /// The linear model the gain is for.
    pub linear: LinearModel,
    /// The nonlinear model the gain is checked on.
    pub ballbot: Ballbot<f64>,
    /// Diagonal of Q for (phi, theta, phi_dot, theta_dot).
    pub q: [f64; 4],
    /// R, of the torque.
    pub r: f64,
    /// How time passes.
    pub time: Time,
}

/// Continuous or sampled time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Time {
    /// The cost is an integral.
    Continuous,
    /// The cost is a sum over samples; the torque is held between them.
    Sampled {
        /// Sampling time, s.
        t_s: f64,
        /// The predictor.
        predictor: Rk4,
    },
}

/// A regulator.
#[derive(Clone, Debug, PartialEq)]
pub struct Regulator {
    /// K for u = -K x, P, and the poles of the closed loop.
    pub lqr: Lqr,
    /// The predictor's step, in sampled time.
    pub step: Option<Rk4Step>,
    /// The slowest of the loops A(s) - B(s) K over |theta| <= pi/3, |theta_dot| <= 2 pi.
    pub frozen: FrozenStability<3>,
}

/// Why there is no regulator.
#[derive(Debug, thiserror::Error)]
pub enum RegulatorError {
    /// The sampling time is too long for the predictor.
    #[error(transparent)]
    Step(#[from] Rk4StepError),
    /// No gain.
    #[error("no gain: {0}")]
    Riccati(#[from] RiccatiError),
    /// No model at some tilt.
    #[error("the gain cannot be checked over |theta| <= pi/3: {0}")]
    Motion(String),
    /// The check failed.
    #[error("the gain cannot be checked: {0}")]
    Frozen(#[from] FrozenError),
}

/// Grid points in each direction; odd, so that upright is one of them.
const GRID: usize = 41;
/// Speeds of a drive with Coulomb friction.
const SPEEDS: usize = 5;

impl RegulatorProblem {
    /// Designs the gain and checks it.
    ///
    /// # Errors
    /// The predictor's step is too long, the Riccati equation has no stabilising solution, or the
    /// nonlinear model does not exist at some tilt.
    pub fn solve(&self) -> Result<Regulator, RegulatorError> {
        let q = DMatrix::from_diagonal(&DVector::from_row_slice(&self.q));
        let r = DMatrix::from_element(1, 1, self.r);
        let LinearModel { a, b } = &self.linear;
        let (lqr, step) = match self.time {
            Time::Continuous => (lqr_continuous(a, b, &q, &r)?, None),
            Time::Sampled { t_s, predictor } => {
                let step = check_rk4_step(a, t_s, predictor.substeps)?;
                let sampled = self.sampled(t_s, predictor);
                (lqr_discrete(&sampled.a, &sampled.b, &q, &r)?, Some(step))
            }
        };
        Ok(Regulator {
            frozen: self.frozen(&lqr)?,
            lqr,
            step,
        })
    }

    /// x+ = A_d x + B_d u.
    fn sampled(&self, t_s: f64, predictor: Rk4) -> LinearModel {
        let a = Matrix4::from_column_slice(self.linear.a.as_slice());
        let b = Vector4::from_column_slice(self.linear.b.as_slice());
        LinearModel::from(predictor.discretize(&a, &b, t_s))
    }

    fn frozen(&self, lqr: &Lqr) -> Result<FrozenStability<3>, RegulatorError> {
        let motion = self.ballbot.consistency(limits::THETA);
        if !motion.mass_invertible {
            return Err(RegulatorError::Motion(motion.to_string()));
        }
        let (tilt, rate) = (limits::THETA, limits::THETA_DOT);
        // Coulomb friction damps most at rest, and is the same for both directions.
        let (fastest, speeds) = match self.ballbot.drive.coulomb {
            0.0 => (0.0, 1),
            _ => (limits::PHI_DOT + limits::THETA_DOT, SPEEDS),
        };
        let grid = SchedulingGrid::new(
            Vector3::new(-tilt, -rate, 0.0),
            Vector3::new(tilt, rate, fastest),
            [GRID, GRID, speeds],
        )?;
        let k = RowVector4::from_column_slice(lqr.k.as_slice());
        Ok(frozen_stability(&self.ballbot, &k, &grid)?)
    }
}
