//! The problem in its standard form, checked, and which of its modes rules out a solution.

use nalgebra::DMatrix;

use super::doubling::Stalled;
use super::{LqProblem, RiccatiError, Time};
use crate::matrix_check::{
    MatrixError, check_finite, check_positive_definite, check_positive_semidefinite, check_shape,
    check_square, checked_symmetric, symmetric_part,
};
use crate::modes::{distance_to_unreachable, poles};

/// A mode nearer than this to being unreachable is blamed for a failure. It is looked at only when
/// there is a failure, so it need not be sharp.
const UNREACHABLE: f64 = 1e-7;

/// The problem without cross term: with u = v - R^-1 S' x it has A - B R^-1 S' and Q - S R^-1 S',
/// and B, R enter as G = B R^-1 B' alone.
pub(super) struct Standard<'a> {
    pub(super) a: DMatrix<f64>,
    b: &'a DMatrix<f64>,
    pub(super) g: DMatrix<f64>,
    pub(super) q: DMatrix<f64>,
    /// The largest entry of R.
    largest_r: f64,
}

impl<'a> Standard<'a> {
    pub(super) fn new(problem: &LqProblem<'a>) -> Result<Self, RiccatiError> {
        let LqProblem { a, b, q, r, cross } = *problem;
        check_square("A", a)?;
        let n = a.nrows();
        check_shape("B", b, (n, b.ncols()), "as many rows as A")?;
        let m = b.ncols();
        check_shape("Q", q, (n, n), "the size of A")?;
        check_shape("R", r, (m, m), "as many rows and columns as B has columns")?;
        let q = checked_symmetric("Q", q)?;
        let r = checked_symmetric("R", r)?;
        check_positive_definite("R", &r)?;
        check_positive_semidefinite("Q", &q)?;
        let largest_r = r.amax();
        let factor = r.cholesky().ok_or(MatrixError::NotPositiveDefinite {
            name: "R",
            smallest_eigenvalue: 0.0,
        })?;
        let g = symmetric_part(&(b * factor.solve(&b.transpose())));
        check_finite("B R^-1 B'", &g)?;
        let Some(s) = cross else {
            return Ok(Self {
                a: a.clone(),
                b,
                g,
                q,
                largest_r,
            });
        };
        check_shape("S", s, (n, m), "the size of B")?;
        let shift = factor.solve(&s.transpose());
        let q = symmetric_part(&(q - s * &shift));
        check_positive_semidefinite("Q - S R^-1 S'", &q)?;
        Ok(Self {
            a: a - b * shift,
            b,
            g,
            q,
            largest_r,
        })
    }

    /// Names the mode that keeps the equation from having a stabilising solution, if one does.
    pub(super) fn blame(&self, time: Time, stalled: Stalled) -> RiccatiError {
        let failure = RiccatiError::NoConvergence {
            reason: stalled.reason,
            doublings: stalled.doublings,
            largest_a: self.a.amax(),
            largest_b: self.b.amax(),
            largest_q: self.q.amax(),
            largest_r: self.largest_r,
        };
        let Ok(open_loop) = poles(&self.a) else {
            return failure;
        };
        let lasting: Vec<_> = open_loop
            .into_iter()
            .filter(|pole| !time.is_stable(*pole, &self.a))
            // Beside entries of A that are this much larger, rounding hides what moves the mode.
            .filter(|pole| time == Time::Continuous || UNREACHABLE * self.a.amax() < pole.norm())
            .collect();
        if let Some(pole) = lasting
            .iter()
            .find(|pole| distance_to_unreachable(&self.a, self.b, **pole) < UNREACHABLE)
        {
            return RiccatiError::NotStabilisable { pole: *pole };
        }
        // (A, Q) detectable is (A', Q) stabilisable.
        let transposed = self.a.transpose();
        if let Some(pole) = lasting
            .iter()
            .find(|pole| distance_to_unreachable(&transposed, &self.q, **pole) < UNREACHABLE)
        {
            return RiccatiError::NotDetectable { pole: *pole };
        }
        failure
    }
}
