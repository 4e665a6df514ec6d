//! The memory of solver and controller: how much of it a horizon takes, and where it comes from.

use crate::held_bounds::{HeldAt, HeldBound};
use crate::list::List;
use crate::many_bounds::{ManyBounds, ManyBoundsArrays};
use crate::model::Scalar;
use crate::ocp::{Common, GeneralRow, Stage};
use crate::riccati::StageFactor;
use crate::solution::PackedRow;
use crate::working_set::Terms;
use nalgebra::{SMatrix, SVector};

/// For what there is room.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Capacity {
    /// Stages of the horizon, at least 1.
    pub stages: usize,
    /// Rows of the working set: independent ones, of which `stages * NU` fill the space of the inputs,
    /// and soft bounds that are exceeded at a quadratic price. A workspace's memory grows with the square of it.
    pub rows: usize,
    /// Bounds that may be active at once: those rows, soft bounds that are exceeded at a linear price,
    /// and bounds that hold because others do. With a place for every bound there are always enough.
    pub active: usize,
    /// Stages with weights and bounds of their own ([`Preview`](crate::Preview)): none, as a rule, or
    /// all of the horizon. Of a controller's workspace only.
    pub own_stages: usize,
    /// General rows of a stage; none, as a rule. Beyond so many a solver takes active bounds one by one.
    pub general_rows: usize,
    /// A second plan: where a descent's plan is likely to be a dear local minimum, another one is looked for
    /// (`docs/descent.md`). Of a controller's workspace on the heap only (not among the bytes), which then
    /// serves for the horizon of `stages`; not in WebAssembly.
    pub second_plan: bool,
}

impl Capacity {
    /// The same with room for weights and bounds of every stage's own.
    pub const fn with_own_stages(self) -> Self {
        Self {
            own_stages: self.stages,
            ..self
        }
    }

    /// The same with room for a second plan. In a sample without a plan it is of use where
    /// [`Iterations::Descent`](crate::Iterations::Descent) has a `first` above its `most`.
    #[cfg(feature = "alloc")]
    pub const fn with_second_plan(self) -> Self {
        Self {
            second_plan: true,
            ..self
        }
    }

    /// The same with room for so many general rows of each stage, hard or soft.
    pub const fn with_general_rows(self, count: usize) -> Self {
        let all = (self.stages + 1) * count;
        Self {
            rows: self.rows + all,
            active: self.active + 2 * all,
            general_rows: count,
            ..self
        }
    }
}

/// Memory of a [`Solver`](crate::Solver): on the heap, or [lent](SolverArrays::lend) arrays.
#[derive(Debug)]
pub struct SolverMemory<T: 'static, const NX: usize, const NU: usize> {
    /// One for each stage.
    pub(crate) factors: List<StageFactor<T, NX, NU>>,
    /// What inputs hold at bounds, one for each stage.
    pub(crate) held: List<HeldAt<NU>>,
    /// What the dual method works with.
    pub(crate) dual: DualMemory<T, NU>,
    /// Of the first phase: no entry, or one.
    pub(crate) many_bounds: List<ManyBounds<T, NX, NU>>,
}

/// Memory of the dual active-set method.
#[derive(Debug)]
pub(crate) struct DualMemory<T: 'static, const NU: usize> {
    /// Deviations of the inputs, one of each for each stage.
    pub(crate) deviations: [List<SVector<T, NU>>; 4],
    /// Rows of the working set.
    pub(crate) terms: List<Terms<T>>,
    /// Active bounds outside of it.
    pub(crate) resting: List<PackedRow<T>>,
    /// Orthonormal rows: `rows * stages`.
    pub(crate) basis: List<SVector<T, NU>>,
    /// Triangular factor: `rows * rows`.
    pub(crate) factor: List<T>,
    /// Numbers, one of each for each row.
    pub(crate) numbers: [List<T>; 5],
}

