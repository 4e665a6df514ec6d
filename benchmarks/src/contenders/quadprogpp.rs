//! QuadProg++, a dense dual active-set solver (Goldfarb and Idnani) in C++.

use crate::BenchmarkError;
use crate::comparison::Contender;
use crate::condensed::CondensedQp;
use lpvmpc::Ocp;
use nalgebra::SVector;
use quadprogpp::Constraints;

const NAME: &str = "QuadProg++";

/// Condensing, then the solution of the dense problem.
pub struct QuadProgPp<'a, const NX: usize, const NU: usize> {
    problems: &'a [Ocp<f64, NX, NU>],
    qp: CondensedQp<NX, NU>,
}

impl<'a, const NX: usize, const NU: usize> QuadProgPp<'a, NX, NU> {
    /// Memory for these problems.
    ///
    /// # Errors
    /// [`BenchmarkError::Refused`]: there is none.
    pub fn new(problems: &'a [Ocp<f64, NX, NU>]) -> Result<Self, BenchmarkError> {
        let first = problems.first().ok_or_else(|| refused("no problem"))?;
        let qp = CondensedQp::new(first);
        Ok(Self { problems, qp })
    }

    /// Condensing alone.
    pub fn condense(&mut self, problem: usize) {
        self.qp.condense(&self.problems[problem]);
    }
}

impl<const NX: usize, const NU: usize> Contender<NU> for QuadProgPp<'_, NX, NU> {
    fn solve(&mut self, problem: usize) -> Result<SVector<f64, NU>, BenchmarkError> {
        self.condense(problem);
        let qp = &self.qp;
        let (inputs, _) = quadprogpp::solve(
            qp.hessian.view(),
            qp.gradient.view(),
            Constraints::some(qp.equality.view(), qp.equality_offset.view()),
            Constraints::some(qp.inequality.view(), qp.inequality_offset.view()),
        )
        .map_err(|error| BenchmarkError::NotSolved {
            solver: NAME,
            problem,
            status: error.to_string(),
        })?;
        Ok(SVector::from_column_slice(&inputs[..NU]))
    }
}

fn refused(reason: impl ToString) -> BenchmarkError {
    BenchmarkError::Refused {
        solver: NAME,
        reason: reason.to_string(),
    }
}
