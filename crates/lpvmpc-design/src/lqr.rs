//! The linear-quadratic regulator on an infinite horizon.

use nalgebra::{Complex, DMatrix};

use crate::riccati::{LqProblem, RiccatiError, RiccatiSolution, solve_care, solve_dare};

/// The regulator u = -K x that is optimal for x'Q x + u'R u over an infinite horizon.
#[derive(Debug, Clone, PartialEq)]
pub struct Lqr {
    /// K, m x n, for u = **-K** x (the sign of MATLAB's `lqr` and of Karachalios and Abbas).
    pub k: DMatrix<f64>,
    /// P, n x n, symmetric: x'P x is the optimal cost from x on. In continuous time this is an
    /// integral over seconds; the cost *sum* of a loop sampled at t_s needs the P of
    /// [`lqr_discrete`], which is about 1/t_s times as large.
    pub p: DMatrix<f64>,
    /// The poles of A - B K, sorted by real part (1/s in continuous time).
    pub poles: Vec<Complex<f64>>,
}

impl From<RiccatiSolution> for Lqr {
    fn from(solution: RiccatiSolution) -> Self {
        Self {
            k: solution.k,
            p: solution.p,
            poles: solution.poles,
        }
    }
}

/// The regulator of x_dot = A x + B u for the integral of x'Q x + u'R u.
///
/// A (n x n, 1/s), B (n x m), Q (n x n, positive semidefinite), R (m x m, positive definite).
///
/// # Errors
/// As [`solve_care`].
pub fn lqr_continuous(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    q: &DMatrix<f64>,
    r: &DMatrix<f64>,
) -> Result<Lqr, RiccatiError> {
    solve_care(&LqProblem {
        a,
        b,
        q,
        r,
        cross: None,
    })
    .map(Lqr::from)
}

/// The regulator of x+ = A x + B u for the sum of x'Q x + u'R u.
///
/// A (n x n), B (n x m), Q (n x n, positive semidefinite), R (m x m, positive definite).
///
/// # Errors
/// As [`solve_dare`].
pub fn lqr_discrete(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    q: &DMatrix<f64>,
    r: &DMatrix<f64>,
) -> Result<Lqr, RiccatiError> {
    solve_dare(&LqProblem {
        a,
        b,
        q,
        r,
        cross: None,
    })
    .map(Lqr::from)
}
