//! QuadProg++, a dense dual active-set solver (Goldfarb and Idnani) in C++.

use crate::BenchmarkError;
use crate::comparison::Contender;
use lpvmpc::Ocp;
use lpvmpc_testkit::dense::{DenseQp, Rows};
use nalgebra::{DMatrix, DVector, SVector};
use ndarray::{ArrayView1, ArrayView2, ShapeError, ViewRepr};
use quadprogpp::Constraints;

type ViewedConstraints<'a> = Constraints<ViewRepr<&'a f64>, ViewRepr<&'a f64>>;

const NAME: &str = "QuadProg++";

/// Condensing, then the solution of the dense problem.
pub struct QuadProgPp<'a, const NX: usize, const NU: usize> {
    problems: &'a [Ocp<f64, NX, NU>],
    qp: DenseQp<NX, NU>,
}

impl<'a, const NX: usize, const NU: usize> QuadProgPp<'a, NX, NU> {
    /// Memory for these problems.
    ///
    /// # Errors
    /// [`BenchmarkError::Refused`]: there is none, or its bounds are soft.
    pub fn new(problems: &'a [Ocp<f64, NX, NU>]) -> Result<Self, BenchmarkError> {
        let first = problems.first().ok_or_else(|| refused("no problem"))?;
        let qp = DenseQp::allocate(first).ok_or_else(|| refused("soft bounds"))?;
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
            transposed(&qp.hessian).map_err(refused)?,
            vector(&qp.gradient),
            constraints(&qp.equality)?,
            constraints(&qp.inequality)?,
        )
        .map_err(|error| BenchmarkError::NotSolved {
            solver: NAME,
            problem,
            status: error.to_string(),
        })?;
        Ok(SVector::from_column_slice(&inputs[..NU]))
    }
}

/// As quadprogpp has them, one column per constraint, and without a copy.
fn constraints(rows: &Rows) -> Result<Option<ViewedConstraints<'_>>, BenchmarkError> {
    let coefficients = transposed(&rows.coefficients).map_err(refused)?;
    Ok(Constraints::some(coefficients, vector(&rows.constants)))
}

/// The transpose: the columns of `matrix` are contiguous, and so are ndarray's rows.
fn transposed(matrix: &DMatrix<f64>) -> Result<ArrayView2<'_, f64>, ShapeError> {
    ArrayView2::from_shape((matrix.ncols(), matrix.nrows()), matrix.as_slice())
}

fn vector(vector: &DVector<f64>) -> ArrayView1<'_, f64> {
    ArrayView1::from(vector.as_slice())
}

fn refused(reason: impl ToString) -> BenchmarkError {
    BenchmarkError::Refused {
        solver: NAME,
        reason: reason.to_string(),
    }
}
