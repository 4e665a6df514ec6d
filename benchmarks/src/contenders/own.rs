//! The solver of `lpvmpc`.

use crate::BenchmarkError;
use crate::comparison::Contender;
use lpvmpc::{Ocp, Solution, Solver, SolverSettings};
use lpvmpc_sequences::working_memory;
use nalgebra::SVector;

/// Our solver. The first problem of a sequence is solved cold, each other one as the settings
/// say.
pub struct Own<'a, const NX: usize, const NU: usize> {
    problems: &'a [Ocp<f64, NX, NU>],
    settings: SolverSettings<f64>,
    solver: Solver<f64, NX, NU>,
    solution: Solution<f64, NX, NU>,
}

impl<'a, const NX: usize, const NU: usize> Own<'a, NX, NU> {
    /// The solver, with room for every bound of these problems.
    pub fn new(problems: &'a [Ocp<f64, NX, NU>], settings: SolverSettings<f64>) -> Self {
        let capacity = working_memory(problems);
        Self {
            problems,
            settings,
            solver: Solver::allocate(capacity),
            solution: Solution::allocate(capacity),
        }
    }

    /// The last solution.
    pub fn solution(&self) -> &Solution<f64, NX, NU> {
        &self.solution
    }

    /// The first inputs of all problems, and how many bounds are active on average.
    ///
    /// # Errors
    /// [`BenchmarkError::NotSolved`].
    pub fn solve_all(&mut self) -> Result<(Vec<SVector<f64, NU>>, f64), BenchmarkError> {
        let mut inputs = Vec::with_capacity(self.problems.len());
        let mut active = 0;
        for problem in 0..self.problems.len() {
            inputs.push(self.solve(problem)?);
            active += self.solution.active.len();
        }
        Ok((inputs, active as f64 / self.problems.len() as f64))
    }
}

impl<const NX: usize, const NU: usize> Contender<NU> for Own<'_, NX, NU> {
    fn solve(&mut self, problem: usize) -> Result<SVector<f64, NU>, BenchmarkError> {
        if problem == 0 {
            self.solution.active.clear();
        }
        let ocp = &self.problems[problem];
        self.solver.solve(ocp, &self.settings, &mut self.solution);
        if self.solution.status.is_solved() {
            Ok(self.solution.first_input())
        } else {
            Err(BenchmarkError::NotSolved {
                solver: "lpvmpc",
                problem,
                status: self.solution.status.to_string(),
            })
        }
    }
}
