//! The sizes that there are: what is generic over states and inputs, as one type.

use crate::boundary::Refusal;
use lpvmpc::{
    Capacity, Common, Ocp, Penalty, Solution, Solver, SolverSettings, Status, WarmStart,
    kkt_residual,
};
use lpvmpc_problems::ProblemError;
use lpvmpc_problems::layout::{self, EndParts, Sizes, StageParts};

/// One thing for each size.
pub enum BySize<A, B, C, D> {
    /// 4 states, 1 input.
    S4x1(A),
    /// 8 states, 2 inputs.
    S8x2(B),
    /// 12 states, 4 inputs.
    S12x4(C),
    /// 16 states, 6 inputs.
    S16x6(D),
}

/// A problem of any size.
pub type AnyProblem = BySize<Ocp<f64, 4, 1>, Ocp<f64, 8, 2>, Ocp<f64, 12, 4>, Ocp<f64, 16, 6>>;
/// A solver of any size.
pub type AnySolver = BySize<Memory<4, 1>, Memory<8, 2>, Memory<12, 4>, Memory<16, 6>>;

/// The same expression for each size.
macro_rules! each_size {
    ($any:expr, $one:ident => $body:expr) => {
        match $any {
            BySize::S4x1($one) => $body,
            BySize::S8x2($one) => $body,
            BySize::S12x4($one) => $body,
            BySize::S16x6($one) => $body,
        }
    };
}
pub(crate) use each_size;

/// The same expression for a solver and a problem of its size.
macro_rules! same_size {
    ($solver:expr, $problem:expr, ($memory:ident, $ocp:ident) => $body:expr) => {
        match ($solver, $problem) {
            (BySize::S4x1($memory), BySize::S4x1($ocp)) => Ok($body),
            (BySize::S8x2($memory), BySize::S8x2($ocp)) => Ok($body),
            (BySize::S12x4($memory), BySize::S12x4($ocp)) => Ok($body),
            (BySize::S16x6($memory), BySize::S16x6($ocp)) => Ok($body),
            _ => Err(Refusal::Size),
        }
    };
}
pub(crate) use same_size;

impl AnyProblem {
    /// A problem without bounds and with no cost but unit input weights.
    pub fn new(sizes: &Sizes, common: bool) -> Result<Self, Refusal> {
        if sizes.horizon == 0 || sizes.horizon > usize::from(u16::MAX) {
            return Err(Refusal::Size);
        }
        Ok(match (sizes.nx, sizes.nu) {
            (4, 1) => Self::S4x1(layout::empty(sizes, common)?),
            (8, 2) => Self::S8x2(layout::empty(sizes, common)?),
            (12, 4) => Self::S12x4(layout::empty(sizes, common)?),
            (16, 6) => Self::S16x6(layout::empty(sizes, common)?),
            _ => return Err(Refusal::Size),
        })
    }

    /// Its sizes.
    pub fn sizes(&self) -> Sizes {
        each_size!(self, ocp => Sizes::of(ocp))
    }

    /// Takes over x_0.
    pub fn set_x0(&mut self, x0: &[f64]) {
        each_size!(self, ocp => ocp.x0.copy_from_slice(x0));
    }

    /// Takes over the parts of a stage.
    pub fn set_stage(&mut self, i: usize, parts: &StageParts<'_>) -> Result<(), ProblemError> {
        each_size!(self, ocp => layout::put_stage(parts, i, ocp))
    }

    /// Takes over the parts of the end.
    pub fn set_end(&mut self, parts: &EndParts<'_>) -> Result<(), ProblemError> {
        each_size!(self, ocp => layout::put_end(parts, ocp))
    }

    /// Takes over everything.
    pub fn set_all(&mut self, numbers: &[f64]) -> Result<(), ProblemError> {
        each_size!(self, ocp => layout::read(numbers, ocp))
    }
}

/// A solver with its answer.
pub struct Memory<const NX: usize, const NU: usize> {
    solver: Solver<f64, NX, NU>,
    /// The last answer, from which a warm start begins.
    pub solution: Solution<f64, NX, NU>,
    /// Stages of the last problem.
    pub stages: usize,
}

impl<const NX: usize, const NU: usize> Memory<NX, NU> {
    /// Room for all bounds of problems like this one.
    pub fn for_problem(ocp: &Ocp<f64, NX, NU>) -> Self {
        let capacity = room(ocp);
        Self {
            solver: Solver::allocate(capacity),
            solution: Solution::allocate(capacity),
            stages: ocp.length(),
        }
    }

    /// Solves `ocp`.
    pub fn solve(&mut self, ocp: &Ocp<f64, NX, NU>, warm_start: WarmStart) {
        let settings = SolverSettings {
            warm_start,
            ..SolverSettings::default()
        };
        self.stages = ocp.length();
        self.solver.solve(ocp, &settings, &mut self.solution);
    }

    /// The largest residual of the optimality conditions of `ocp` at the last answer.
    pub fn residual(&self, ocp: &Ocp<f64, NX, NU>) -> f64 {
        kkt_residual(ocp, &self.solution).largest()
    }
}

/// The status as a number of the header.
pub fn status_number<T>(status: &Status<T>) -> i32 {
    match status {
        Status::Solved | Status::Converged | Status::Improved | Status::NoImprovement => 0,
        Status::Infeasible(_) => 1,
        Status::Inaccurate(_) => 2,
        Status::MaxChanges => 3,
        Status::WorkingSetFull => 4,
        Status::HorizonTooLong => 5,
        Status::NumericalFailure { .. } => 6,
        // The last two are of controllers, not of problems.
        Status::NotFinite | Status::Refused(_) | Status::Exceeded(_) => 7,
    }
}

/// Room for every bound that a problem has: a row for each input, the terminal state, and each soft bound
/// or general row; of states only those that are bounded, since memory that is never used costs time, too.
fn room<const NX: usize, const NU: usize>(ocp: &Ocp<f64, NX, NU>) -> Capacity {
    let stages = ocp.length();
    let of = |soft: &[Option<Penalty<f64>>; NX]| soft.iter().flatten().count();
    let of_stage = |common: &Common<f64, NX, NU>| of(&common.soft_x);
    let soft = (0..stages)
        .map(|i| of_stage(ocp.common_at(i)))
        .sum::<usize>();
    let soft = soft + of(&ocp.terminal.soft_x);
    let inputs = stages * NU + NX;
    Capacity {
        stages,
        rows: inputs + soft,
        active: inputs + stages * NX + 2 * soft,
        ..Capacity::default()
    }
    .with_general_rows(ocp.rows_per_stage)
}
