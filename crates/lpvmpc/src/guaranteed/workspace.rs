//! The program of a guaranteed step and its solver.

use super::memory::GuaranteedWorkspaceMemory;
#[cfg(feature = "alloc")]
use crate::memory::Capacity;
use crate::model::Scalar;
use crate::ocp::Ocp;
use crate::solution::{ActiveSet, Solution};
use crate::solver::Solver;

/// Scratch memory of a guaranteed step; may be shared between controllers that run one after the
/// other. The quadratic program of a controller with `NX` states has `NA` = `NX` + 1: the set point is
/// the last one.
#[derive(Debug)]
#[cfg_attr(feature = "alloc", derive(Clone))]
pub struct GuaranteedWorkspace<T: 'static, const NU: usize, const NA: usize> {
    pub(super) ocp: Ocp<T, NA, NU>,
    pub(super) solver: Solver<T, NA, NU>,
    pub(super) solution: Solution<T, NA, NU>,
}

impl<T: Scalar, const NU: usize, const NA: usize> GuaranteedWorkspace<T, NU, NA> {
    /// A workspace in this memory.
    pub fn new(memory: GuaranteedWorkspaceMemory<T, NU, NA>) -> Self {
        let GuaranteedWorkspaceMemory {
            stages,
            own,
            solver,
            u,
            x,
            active,
        } = memory;
        Self {
            ocp: Ocp {
                own,
                ..Ocp::new(stages)
            },
            solver: Solver::new(solver),
            solution: Solution::new(u, x, active),
        }
    }

    /// A workspace with memory of its own, for controllers with these or smaller
    /// [capacities](super::GuaranteedSettings::capacity).
    #[cfg(feature = "alloc")]
    pub fn allocate(capacity: Capacity) -> Self {
        Self::new(GuaranteedWorkspaceMemory::allocate(capacity))
    }

    /// The rows that are active in the last quadratic program: the warm start of the next one.
    pub fn warm_start(&self) -> &ActiveSet<T> {
        &self.solution.active
    }

    /// Takes another warm start for the next quadratic program.
    pub fn set_warm_start(&mut self, active: &ActiveSet<T>) {
        self.solution.active.copy_from(active);
    }

    /// Bounds that are active in the last quadratic program, edges of terminal set and trust
    /// region included.
    pub fn active_bounds(&self) -> usize {
        self.solution.active.len()
    }
}
