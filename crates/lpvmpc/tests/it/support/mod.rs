//! What the tests of the solver share: problems, other solvers, and figures over many problems.

pub mod census;
pub mod clarabel;
pub mod least_distance;
pub mod problems;
pub mod rng;

use lpvmpc::{Ocp, Solution, Solver, SolverSettings, Status, WarmStart};

/// `work` on a thread with a stack large enough for the longest horizons.
pub fn on_large_stack<R: Send + 'static>(work: impl FnOnce() -> R + Send + 'static) -> R {
    let thread = std::thread::Builder::new().stack_size(256 << 20);
    match thread.spawn(work).unwrap().join() {
        Ok(result) => result,
        Err(panic) => std::panic::resume_unwind(panic),
    }
}

/// Settings without a past, and with room for any number of changes that ends.
pub fn cold() -> SolverSettings<f64> {
    SolverSettings {
        warm_start: WarmStart::Cold,
        max_changes: Some(20_000),
        ..SolverSettings::default()
    }
}

/// The answer to `ocp` from a cold start.
pub fn solve<const NX: usize, const NU: usize, const N: usize, const M: usize, const NG: usize>(
    ocp: &Ocp<f64, NX, NU, N, NG>,
) -> Solution<f64, NX, NU, N, M> {
    let mut solver = Box::new(Solver::new());
    let mut solution = Solution::default();
    solver.solve(ocp, &cold(), &mut solution);
    solution
}

/// Whether two verdicts of one problem can both be right: the same, or the proof that it is infeasible
/// was found by one of them only.
pub fn agree<T>(one: &Status<T>, other: &Status<T>) -> bool {
    let (one, other) = (kind(one), kind(other));
    one == other
        || matches!(
            (one, other),
            ("infeasible", "inaccurate") | ("inaccurate", "infeasible")
        )
}

/// The kind of a status, without its details.
pub fn kind<T>(status: &Status<T>) -> &'static str {
    match status {
        Status::Solved | Status::Converged | Status::Improved | Status::NoImprovement => "solved",
        Status::Infeasible(_) => "infeasible",
        Status::Inaccurate(_) => "inaccurate",
        Status::ChangeCap => "change cap",
        Status::WorkingSetFull => "working set full",
        Status::NumericalFailure { .. } => "numerical failure",
        Status::NotFinite => "not finite",
    }
}
