//! The memory of a guaranteed controller and its workspace.

use super::plan::PlannedStage;
use super::slopes::SampleSlopes;
use crate::list::List;
use crate::many_bounds::ManyBoundsArrays;
use crate::memory::{Capacity, SolverArrays, SolverMemory};
use crate::model::Scalar;
use crate::ocp::{Common, Stage};
use crate::solution::PackedRow;
use nalgebra::SVector;

/// Memory of a [`GuaranteedController`](crate::GuaranteedController): on the heap, or
/// [lent](GuaranteedArrays::lend) arrays.
#[derive(Debug)]
pub struct GuaranteedMemory<T: 'static, const NX: usize, const NU: usize> {
    /// The last plan and those that are compared in a step, one entry for each sample.
    pub(super) plans: [List<PlannedStage<T, NX, NU>>; 4],
    /// One for each sample.
    pub(super) drift: List<SVector<T, NX>>,
    /// One for each sample.
    pub(super) slopes: List<SampleSlopes<T, NX, NU>>,
    /// One for each sample.
    pub(super) aims: List<T>,
}

impl<T, const NX: usize, const NU: usize> GuaranteedMemory<T, NX, NU> {
    /// Bytes that this horizon takes, as [`SolverMemory::bytes`].
    pub const fn bytes(horizon: usize) -> usize {
        let stage = 4 * size_of::<PlannedStage<T, NX, NU>>() + size_of::<SampleSlopes<T, NX, NU>>();
        horizon * (stage + size_of::<SVector<T, NX>>() + size_of::<T>())
    }
}

#[cfg(feature = "alloc")]
impl<T: Scalar, const NX: usize, const NU: usize> GuaranteedMemory<T, NX, NU> {
    /// As much as this horizon needs, on the heap.
    pub fn allocate(horizon: usize) -> Self {
        Self {
            plans: core::array::from_fn(|_| List::repeat(PlannedStage::zeros(), horizon)),
            drift: List::repeat(SVector::zeros(), horizon),
            slopes: List::repeat(SampleSlopes::unknown(), horizon),
            aims: List::repeat(T::zero(), horizon),
        }
    }
}

/// The same as arrays, for horizons of up to `N` samples.
#[derive(Clone, Copy, Debug)]
pub struct GuaranteedArrays<T, const NX: usize, const NU: usize, const N: usize> {
    plans: [[PlannedStage<T, NX, NU>; N]; 4],
    drift: [SVector<T, NX>; N],
    slopes: [SampleSlopes<T, NX, NU>; N],
    aims: [T; N],
}

impl<T: Scalar, const NX: usize, const NU: usize, const N: usize> GuaranteedArrays<T, NX, NU, N> {
    /// The arrays as memory of a controller.
    pub fn lend(&'static mut self) -> GuaranteedMemory<T, NX, NU> {
        GuaranteedMemory {
            plans: self.plans.each_mut().map(|list| List::Static(list)),
            drift: List::Static(&mut self.drift),
            slopes: List::Static(&mut self.slopes),
            aims: List::Static(&mut self.aims),
        }
    }
}

impl<T: Scalar, const NX: usize, const NU: usize, const N: usize> Default
    for GuaranteedArrays<T, NX, NU, N>
{
    #[inline(always)]
    fn default() -> Self {
        Self {
            plans: [[PlannedStage::zeros(); N]; 4],
            drift: [SVector::zeros(); N],
            slopes: [SampleSlopes::unknown(); N],
            aims: [T::zero(); N],
        }
    }
}

/// Memory of a [`GuaranteedWorkspace`](crate::GuaranteedWorkspace): on the heap, or
/// [lent](GuaranteedWorkspaceArrays::lend) arrays.
#[derive(Debug)]
pub struct GuaranteedWorkspaceMemory<T: 'static, const NU: usize, const NA: usize> {
    pub(super) stages: List<Stage<T, NA, NU>>,
    pub(super) own: List<Common<T, NA, NU>>,
    pub(super) solver: SolverMemory<T, NA, NU>,
    pub(super) u: List<SVector<T, NU>>,
    pub(super) x: List<SVector<T, NA>>,
    pub(super) active: List<PackedRow<T>>,
}

