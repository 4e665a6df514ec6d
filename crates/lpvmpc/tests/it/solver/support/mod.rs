//! What the tests of the solver share: problems, other solvers, and figures over many problems.

pub mod census;
pub mod least_distance;
pub mod precision;

use lpvmpc::{Capacity, Ocp, Scalar, Solution, Solver, SolverSettings, Status, WarmStart};

/// Settings without a past, and with room for any number of changes that ends.
pub fn cold<T: Scalar>() -> SolverSettings<T> {
    SolverSettings {
        warm_start: WarmStart::Cold,
        max_changes: Some(20_000),
        ..SolverSettings::default()
    }
}

/// Room for every bound of `ocp` at once, twice: a soft one may have two rows.
pub fn capacity<T: Scalar, const NX: usize, const NU: usize>(ocp: &Ocp<T, NX, NU>) -> Capacity {
    let stages = ocp.stages.len();
    let rows = 2 * (stages * (NX + NU) + NX + ocp.rows.len());
    Capacity {
        stages,
        rows,
        active: rows,
        general_rows: ocp.rows_per_stage,
        ..Capacity::default()
    }
}

/// The answer to `ocp` with these settings from a cold start.
pub fn solve_with<T: Scalar, const NX: usize, const NU: usize>(
    ocp: &Ocp<T, NX, NU>,
    settings: &SolverSettings<T>,
) -> Solution<T, NX, NU> {
    let room = capacity(ocp);
    let mut solution = Solution::allocate(room);
    Solver::allocate(room).solve(ocp, settings, &mut solution);
    solution
}

/// The answer to `ocp` from a cold start.
pub fn solve<T: Scalar, const NX: usize, const NU: usize>(
    ocp: &Ocp<T, NX, NU>,
) -> Solution<T, NX, NU> {
    solve_with(ocp, &cold())
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
        Status::Exceeded(_) => "exceeded",
        Status::Inaccurate(_) => "inaccurate",
        Status::MaxChanges => "maximum of changes",
        Status::WorkingSetFull => "working set full",
        Status::HorizonTooLong => "horizon too long",
        Status::NumericalFailure { .. } => "numerical failure",
        Status::NotFinite => "not finite",
        Status::Refused(_) => "refused",
    }
}
