//! Scratch memory of a controller's step.

#[cfg(feature = "alloc")]
use crate::memory::Capacity;
use crate::memory::WorkspaceMemory;
use crate::model::Scalar;
use crate::ocp::{Common, Ocp, Penalty, Softness};
use crate::plan::Trial;
use crate::settings::ControllerSettings;
use crate::solver::Solver;
use nalgebra::{SMatrix, SVector, convert};

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
    /// Whether the stages have the affine terms and the damping of a descent.
    pub(crate) along_plan: bool,
}

impl<T: Scalar, const NX: usize, const NU: usize> Workspace<T, NX, NU> {
    /// A workspace in this memory.
    pub fn new(memory: WorkspaceMemory<T, NX, NU>) -> Self {
        let WorkspaceMemory {
            stages,
            solver,
            u,
            x,
        } = memory;
        // The shortest of the lists is what there is memory for.
        let places = [stages.len(), solver.stages(), u.len(), x.len()];
        let longest = places.into_iter().min().unwrap_or(0);
        Self {
            ocp: Ocp::new(stages.shortened(longest)),
            solver: Solver::new(solver),
            trial: Trial { u, x },
            along_plan: false,
        }
    }

    /// A workspace with memory of its own.
    #[cfg(feature = "alloc")]
    pub fn allocate(capacity: Capacity) -> Self {
        Self::new(WorkspaceMemory::allocate(capacity))
    }

    /// The quadratic program of the last step.
    pub fn ocp(&self) -> &Ocp<T, NX, NU> {
        &self.ocp
    }

    /// Whether there is memory for a horizon.
    pub(crate) fn holds(&self, horizon: usize) -> bool {
        horizon <= self.ocp.stages.len()
    }

    /// Writes weights and bounds into the program.
    pub(crate) fn pose<const NS: usize>(&mut self, settings: &ControllerSettings<T, NX, NU, NS>) {
        let ControllerSettings { weights, x, u, .. } = settings;
        let soft_x = halved(&settings.soft_x);
        self.ocp.terminal.soft_x = soft_x;
        if core::mem::take(&mut self.along_plan) {
            for stage in self.ocp.stages.iter_mut() {
                stage.c = SVector::zeros();
            }
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
}

/// Prices of the cost J as those of the quadratic program, whose cost is half of it.
fn halved<T: Scalar, const NX: usize>(soft: &Softness<T, NX>) -> Softness<T, NX> {
    let half: T = convert(0.5);
    soft.map(|price| {
        price.map(|Penalty { linear, quadratic }| Penalty {
            linear: linear * half,
            quadratic: quadratic * half,
        })
    })
}
