//! A P that should solve the equation: its gain, its residual, and Newton's correction of it.

use std::iter::successors;

use nalgebra::DMatrix;

use super::doubling::{Doubling, LEFT_THE_NUMBERS};
use super::{LqProblem, Time};
use crate::matrix_check::symmetric_part;

/// Newton corrections at most. Each squares the error, down to rounding, once it is small.
const CORRECTION_CAP: usize = 10;

/// A relative residual that no correction lowers.
const ROUNDING: f64 = 1e-15;

pub(super) struct Candidate<'a> {
    problem: &'a LqProblem<'a>,
    time: Time,
    pub(super) p: DMatrix<f64>,
    /// K of u = -K x.
    pub(super) k: DMatrix<f64>,
    /// A - B K.
    pub(super) closed_loop: DMatrix<f64>,
    /// The left-hand side of the equation as the user wrote it, not of the doubled form.
    residual: DMatrix<f64>,
    /// Norm of the residual over the sum of the norms of the equation's terms.
    pub(super) relative_residual: f64,
}

impl<'a> Candidate<'a> {
    /// The reason if the weight of the input is not positive definite at this P, or the residual
    /// not finite.
    pub(super) fn at(
        problem: &'a LqProblem<'a>,
        time: Time,
        p: DMatrix<f64>,
    ) -> Result<Self, &'static str> {
        let LqProblem { a, b, q, r, cross } = *problem;
        let bp = b.transpose() * &p;
        // K = weight^-1 right, and the gain saves K' weight K.
        let (weight, mut right) = match time {
            Time::Continuous => (r.clone(), bp),
            Time::Discrete => (r + &bp * b, bp * a),
        };
        if let Some(s) = cross {
            right += s.transpose();
        }
        let weight = symmetric_part(&weight);
        let factor = weight.clone().cholesky();
        let k = factor
            .ok_or("the input weight R + B'P B at the limit is not positive definite")?
            .solve(&right);
        let saved = k.transpose() * weight * &k;
        let (drift, kept) = match time {
            Time::Continuous => (a.transpose() * &p + &p * a, 0.0),
            Time::Discrete => (a.transpose() * &p * a - &p, p.norm()),
        };
        let scale = drift.norm() + kept + saved.norm() + q.norm();
        let residual = symmetric_part(&(drift - saved + q));
        let relative_residual = if scale > 0.0 {
            residual.norm() / scale
        } else {
            0.0
        };
        if !relative_residual.is_finite() {
            return Err(LEFT_THE_NUMBERS);
        }
        Ok(Self {
            closed_loop: a - b * &k,
            problem,
            time,
            p,
            k,
            residual,
            relative_residual,
        })
    }

    /// The best candidate along Newton's corrections of this one. From a stabilising gain they
    /// converge, but the first may raise the residual, so a rise does not end them.
    pub(super) fn refined(self) -> Self {
        if self.relative_residual <= ROUNDING {
            return self;
        }
        successors(self.corrected(), Self::corrected)
            .take(CORRECTION_CAP)
            .fold(self, |best, next| {
                if next.relative_residual < best.relative_residual {
                    next
                } else {
                    best
                }
            })
    }

    /// One step of Newton's method: the correction D solves the equation linearised at P, with
    /// A_K = A - B K, A_K'D + D A_K + residual = 0 or A_K'D A_K - D + residual = 0. This is a
    /// Riccati equation without input, so doubling solves it too (Smith's iteration).
    fn corrected(&self) -> Option<Self> {
        let n = self.p.nrows();
        let no_input = DMatrix::zeros(n, n);
        let (correction, _) = Doubling::of(self.time, &self.closed_loop, &no_input, &self.residual)
            .and_then(Doubling::run)
            .ok()?;
        Self::at(self.problem, self.time, &self.p + correction).ok()
    }
}
