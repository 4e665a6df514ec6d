//! Clarabel, an interior-point solver in Rust, with its default tolerances.

use crate::BenchmarkError;
use crate::comparison::Contender;
use crate::sparse::{self, Csc, SparseQp};
use clarabel::algebra::CscMatrix;
use clarabel::solver::{
    DefaultSettings, DefaultSolver, IPSolver, NonnegativeConeT, SolverStatus, ZeroConeT,
};
use lpvmpc::Ocp;
use nalgebra::SVector;

const NAME: &str = "Clarabel";

/// Minimise z'Pz/2 + q'z with Az + s = b; s is zero in the first rows, then nonnegative.
struct ConeProgram {
    p: CscMatrix<f64>,
    q: Vec<f64>,
    a: CscMatrix<f64>,
    b: Vec<f64>,
    equalities: usize,
}

/// New data for one solver, then the solution.
pub struct ClarabelUpdate {
    programs: Vec<ConeProgram>,
    solver: DefaultSolver<f64>,
}

/// The solution alone: every problem has a solver that was set up beforehand.
pub struct ClarabelSolve {
    solvers: Vec<DefaultSolver<f64>>,
}

impl ClarabelUpdate {
    /// A solver with the data of the first problem.
    ///
    /// # Errors
    /// [`BenchmarkError::Refused`].
    pub fn new<const NX: usize, const NU: usize>(
        problems: &[Ocp<f64, NX, NU>],
    ) -> Result<Self, BenchmarkError> {
        let programs = programs(problems);
        let first = programs.first().ok_or_else(|| refused("no problem"))?;
        let solver = first.solver()?;
        Ok(Self { programs, solver })
    }
}

impl ClarabelSolve {
    /// A solver for each problem.
    ///
    /// # Errors
    /// [`BenchmarkError::Refused`].
    pub fn new<const NX: usize, const NU: usize>(
        problems: &[Ocp<f64, NX, NU>],
    ) -> Result<Self, BenchmarkError> {
        let solvers: Result<_, _> = programs(problems).iter().map(ConeProgram::solver).collect();
        Ok(Self { solvers: solvers? })
    }
}

impl<const NU: usize> Contender<NU> for ClarabelUpdate {
    fn solve(&mut self, problem: usize) -> Result<SVector<f64, NU>, BenchmarkError> {
        let ConeProgram { p, q, a, b, .. } = &self.programs[problem];
        self.solver
            .update_data(&p.nzval, q, &a.nzval, b)
            .map_err(refused)?;
        first_input(&mut self.solver, problem)
    }
}

impl<const NU: usize> Contender<NU> for ClarabelSolve {
    fn solve(&mut self, problem: usize) -> Result<SVector<f64, NU>, BenchmarkError> {
        first_input(&mut self.solvers[problem], problem)
    }
}

fn first_input<const NU: usize>(
    solver: &mut DefaultSolver<f64>,
    problem: usize,
) -> Result<SVector<f64, NU>, BenchmarkError> {
    solver.solve();
    match solver.solution.status {
        SolverStatus::Solved => Ok(SVector::from_column_slice(&solver.solution.x[..NU])),
        status => Err(BenchmarkError::NotSolved {
            solver: NAME,
            problem,
            status: status.to_string(),
        }),
    }
}

fn programs<const NX: usize, const NU: usize>(problems: &[Ocp<f64, NX, NU>]) -> Vec<ConeProgram> {
    let sequence = sparse::sequence(problems).into_iter();
    sequence.map(ConeProgram::new).collect()
}

impl ConeProgram {
    /// Every finite side of a bound becomes a row of its own.
    fn new(qp: SparseQp) -> Self {
        let mut equalities = 0;
        let mut b = Vec::new();
        let mut rows_of: Vec<Vec<(usize, f64)>> = vec![Vec::new(); qp.lower.len()];
        for ((lower, upper), rows) in qp.lower.iter().zip(&qp.upper).zip(&mut rows_of) {
            if lower == upper {
                equalities += 1;
                rows.push((b.len(), 1.0));
                b.push(*upper);
                continue;
            }
            for (sign, limit) in [(1.0, upper), (-1.0, lower)] {
                if limit.is_finite() {
                    rows.push((b.len(), sign));
                    b.push(sign * limit);
                }
            }
        }
        Self {
            a: expand(&qp.a, &rows_of, b.len()),
            p: matrix(qp.p),
            q: qp.q,
            b,
            equalities,
        }
    }

    fn solver(&self) -> Result<DefaultSolver<f64>, BenchmarkError> {
        let cones = [
            ZeroConeT(self.equalities),
            NonnegativeConeT(self.b.len() - self.equalities),
        ];
        // The presolver would forbid new data; it has nothing to remove here.
        let settings = DefaultSettings {
            verbose: false,
            max_threads: 1,
            presolve_enable: false,
            ..DefaultSettings::default()
        };
        DefaultSolver::new(&self.p, &self.q, &self.a, &self.b, &cones, settings).map_err(refused)
    }
}

/// `a` with each of its rows in the given places, times the given factors.
fn expand(a: &Csc, rows_of: &[Vec<(usize, f64)>], rows: usize) -> CscMatrix<f64> {
    let mut colptr = vec![0];
    let mut rowval = Vec::new();
    let mut nzval = Vec::new();
    for column in a.starts.windows(2) {
        for entry in column[0]..column[1] {
            for (row, factor) in &rows_of[a.row_indices[entry]] {
                rowval.push(*row);
                nzval.push(factor * a.values[entry]);
            }
        }
        colptr.push(rowval.len());
    }
    CscMatrix {
        m: rows,
        n: a.columns,
        colptr,
        rowval,
        nzval,
    }
}

fn matrix(csc: Csc) -> CscMatrix<f64> {
    CscMatrix {
        m: csc.rows,
        n: csc.columns,
        colptr: csc.starts,
        rowval: csc.row_indices,
        nzval: csc.values,
    }
}

fn refused(reason: impl ToString) -> BenchmarkError {
    BenchmarkError::Refused {
        solver: NAME,
        reason: reason.to_string(),
    }
}