impl<T, const NX: usize, const NU: usize> SolverMemory<T, NX, NU> {
    /// Bytes that a capacity takes: to plan memory before there is any. As [`SolverArrays`] it may take a
    /// few more, for the alignment of its parts; on the heap it takes those of [`ManyBoundsArrays`], too, and
    /// with the feature `simd` and six states or more A and B of every stage once more.
    pub const fn bytes(
        Capacity {
            stages,
            rows,
            active,
            ..
        }: Capacity,
    ) -> usize {
        let input = size_of::<SVector<T, NU>>();
        let stage = size_of::<StageFactor<T, NX, NU>>() + size_of::<HeldAt<NU>>();
        let row = size_of::<Terms<T>>() + (rows + 5) * size_of::<T>();
        stages * (stage + (rows + 4) * input) + rows * row + active * size_of::<PackedRow<T>>()
    }

    /// The longest horizon that all of its lists have places for.
    pub(crate) fn stages(&self) -> usize {
        let lists = self.dual.deviations.iter().map(|list| list.len());
        lists.fold(self.factors.len().min(self.held.len()), usize::min)
    }
}

impl<T, const NU: usize> DualMemory<T, NU> {
    /// As many rows as all of its lists have places for, with rows of this many stages.
    pub(crate) fn rows(&self, stages: usize) -> usize {
        let lists = self.numbers.iter().map(|list| list.len());
        let rows = lists.fold(self.terms.len(), usize::min);
        let fits = |rows: &usize| {
            rows * self.terms.len() <= self.factor.len() && rows * stages <= self.basis.len()
        };
        (0..=rows).rev().find(fits).unwrap_or(0)
    }
}

#[cfg(feature = "alloc")]
impl<T: Scalar, const NX: usize, const NU: usize> SolverMemory<T, NX, NU> {
    /// As much as is needed, on the heap.
    pub fn allocate(capacity: Capacity) -> Self {
        let Capacity {
            stages,
            rows,
            active,
            ..
        } = capacity;
        let deviations = || List::repeat(SVector::zeros(), stages);
        let numbers = || List::repeat(T::zero(), rows);
        Self {
            factors: List::repeat(StageFactor::zeros(), stages),
            held: List::repeat([HeldBound::NOTHING; NU], stages),
            dual: DualMemory {
                deviations: core::array::from_fn(|_| deviations()),
                terms: List::repeat(Terms::empty(), rows),
                resting: List::repeat(PackedRow::empty(), active),
                basis: List::repeat(SVector::zeros(), rows * stages),
                factor: List::repeat(T::zero(), rows * rows),
                numbers: core::array::from_fn(|_| numbers()),
            },
            // A module for a browser has to be small.
            #[cfg(target_arch = "wasm32")]
            many_bounds: List::empty(),
            #[cfg(not(target_arch = "wasm32"))]
            many_bounds: List::repeat(ManyBounds::allocate(capacity), 1),
        }
    }
}

/// The same as arrays, for memory that is known when a program is built: `N` stages, `M` rows.
#[derive(Clone, Copy, Debug)]
pub struct SolverArrays<T, const NX: usize, const NU: usize, const N: usize, const M: usize> {
    factors: [StageFactor<T, NX, NU>; N],
    deviations: [[SVector<T, NU>; N]; 4],
    held: [HeldAt<NU>; N],
    terms: [Terms<T>; M],
    resting: [PackedRow<T>; M],
    basis: [[SVector<T, NU>; N]; M],
    factor: [[T; M]; M],
    numbers: [[T; M]; 5],
}

impl<T: Scalar, const NX: usize, const NU: usize, const N: usize, const M: usize>
    SolverArrays<T, NX, NU, N, M>
{
    /// The arrays as memory of a solver.
    pub fn lend(&'static mut self) -> SolverMemory<T, NX, NU> {
        SolverMemory {
            factors: List::Static(&mut self.factors),
            held: List::Static(&mut self.held),
            dual: DualMemory {
                deviations: self.deviations.each_mut().map(|list| List::Static(list)),
                terms: List::Static(&mut self.terms),
                resting: List::Static(&mut self.resting),
                basis: List::Static(self.basis.as_flattened_mut()),
                factor: List::Static(self.factor.as_flattened_mut()),
                numbers: self.numbers.each_mut().map(|list| List::Static(list)),
            },
            many_bounds: List::empty(),
        }
    }
}

