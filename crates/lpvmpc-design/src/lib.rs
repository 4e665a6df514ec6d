//! Design-time tools for predictive control of linear parameter-varying (LPV) models, for any
//! plant: what is computed once, on a PC, before a controller runs.
//!
//! | for | use |
//! |---|---|
//! | parameters that make a model fit | [`levenberg_marquardt()`], [`gauss_newton`] |
//! | parameters from measured runs | [`ShootingProblem`], [`autocorrelation`] |
//! | a linear model of a nonlinear plant | [`linearize`], [`poles`], [`controllability_rank`] |
//! | a gain and a terminal cost | [`lqr_continuous`], [`lqr_discrete`], [`solve_care`], [`solve_dare`] |
//! | is an embedding the plant that it stands for? | [`embedding_defect`] |
//! | nodes for the embedding along rays from a steady state | [`nodes_along_ray`] |
//! | exact sampling of a frozen model | [`zero_order_hold`] |
//! | is the gain stable at each scheduling? | [`frozen_stability`] |
//! | is the integration step short enough? | [`check_rk4_step`] |
//!
//! Terminal sets and their proofs are in `lpvmpc-certificate`.
//!
//! Gains are for u = **-K** x throughout. All quantities are in SI units, poles in 1/s.
//!
//! # Example
//!
//! A pendulum of 1 m and 1 kg, upright, with a torque at its joint: x = (angle, rate).
//!
//! ```
//! use lpvmpc_design::{check_rk4_step, linearize, lqr_discrete, zero_order_hold};
//! use nalgebra::{DMatrix, DVector, SVector, dmatrix};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let pendulum = |x: &SVector<f64, 2>, u: &SVector<f64, 1>| {
//!     SVector::<f64, 2>::new(x[1], 9.81 * x[0].sin() + u[0])
//! };
//! let upright = linearize(pendulum, &SVector::zeros(), &SVector::zeros())?;
//! assert!(upright.defect.norm() == 0.0, "upright is an equilibrium");
//!
//! let a = DMatrix::from_column_slice(2, 2, upright.a.as_slice());
//! let b = DMatrix::from_column_slice(2, 1, upright.b.as_slice());
//! let sample_time = 0.02; // s
//! check_rk4_step(&a, sample_time, 1)?;
//!
//! let (a_d, b_d) = zero_order_hold(&a, &b, sample_time)?;
//! let q = DMatrix::from_diagonal(&DVector::from_vec(vec![10.0, 1.0]));
//! let lqr = lqr_discrete(&a_d, &b_d, &q, &dmatrix![1.0])?;
//! assert!(lqr.poles.iter().all(|pole| pole.norm() < 1.0));
//!
//! let x = DVector::from_vec(vec![0.1, 0.0]); // 0.1 rad off
//! let u = -&lqr.k * &x;
//! println!("a torque of {:.2} N m", u[0]);
//! assert!(u[0] < 0.0, "the torque brings the pendulum back");
//! # Ok(())
//! # }
//! ```

mod discretize;
mod embedding_check;
mod least_squares;
mod linearize;
mod lqr;
mod matrix_check;
mod modes;
mod number;
mod offset_free;
mod parallel;
mod ray_nodes;
mod residual_tests;
mod riccati;
mod shooting;
mod stability;

pub use discretize::{DiscretizeError, zero_order_hold};
pub use embedding_check::{EmbeddingCheckError, EmbeddingDefect, embedding_defect};
pub use least_squares::{
    Evaluated, Fit, Iteration, LeastSquaresError, LeastSquaresSettings, RankDeficiency,
    ResidualModel, Termination, gauss_newton, levenberg_marquardt,
};
pub use linearize::{Linearization, LinearizeError, Variable, linearize};
pub use lqr::{Lqr, lqr_continuous, lqr_discrete};
pub use matrix_check::{
    MatrixError, check_positive_definite, check_positive_semidefinite, checked_symmetric,
};
pub use modes::{controllability_rank, poles};
pub use number::{number_text, significant_text};
pub use offset_free::{OffsetFreeError, check_offset_free};
pub use parallel::{each, each_with};
pub use ray_nodes::{RayNodes, nodes_along_ray};
pub use residual_tests::{Correlation, NORMAL_95, autocorrelation, cross_correlation};
pub use riccati::{LqProblem, RiccatiError, RiccatiSolution, solve_care, solve_dare};
pub use shooting::{
    LinearizedOutputs, Prior, Reduced, ShootingError, ShootingFit, ShootingModel, ShootingProblem,
    ShootingSettings, ShootingTermination, Unknown,
};
pub use stability::{
    FrozenError, FrozenStability, MOST_RK4_SUBSTEPS, Rk4Step, Rk4StepError, SchedulingGrid,
    accurate_rk4_substeps, check_rk4_step, frozen_stability,
};
