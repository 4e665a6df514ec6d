//! Clarabel, an interior-point solver in Rust, with its default tolerances.

use crate::BenchmarkError;
use crate::comparison::Contender;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SolverStatus};
use lpvmpc::Ocp;
use lpvmpc_testkit::clarabel::ConeProgram;
use lpvmpc_testkit::sparse;
use nalgebra::SVector;

const NAME: &str = "Clarabel";

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
        let solver = solver(first)?;
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
        let solvers: Result<_, _> = programs(problems).iter().map(solver).collect();
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

fn solver(program: &ConeProgram) -> Result<DefaultSolver<f64>, BenchmarkError> {
    // The presolver would forbid new data; it has nothing to remove here.
    let settings = DefaultSettings {
        verbose: false,
        max_threads: 1,
        presolve_enable: false,
        ..DefaultSettings::default()
    };
    program.solver(settings).map_err(refused)
}

fn refused(reason: impl ToString) -> BenchmarkError {
    BenchmarkError::Refused {
        solver: NAME,
        reason: reason.to_string(),
    }
}