impl<T: Scalar, const NX: usize, const NU: usize, const N: usize, const M: usize> Default
    for SolverArrays<T, NX, NU, N, M>
{
    #[inline(always)]
    fn default() -> Self {
        Self {
            factors: [StageFactor::zeros(); N],
            deviations: [[SVector::zeros(); N]; 4],
            held: [[HeldBound::NOTHING; NU]; N],
            terms: [Terms::empty(); M],
            resting: [PackedRow::empty(); M],
            basis: [[SVector::zeros(); N]; M],
            factor: [[T::zero(); M]; M],
            numbers: [[T::zero(); M]; 5],
        }
    }
}

/// Memory of a [`Workspace`](crate::Workspace): on the heap, or [lent](WorkspaceArrays::lend) arrays.
#[derive(Debug)]
pub struct WorkspaceMemory<T: 'static, const NX: usize, const NU: usize> {
    /// The program's stages, one for each stage.
    pub(crate) stages: List<Stage<T, NX, NU>>,
    /// Of the solver.
    pub(crate) solver: SolverMemory<T, NX, NU>,
    /// Inputs of a rollout, one for each stage.
    pub(crate) u: List<SVector<T, NU>>,
    /// Its states, one for each stage.
    pub(crate) x: List<SVector<T, NX>>,
    /// Weights and bounds of the stages' own.
    pub(crate) own: List<Common<T, NX, NU>>,
    /// General rows of all stages.
    pub(crate) rows: List<GeneralRow<T, NX, NU>>,
}

impl<T, const NX: usize, const NU: usize> WorkspaceMemory<T, NX, NU> {
    /// Bytes that a capacity takes, as [`SolverMemory::bytes`].
    pub const fn bytes(capacity: Capacity) -> usize {
        let trial = size_of::<SVector<T, NU>>() + size_of::<SVector<T, NX>>();
        let rows = (capacity.stages + 1) * capacity.general_rows;
        SolverMemory::<T, NX, NU>::bytes(capacity)
            + capacity.stages * (size_of::<Stage<T, NX, NU>>() + trial)
            + capacity.own_stages * size_of::<Common<T, NX, NU>>()
            + rows * size_of::<GeneralRow<T, NX, NU>>()
    }
}

#[cfg(feature = "alloc")]
impl<T: Scalar, const NX: usize, const NU: usize> WorkspaceMemory<T, NX, NU> {
    /// As much as is needed, on the heap.
    pub fn allocate(capacity: Capacity) -> Self {
        let Capacity {
            stages,
            own_stages,
            general_rows,
            ..
        } = capacity;
        Self {
            stages: List::repeat(Stage::new(), stages),
            solver: SolverMemory::allocate(capacity),
            u: List::repeat(SVector::zeros(), stages),
            x: List::repeat(SVector::zeros(), stages),
            own: List::repeat(Common::default(), own_stages),
            rows: List::repeat(GeneralRow::default(), (stages + 1) * general_rows),
        }
    }
}

impl<T: Scalar, const NX: usize, const NU: usize> WorkspaceMemory<T, NX, NU> {
    /// The same with memory for many active bounds.
    pub fn with_many_bounds<const N: usize, const B: usize>(
        self,
        arrays: &'static mut ManyBoundsArrays<T, NX, NU, N, B>,
    ) -> Self {
        Self {
            solver: self.solver.with_many_bounds(arrays),
            ..self
        }
    }
}

/// The same as arrays: horizons of up to `N` samples, up to `M` active bounds; weights and bounds of
/// their own for `OWN` stages (0 or `N`), and `ROWS` general rows, those of a stage times (`N` + 1).
#[derive(Clone, Copy, Debug)]
pub struct WorkspaceArrays<
    T,
    const NX: usize,
    const NU: usize,
    const N: usize,
    const M: usize,
    const OWN: usize = 0,
    const ROWS: usize = 0,
> {
    stages: [Stage<T, NX, NU>; N],
    solver: SolverArrays<T, NX, NU, N, M>,
    u: [SVector<T, NU>; N],
    x: [SVector<T, NX>; N],
    own: [Common<T, NX, NU>; OWN],
    rows: [GeneralRow<T, NX, NU>; ROWS],
}

impl<
    T: Scalar,
    const NX: usize,
    const NU: usize,
    const N: usize,
    const M: usize,
    const OWN: usize,
    const ROWS: usize,
