//! Algebraic Riccati equations by structure-preserving doubling.
//!
//! One doubling step squares the closed loop, so the iteration converges quadratically and needs
//! no eigenvectors: about ten steps of a few products and one LU factorisation of size n. Sources:
//! Chu, Fan, Lin, Wang, "Structure-preserving algorithms for periodic discrete-time algebraic
//! Riccati equations", Int. J. Control 77 (2004), for the discrete equation; Chu, Fan, Lin, "A
//! structure-preserving doubling algorithm for continuous-time algebraic Riccati equations",
//! Linear Algebra Appl. 396 (2005), for the continuous one, which a Cayley transform brings to
//! the discrete form. Newton's method (Kleinman 1968, Hewer 1971) then removes what rounding left.

mod candidate;
mod doubling;
mod standard;

use nalgebra::{Complex, DMatrix};
use thiserror::Error;

use crate::matrix_check::{MatrixError, unit};
use crate::modes::{pole_text, poles};
use candidate::Candidate;
use doubling::{Doubling, Stalled};
use standard::Standard;

/// The linear-quadratic problem behind a Riccati equation: minimise the integral (continuous time)
/// or the sum (discrete time) of x'Q x + 2 x'S u + u'R u over the inputs of x_dot = A x + B u, or
/// x+ = A x + B u.
#[derive(Debug, Clone, Copy)]
pub struct LqProblem<'a> {
    /// A, n x n: 1/s in continuous time.
    pub a: &'a DMatrix<f64>,
    /// B, n x m.
    pub b: &'a DMatrix<f64>,
    /// Q, n x n, symmetric, positive semidefinite: state cost.
    pub q: &'a DMatrix<f64>,
    /// R, m x m, symmetric, positive definite: input cost.
    pub r: &'a DMatrix<f64>,
    /// S, n x m: cross cost. [Q S; S' R] must be positive semidefinite. `None` is S = 0.
    pub cross: Option<&'a DMatrix<f64>>,
}

/// The stabilising solution of a Riccati equation and what it was checked against.
#[derive(Debug, Clone, PartialEq)]
pub struct RiccatiSolution {
    /// P, n x n, symmetric, positive semidefinite: x'P x is the optimal cost from x on.
    pub p: DMatrix<f64>,
    /// K, m x n: the optimal input is u = -K x.
    pub k: DMatrix<f64>,
    /// The poles of A - B K, sorted by real part: all in the open left half plane (continuous
    /// time, 1/s) or in the open unit disc (discrete time).
    pub poles: Vec<Complex<f64>>,
    /// Frobenius norm of the equation's residual at P over the sum of the norms of its terms.
    pub relative_residual: f64,
    /// Doubling steps taken: P holds 2^doublings steps of the recursion.
    pub doublings: usize,
}

/// Why a Riccati equation has no stabilising solution, or none was found.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum RiccatiError {
    /// A matrix is not what the problem asks for.
    #[error(transparent)]
    Matrix(#[from] MatrixError),
    /// A mode that does not decay is out of reach of the inputs.
    #[error(
        "(A, B) is not stabilisable: no input moves the mode with pole {}, \
         which does not decay by itself",
        pole_text(*pole)
    )]
    NotStabilisable {
        /// The pole of A.
        pole: Complex<f64>,
    },
    /// A mode that does not decay costs nothing, so the optimal input leaves it alone.
    #[error(
        "(A, Q) is not detectable: the mode with pole {} does not decay by itself \
         and Q gives it no cost",
        pole_text(*pole)
    )]
    NotDetectable {
        /// The pole of A.
        pole: Complex<f64>,
    },
    /// The iteration stopped and no mode is to blame.
    #[error(
        "no stabilising solution was found: {reason} (after {doublings} doubling steps). The \
         largest entries are {largest_a:.0e} of A, {largest_b:.0e} of B, {largest_q:.0e} of Q and \
         {largest_r:.0e} of R. If these are far apart, weights of similar cost and units of similar \
         size will do; if not, a pole of the optimal loop may lie on the stability limit"
    )]
    NoConvergence {
        /// What went wrong.
        reason: &'static str,
        /// Doubling steps taken.
        doublings: usize,
        /// The largest absolute value in A.
        largest_a: f64,
        /// The same in B.
        largest_b: f64,
        /// The same in Q.
        largest_q: f64,
        /// The same in R.
        largest_r: f64,
    },
    /// The equation does not hold at the P that was found.
    #[error(
        "the Riccati solution is too inaccurate: its relative residual is {relative_residual:e}, \
         allowed are {allowed:e}. Scale the states and inputs to similar sizes"
    )]
    Inaccurate {
        /// Relative residual, see [`RiccatiSolution::relative_residual`].
        relative_residual: f64,
        /// The largest one accepted.
        allowed: f64,
    },
}

