//! Scratch memory of a controller's step.

use crate::by_stage::CostByStage;
#[cfg(all(feature = "alloc", not(target_arch = "wasm32")))]
use crate::elsewhere::Kept;
use crate::list::List;
#[cfg(feature = "alloc")]
use crate::memory::Capacity;
use crate::memory::WorkspaceMemory;
use crate::model::Scalar;
use crate::ocp::{Common, Ocp, Penalty, SoftBounds};
use crate::outputs;
use crate::plan::Trial;
use crate::preview::Room;
use crate::settings::{ControllerSettings, Weights};
use crate::soft_bounds::SoftPrices;
use crate::solver::Solver;
use nalgebra::{SMatrix, convert};

/// Scratch memory of a step: the quadratic program of the sample and the solver.
///
/// Nothing in it outlives a step, so controllers that run one after the other, such as those of
/// a ballbot's two planes, share one. `NX` states, `NU` inputs.
#[derive(Debug)]
#[cfg_attr(feature = "alloc", derive(Clone))]
pub struct Workspace<T: 'static, const NX: usize, const NU: usize> {
    pub(crate) ocp: Ocp<T, NX, NU>,
    pub(crate) solver: Solver<T, NX, NU>,
    /// A rollout that may become the plan.
    pub(crate) trial: Trial<T, NX, NU>,
    /// Whether the program has stages or general rows of its own.
    by_stage: bool,
    /// Room for weights and bounds of the stages' own, while the program has none.
    own: List<Common<T, NX, NU>>,
    /// Room for a second plan.
    #[cfg(all(feature = "alloc", not(target_arch = "wasm32")))]
    pub(crate) kept: Option<Kept<T, NX, NU>>,
}

impl<T: Scalar, const NX: usize, const NU: usize> Workspace<T, NX, NU> {
    /// A workspace in this memory.
    pub fn new(memory: WorkspaceMemory<T, NX, NU>) -> Self {
        let WorkspaceMemory {
            stages,
            solver,
            u,
            x,
            own,
            rows,
        } = memory;
        // The shortest of the lists is what there is memory for.
        let places = [stages.len(), solver.stages(), u.len(), x.len()];
        let longest = places.into_iter().min().unwrap_or(0);
        Self {
            ocp: Ocp {
                rows,
                ..Ocp::new(stages.shortened(longest))
            },
            solver: Solver::new(solver),
            trial: Trial { u, x },
            by_stage: false,
            own,
            #[cfg(all(feature = "alloc", not(target_arch = "wasm32")))]
            kept: None,
        }
    }

    /// A workspace with memory of its own.
    #[cfg(feature = "alloc")]
    pub fn allocate(capacity: Capacity) -> Self {
        Self {
            // A module for a browser has to be small.
            #[cfg(not(target_arch = "wasm32"))]
            kept: capacity.second_plan.then(|| Kept::allocate(capacity)),
            ..Self::new(WorkspaceMemory::allocate(capacity))
        }
    }

    /// The quadratic program of the last step.
    pub fn ocp(&self) -> &Ocp<T, NX, NU> {
        &self.ocp
    }

    /// Whether there is memory for a horizon.
    pub(crate) fn holds(&self, horizon: usize) -> bool {
        horizon <= self.ocp.stages.len()
    }

    /// Writes weights and bounds into the program, with the prices of `soft` ones.
    pub(crate) fn pose<const NS: usize>(
        &mut self,
        settings: &ControllerSettings<T, NX, NU, NS>,
        soft: &SoftPrices<T, NX>,
    ) {
        let ControllerSettings { weights, x, u, .. } = settings;
        let soft_x = halved(&soft.of(None));
        self.ocp.terminal.soft_x = soft_x;
        if core::mem::take(&mut self.by_stage) {
            self.forget_own();
        }
        self.ocp.common = Common {
            q: weights.q,
            r: weights.r,
            s: SMatrix::zeros(),
            x: *x,
            soft_x,
            u: *u,
        };
        self.ocp.terminal.x = *x;
    }

    /// A program whose stages are all the same, without general rows.
    #[cold]
    #[inline(never)]
    fn forget_own(&mut self) {
        self.ocp.rows_per_stage = 0;
        if !self.ocp.own.is_empty() {
            core::mem::swap(&mut self.ocp.own, &mut self.own);
        }
    }

    /// What a preview is checked against.
    pub(crate) fn room(&self, horizon: usize) -> Room {
        Room {
            horizon,
            own_stages: self.own.len().max(self.ocp.own.len()),
            rows: self.ocp.rows.len(),
        }
    }

    /// Writes what the stages have of their own into the program, over what [`pose`](Self::pose) wrote.
    pub(crate) fn pose_own<D: CostByStage<T, NX, NU>, const NS: usize>(
        &mut self,
        settings: &ControllerSettings<T, NX, NU, NS>,
        soft: &SoftPrices<T, NX>,
        own: &D,
    ) {
        let end = settings.horizon;
        self.by_stage = true;
        if own.has_own_stages() {
            core::mem::swap(&mut self.ocp.own, &mut self.own);
        }
        let ocp = &mut self.ocp;
        let soft_at = |i| halved(&soft.of(own.soft_x(i)));
        for (i, common) in ocp.own.iter_mut().enumerate().take(end) {
            let Weights { q, r } = *own.weights(i).unwrap_or(&settings.weights);
            *common = Common {
                q,
                r,
                s: own.cross(i).copied().unwrap_or_else(SMatrix::zeros),
                x: *own.x(i).unwrap_or(&settings.x),
                soft_x: soft_at(i),
                u: own.u(i, &settings.u),
            };
        }
        ocp.terminal.x = *own.x(end).unwrap_or(&settings.x);
        ocp.terminal.soft_x = soft_at(end);
        let counts = (0..=end).map(|i| own.rows(i).len());
        // Those of outputs come first; they are written with each program.
        let of_outputs = outputs::rows(own);
        ocp.rows_per_stage = counts.max().unwrap_or(0) + of_outputs;
        for (place, row) in ocp.rows.iter_mut().enumerate() {
            let (i, j) = match ocp.rows_per_stage {
                0 => break,
                count => (place / count, place % count),
            };
            if i > end {
                break;
            }
            let given = j.checked_sub(of_outputs).and_then(|j| own.rows(i).get(j));
            let counting = given.filter(|row| row.counts(i == 0, i == end));
            *row = counting.copied().unwrap_or_default();
            // What bounds inputs alone can be kept by itself.
            let elastic = soft.of_rows().filter(|_| row.x.amax() > T::zero());
            row.soft = row.soft.or(elastic).map(half);
        }
    }
}

/// Prices of the cost J as those of the quadratic program, whose cost is half of it.
fn halved<T: Scalar, const NX: usize>(soft: &SoftBounds<T, NX>) -> SoftBounds<T, NX> {
    soft.map(|price| price.map(half))
}

#[inline(always)]
pub(crate) fn half<T: Scalar>(Penalty { linear, quadratic }: Penalty<T>) -> Penalty<T> {
    let half: T = convert(0.5);
    Penalty {
        linear: linear * half,
        quadratic: quadratic * half,
    }
}
