//! What a program costs and keeps to (Algorithm 1, cost): weights, reference, bounds and outputs.

use crate::by_stage::{CostByStage, PlantByStage};
use crate::controller::Controller;
use crate::linearization::Along;
use crate::model::{LpvModel, Scalar};
use crate::ocp::Ocp;
use crate::outputs;
use crate::plan::{Aim, at};
use crate::settings::{TerminalIngredient, Weights};
use crate::small_matrix::product;
use crate::soft_bounds::SoftPrices;
use crate::workspace::Workspace;
use nalgebra::{SMatrix, SVector, convert};

impl<P, T, const NX: usize, const NU: usize, const NS: usize> Controller<P, T, NX, NU, NS>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
{
    /// Weights, bounds and rows of the program, and the prices of soft bounds from `x` on.
    #[inline(always)]
    pub(crate) fn pose<D: PlantByStage<P, T, NX, NU, NS>>(
        &mut self,
        x: &SVector<T, NX>,
        aim: &Aim<'_, T, NX, NU, D>,
        workspace: &mut Workspace<T, NX, NU>,
    ) {
        let (settings, own) = (&self.settings, &aim.own);
        let terminal = own.terminal().unwrap_or(&settings.terminal);
        let of_stages = own.soft_x(0).is_some();
        self.soft = SoftPrices::new(settings, terminal, of_stages, &(x - aim.end()), || {
            self.begins_along(x, aim)
        });
        self.pose_bounds(aim, workspace);
    }

    /// The plant's matrix A where the sample begins.
    fn begins_along<D: PlantByStage<P, T, NX, NU, NS>>(
        &self,
        x: &SVector<T, NX>,
        aim: &Aim<'_, T, NX, NU, D>,
    ) -> SMatrix<T, NX, NX> {
        let begun = (x, aim.u_ref(0));
        let (model, settings) = (&self.model, &self.settings);
        { &aim.own }
            .sample_matrices(0, model, settings, begun, Along::Jacobian)
            .0
    }

    /// The same at the present prices.
    #[inline(always)]
    fn pose_bounds<D: PlantByStage<P, T, NX, NU, NS>>(
        &self,
        aim: &Aim<'_, T, NX, NU, D>,
        workspace: &mut Workspace<T, NX, NU>,
    ) {
        workspace.pose(&self.settings, &self.soft);
        if aim.own.any() {
            workspace.pose_own(&self.settings, &self.soft, &aim.own);
        }
    }

    /// Hard bounds of states and rows soft, at `factor` times a price that is meant to be exact.
    #[cfg(all(feature = "alloc", not(target_arch = "wasm32")))]
    #[cold]
    #[inline(never)]
    pub(crate) fn pose_elastic<D: PlantByStage<P, T, NX, NU, NS>>(
        &mut self,
        x: &SVector<T, NX>,
        aim: &Aim<'_, T, NX, NU, D>,
        factor: T,
        workspace: &mut Workspace<T, NX, NU>,
    ) {
        let settings = &self.settings;
        let terminal = aim.own.terminal().unwrap_or(&settings.terminal);
        let (way, a) = (x - aim.end(), self.begins_along(x, aim));
        self.soft.soften(settings, terminal, &way, &a, factor);
        self.pose_bounds(aim, workspace);
    }

    /// Hard bounds hard again.
    #[cfg(all(feature = "alloc", not(target_arch = "wasm32")))]
    #[cold]
    #[inline(never)]
    pub(crate) fn pose_hard<D: PlantByStage<P, T, NX, NU, NS>>(
        &mut self,
        aim: &Aim<'_, T, NX, NU, D>,
        workspace: &mut Workspace<T, NX, NU>,
    ) {
        self.soft.harden(&self.settings);
        self.pose_bounds(aim, workspace);
    }

    /// Algorithm 1, cost: the reference enters the linear terms.
    #[inline(never)]
    pub(crate) fn track<D: CostByStage<T, NX, NU>>(
        &self,
        aim: &Aim<'_, T, NX, NU, D>,
        ocp: &mut Ocp<T, NX, NU>,
    ) {
        let q = -self.settings.weights.q;
        let linear_u = -product(&self.settings.weights.r, &aim.u_ref);
        let stages = ocp.stages.iter_mut().enumerate();
        for (i, stage) in stages.take(self.settings.horizon) {
            stage.linear_x = product(&q, aim.at(i));
            stage.linear_u = linear_u;
            if aim.own.any() {
                (stage.linear_x, stage.linear_u) = aim.linear_terms(i, &self.settings.weights);
            }
        }
        let x_ref = *aim.end();
        let (p, equality) = match aim.own.terminal().unwrap_or(&self.settings.terminal) {
            TerminalIngredient::Cost(p) => (*p, None),
            TerminalIngredient::Equality => (SMatrix::zeros(), Some(x_ref)),
        };
        ocp.terminal.p = p;
        ocp.terminal.linear_x = -product(&p, &x_ref);
        if D::SOME
            && let Some(price) = aim.own.linear_x(self.settings.horizon)
        {
            ocp.terminal.linear_x += price * convert::<f64, T>(0.5);
        }
        ocp.terminal.equality = equality;
    }

    /// The outputs of the program, where there are any, linear about the last rollout from its sample `first`
    /// (0 or 1) on, which began at `x` and had these `inputs`. What changes of the inputs costs extra by the
    /// `damping`.
    #[inline(never)]
    pub(crate) fn pose_outputs<D: CostByStage<T, NX, NU>>(
        &self,
        (x, inputs): (&SVector<T, NX>, &[SVector<T, NU>]),
        first: usize,
        (aim, damping): (&Aim<'_, T, NX, NU, D>, T),
        ocp: &mut Ocp<T, NX, NU>,
    ) {
        let Some(outputs) = aim.own.outputs() else {
            return;
        };
        let horizon = self.settings.horizon;
        let bounded = outputs::rows(&aim.own);
        let per_stage = ocp.rows_per_stage;
        let elastic = self.soft.of_rows();
        let states = core::iter::once(x).chain(self.rollout.iter()).skip(first);
        let inputs = inputs.iter().take(horizon);
        let window = states.zip(inputs.clone().skip(first).chain(inputs.last()));
        let samples = ocp.stages.iter_mut().zip(ocp.own.iter_mut()).zip(window);
        for (i, ((stage, common), (x, u))) in samples.enumerate().take(horizon) {
            let Weights { q, r } = *aim.own.weights(i).unwrap_or(&self.settings.weights);
            (common.q, common.r) = (q, r + SMatrix::identity() * damping);
            common.s = aim.own.cross(i).copied().unwrap_or_else(SMatrix::zeros);
            (stage.linear_x, stage.linear_u) = aim.linear_terms(i, &self.settings.weights);
            stage.linear_u -= u * damping;
            let linear = (&mut stage.linear_x, &mut stage.linear_u);
            outputs::add_costs(outputs, i, (x, u), common, linear);
            let rows = ocp.rows.get_mut(i * per_stage..i * per_stage + bounded);
            let rows = rows.unwrap_or_default();
            outputs::write_rows(outputs, i, (x, u), false, elastic, rows);
        }
        let end = at(&self.rollout, self.last_stage());
        let rows = ocp
            .rows
            .get_mut(horizon * per_stage..horizon * per_stage + bounded);
        let still = SVector::zeros();
        outputs::write_rows(
            outputs,
            horizon,
            (&end, &still),
            true,
            elastic,
            rows.unwrap_or_default(),
        );
    }
}