/// The largest relative residual a solution may have.
const RESIDUAL_TOLERANCE: f64 = 1e-10;

/// A pole of the optimal loop must keep this distance from the stability limit (relative to the
/// norm of the loop matrix in continuous time) to count as stable: below it is rounding.
const STABILITY_MARGIN: f64 = 1e-12;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Time {
    Continuous,
    Discrete,
}

impl Time {
    /// Whether the mode of this pole of `matrix` decays.
    fn is_stable(self, pole: Complex<f64>, matrix: &DMatrix<f64>) -> bool {
        match self {
            Self::Continuous => {
                let unit = unit(matrix);
                pole.re / unit < -STABILITY_MARGIN * (matrix / unit).norm()
            }
            Self::Discrete => pole.norm() < 1.0 - STABILITY_MARGIN,
        }
    }
}

/// Solves the continuous algebraic Riccati equation
///
/// ```text
/// A'P + P A - (P B + S) R^-1 (B'P + S') + Q = 0,     K = R^-1 (B'P + S')
/// ```
///
/// for its stabilising P: A - B K has all poles in the open left half plane.
///
/// # Errors
/// A matrix of wrong shape, not finite, not symmetric; R not positive definite; Q - S R^-1 S' not
/// positive semidefinite; (A, B) not stabilisable; (A, Q) not detectable; no convergence.
pub fn solve_care(problem: &LqProblem<'_>) -> Result<RiccatiSolution, RiccatiError> {
    solve(problem, Time::Continuous)
}

/// Solves the discrete algebraic Riccati equation
///
/// ```text
/// P = A'P A - (A'P B + S)(R + B'P B)^-1 (B'P A + S') + Q,     K = (R + B'P B)^-1 (B'P A + S')
/// ```
///
/// for its stabilising P: A - B K has all poles in the open unit disc.
///
/// # Errors
/// As [`solve_care`].
pub fn solve_dare(problem: &LqProblem<'_>) -> Result<RiccatiSolution, RiccatiError> {
    solve(problem, Time::Discrete)
}

fn solve(problem: &LqProblem<'_>, time: Time) -> Result<RiccatiSolution, RiccatiError> {
    let standard = Standard::new(problem)?;
    let blame = |stalled| standard.blame(time, stalled);
    let (p, doublings) = Doubling::of(time, &standard.a, &standard.g, &standard.q)
        .and_then(Doubling::run)
        .map_err(blame)?;
    let solution = Candidate::at(problem, time, p)
        .map_err(|reason| blame(Stalled { reason, doublings }))?
        .refined();
    let poles = poles(&solution.closed_loop)?;
    if !poles
        .iter()
        .all(|pole| time.is_stable(*pole, &solution.closed_loop))
    {
        return Err(blame(Stalled {
            reason: "the loop A - B K at the limit is not stable",
            doublings,
        }));
    }
    if solution.relative_residual > RESIDUAL_TOLERANCE {
        return Err(RiccatiError::Inaccurate {
            relative_residual: solution.relative_residual,
            allowed: RESIDUAL_TOLERANCE,
        });
    }
    Ok(RiccatiSolution {
        p: solution.p,
        k: solution.k,
        poles,
        relative_residual: solution.relative_residual,
        doublings,
    })
}