impl<T, const NU: usize, const NA: usize> GuaranteedWorkspaceMemory<T, NU, NA> {
    /// Bytes that a capacity takes, as [`SolverMemory::bytes`].
    pub const fn bytes(capacity: Capacity) -> usize {
        let stage = size_of::<Stage<T, NA, NU>>() + size_of::<Common<T, NA, NU>>();
        let trial = size_of::<SVector<T, NU>>() + size_of::<SVector<T, NA>>();
        SolverMemory::<T, NA, NU>::bytes(capacity)
            + capacity.stages * (stage + trial)
            + capacity.active * size_of::<PackedRow<T>>()
    }
}

#[cfg(feature = "alloc")]
impl<T: Scalar, const NU: usize, const NA: usize> GuaranteedWorkspaceMemory<T, NU, NA> {
    /// As much as is needed, on the heap.
    pub fn allocate(capacity: Capacity) -> Self {
        let Capacity { stages, active, .. } = capacity;
        Self {
            stages: List::repeat(Stage::new(), stages),
            own: List::repeat(Common::default(), stages),
            solver: SolverMemory::allocate(capacity),
            u: List::repeat(SVector::zeros(), stages),
            x: List::repeat(SVector::zeros(), stages),
            active: List::repeat(PackedRow::empty(), active),
        }
    }
}

impl<T: Scalar, const NU: usize, const NA: usize> GuaranteedWorkspaceMemory<T, NU, NA> {
    /// The same with memory for many active input bounds, for two stages more than the horizon has
    /// samples.
    pub fn with_many_bounds<const NP: usize, const B: usize>(
        self,
        arrays: &'static mut ManyBoundsArrays<T, NA, NU, NP, B>,
    ) -> Self {
        Self {
            solver: self.solver.with_many_bounds(arrays),
            ..self
        }
    }
}

/// The same as arrays: `NP` stages, two more than the horizon has samples, and up to `M` active bounds.
#[derive(Clone, Copy, Debug)]
pub struct GuaranteedWorkspaceArrays<
    T,
    const NU: usize,
    const NA: usize,
    const NP: usize,
    const M: usize,
> {
    stages: [Stage<T, NA, NU>; NP],
    own: [Common<T, NA, NU>; NP],
    solver: SolverArrays<T, NA, NU, NP, M>,
    u: [SVector<T, NU>; NP],
    x: [SVector<T, NA>; NP],
    active: [PackedRow<T>; M],
}

impl<T: Scalar, const NU: usize, const NA: usize, const NP: usize, const M: usize>
    GuaranteedWorkspaceArrays<T, NU, NA, NP, M>
{
    /// The arrays as memory of a workspace.
    pub fn lend(&'static mut self) -> GuaranteedWorkspaceMemory<T, NU, NA> {
        GuaranteedWorkspaceMemory {
            stages: List::Static(&mut self.stages),
            own: List::Static(&mut self.own),
            solver: self.solver.lend(),
            u: List::Static(&mut self.u),
            x: List::Static(&mut self.x),
            active: List::Static(&mut self.active),
        }
    }
}

impl<T: Scalar, const NU: usize, const NA: usize, const NP: usize, const M: usize> Default
    for GuaranteedWorkspaceArrays<T, NU, NA, NP, M>
{
    #[inline(always)]
    fn default() -> Self {
        Self {
            stages: [Stage::new(); NP],
            own: [Common::default(); NP],
            solver: SolverArrays::default(),
            u: [SVector::zeros(); NP],
            x: [SVector::zeros(); NP],
            active: [PackedRow::empty(); M],
        }
    }
}