> WorkspaceArrays<T, NX, NU, N, M, OWN, ROWS>
{
    /// The arrays as memory of a workspace.
    pub fn lend(&'static mut self) -> WorkspaceMemory<T, NX, NU> {
        WorkspaceMemory {
            stages: List::Static(&mut self.stages),
            solver: self.solver.lend(),
            u: List::Static(&mut self.u),
            x: List::Static(&mut self.x),
            own: List::Static(&mut self.own),
            rows: List::Static(&mut self.rows),
        }
    }
}

impl<
    T: Scalar,
    const NX: usize,
    const NU: usize,
    const N: usize,
    const M: usize,
    const OWN: usize,
    const ROWS: usize,
> Default for WorkspaceArrays<T, NX, NU, N, M, OWN, ROWS>
{
    #[inline(always)]
    fn default() -> Self {
        Self {
            stages: [Stage::new(); N],
            solver: SolverArrays::default(),
            u: [SVector::zeros(); N],
            x: [SVector::zeros(); N],
            own: [Common::default(); OWN],
            rows: [GeneralRow::default(); ROWS],
        }
    }
}

/// Memory of a [`Controller`](crate::Controller): on the heap, or [lent](ControllerArrays::lend) arrays.
#[derive(Debug)]
pub struct ControllerMemory<T: 'static, const NX: usize, const NU: usize> {
    /// States of the plan and of the program's answer, one of each for each stage.
    pub(crate) x: [List<SVector<T, NX>>; 2],
    /// Inputs of both.
    pub(crate) u: [List<SVector<T, NU>>; 2],
    /// Feedback matrices of the plan, one for each stage.
    pub(crate) feedback: List<SMatrix<T, NU, NX>>,
    /// Active bounds.
    pub(crate) active: List<PackedRow<T>>,
}

impl<T, const NX: usize, const NU: usize> ControllerMemory<T, NX, NU> {
    /// Bytes that a capacity takes, as [`SolverMemory::bytes`].
    pub const fn bytes(Capacity { stages, active, .. }: Capacity) -> usize {
        let plan = size_of::<SVector<T, NX>>() + size_of::<SVector<T, NU>>();
        let feedback = size_of::<SMatrix<T, NU, NX>>();
        stages * (2 * plan + feedback) + active * size_of::<PackedRow<T>>()
    }
}

#[cfg(feature = "alloc")]
impl<T: Scalar, const NX: usize, const NU: usize> ControllerMemory<T, NX, NU> {
    /// As much as is needed, on the heap.
    pub fn allocate(Capacity { stages, active, .. }: Capacity) -> Self {
        Self {
            x: core::array::from_fn(|_| List::repeat(SVector::zeros(), stages)),
            u: core::array::from_fn(|_| List::repeat(SVector::zeros(), stages)),
            feedback: List::repeat(SMatrix::zeros(), stages),
            active: List::repeat(PackedRow::empty(), active),
        }
    }
}

/// The same as arrays: horizons of up to `N` samples, up to `M` active bounds.
#[derive(Clone, Copy, Debug)]
pub struct ControllerArrays<T, const NX: usize, const NU: usize, const N: usize, const M: usize> {
    x: [[SVector<T, NX>; N]; 2],
    u: [[SVector<T, NU>; N]; 2],
    feedback: [SMatrix<T, NU, NX>; N],
    active: [PackedRow<T>; M],
}

impl<T: Scalar, const NX: usize, const NU: usize, const N: usize, const M: usize>
    ControllerArrays<T, NX, NU, N, M>
{
    /// The arrays as memory of a controller.
    pub fn lend(&'static mut self) -> ControllerMemory<T, NX, NU> {
        ControllerMemory {
            x: self.x.each_mut().map(|list| List::Static(list)),
            u: self.u.each_mut().map(|list| List::Static(list)),
            feedback: List::Static(&mut self.feedback),
            active: List::Static(&mut self.active),
        }
    }
}

impl<T: Scalar, const NX: usize, const NU: usize, const N: usize, const M: usize> Default
    for ControllerArrays<T, NX, NU, N, M>
{
    #[inline(always)]
    fn default() -> Self {
        Self {
            x: [[SVector::zeros(); N]; 2],
            u: [[SVector::zeros(); N]; 2],
            feedback: [SMatrix::zeros(); N],
            active: [PackedRow::empty(); M],
        }
    }
}
