//! OSQP, an operator-splitting solver in C.

use crate::BenchmarkError;
use crate::comparison::Contender;
use lpvmpc::Ocp;
use lpvmpc_testkit::sparse::{self, Csc, SparseQp};
use nalgebra::SVector;
use osqp::{CscMatrix, Problem, Settings, Status};

const NAME: &str = "OSQP";

/// New data for one solver, then the solution, from the previous one as OSQP does by itself.
pub struct Osqp {
    sequence: Vec<Data>,
    solver: Problem,
}

struct Data {
    p: CscMatrix<'static>,
    q: Vec<f64>,
    a: CscMatrix<'static>,
    lower: Vec<f64>,
    upper: Vec<f64>,
}

impl Osqp {
    /// A solver with the data of the first problem, and OSQP's absolute and relative
    /// `tolerance`.
    ///
    /// # Errors
    /// [`BenchmarkError::Refused`].
    pub fn new<const NX: usize, const NU: usize>(
        problems: &[Ocp<f64, NX, NU>],
        tolerance: f64,
    ) -> Result<Self, BenchmarkError> {
        let sequence: Vec<Data> = sparse::sequence(problems).into_iter().map(data).collect();
        let first = sequence.first().ok_or_else(|| refused("no problem"))?;
        // Without its scaling of the data it is several times faster on the closed loops. A fixed
        // interval, because by default it follows from the time that the set-up took.
        let settings = Settings::default()
            .verbose(false)
            .scaling(None)
            .eps_abs(tolerance)
            .eps_rel(tolerance)
            .adaptive_rho_interval(Some(25))
            .max_iter(100_000);
        let solver = Problem::new(
            first.p.clone(),
            &first.q,
            first.a.clone(),
            &first.lower,
            &first.upper,
            &settings,
        )
        .map_err(refused)?;
        Ok(Self { sequence, solver })
    }
}

impl<const NU: usize> Contender<NU> for Osqp {
    fn solve(&mut self, problem: usize) -> Result<SVector<f64, NU>, BenchmarkError> {
        let data = &self.sequence[problem];
        self.solver.update_P_A(&data.p, &data.a);
        self.solver.update_lin_cost(&data.q);
        self.solver.update_bounds(&data.lower, &data.upper);
        match self.solver.solve() {
            Status::Solved(solution) => Ok(SVector::from_column_slice(&solution.x()[..NU])),
            status => Err(BenchmarkError::NotSolved {
                solver: NAME,
                problem,
                status: in_words(&status).to_owned(),
            }),
        }
    }
}

fn in_words(status: &Status<'_>) -> &'static str {
    match status {
        Status::Solved(_) => "solved",
        Status::SolvedInaccurate(_) => "solved, but not to its tolerance",
        Status::MaxIterationsReached(_) => "cap on iterations reached",
        Status::TimeLimitReached(_) => "time limit reached",
        Status::PrimalInfeasible(_) | Status::PrimalInfeasibleInaccurate(_) => "infeasible",
        Status::DualInfeasible(_) | Status::DualInfeasibleInaccurate(_) => "unbounded",
        Status::NonConvex(_) => "not convex",
        _ => "unknown",
    }
}

fn data(qp: SparseQp) -> Data {
    Data {
        p: matrix(qp.p),
        q: qp.q,
        a: matrix(qp.a),
        lower: qp.lower,
        upper: qp.upper,
    }
}

fn matrix(csc: Csc) -> CscMatrix<'static> {
    CscMatrix {
        nrows: csc.rows,
        ncols: csc.columns,
        indptr: csc.starts.into(),
        indices: csc.row_indices.into(),
        data: csc.values.into(),
    }
}

fn refused(reason: impl ToString) -> BenchmarkError {
    BenchmarkError::Refused {
        solver: NAME,
        reason: reason.to_string(),
    }
}
