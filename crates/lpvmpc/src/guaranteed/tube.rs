//! Where a plant can be that follows a plan while the rollout is wrong by its integration error, and
//! what that changes in the cost.
//!
//! The deviation from the plan grows and shrinks by the policy's own closed loop, e+ = (A + B K) e + w
//! with w in the parallelepiped of the sample's error, and is enclosed in ellipsoids e'S^-1 e <= 1. The sum of two of them lies in
//! (1 + 1/c) S_1 + (1 + c) S_2 for every c > 0 (Kurzhanski and Valyi, Ellipsoidal Calculus, 1997);
//! c is that of the smallest trace. Where the input may be at its bound, it may follow the feedback
//! or not: the sum of both S holds either. A and B are the derivatives of the prediction along the plan
//! itself, so what is of second order in the deviation is left out.

use super::plan::{Plan, PlannedStage};
use super::slopes::Slopes;
use super::{GuaranteedWorkspace, Planner, share_of_bounds};
use crate::model::{LpvModel, Scalar};
use crate::small_matrix::product;
use nalgebra::{SMatrix, SVector, convert};

impl<P, T, const NX: usize, const NU: usize, const NS: usize> Planner<P, T, NX, NU, NS>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
{
    /// Works out how far the plant may be from the states of `plan`.
    pub(super) fn find_drift(&mut self, plan: &mut Plan<T, NX, NU>) {
        self.find_drift_while(plan, |_, _, _| true);
    }

    /// The same, as long as the samples, each with the drift before it, are `accepted`; whether all are.
    pub(super) fn find_drift_while(
        &mut self,
        plan: &mut Plan<T, NX, NU>,
        accepted: impl Fn(&Self, &PlannedStage<T, NX, NU>, &SVector<T, NX>) -> bool,
    ) -> bool {
        let mut shape = SMatrix::zeros();
        let (mut x, mut before) = (plan.start, SVector::zeros());
        for (i, stage) in plan.stages.iter_mut().enumerate() {
            let slopes = self.slopes_at(i, &x, &stage.u);
            shape = self.carried(&shape, (&x, &stage.u), &slopes, &stage.feedback);
            stage.drift = shape.diagonal().map(root);
            if !accepted(self, stage, &before) {
                return false;
            }
            (x, before) = (stage.x, stage.drift);
        }
        plan.end_drift = self.size_at_end(&shape);
        true
    }

    /// Takes what the next program keeps free from a new plan.
    pub(super) fn take_drift(&mut self, plan: &Plan<T, NX, NU>) {
        for (drift, stage) in self.drift.iter_mut().zip(&plan.stages) {
            *drift = stage.drift;
        }
        self.end_drift = plan.end_drift;
    }

    /// The same under the policy of the program that was made along `plan`, with its derivatives, where
    /// it led to no new plan.
    pub(super) fn learn_drift<const NA: usize>(
        &mut self,
        plan: &Plan<T, NX, NU>,
        workspace: &GuaranteedWorkspace<T, NU, NA>,
    ) {
        let stages = workspace.ocp.stages.iter().skip(1);
        let factors = workspace.solver.factors().iter().skip(1);
        let states = plan.states().zip(&plan.stages);
        let mut shape = SMatrix::zeros();
        for (i, ((x, PlannedStage { u, .. }), (stage, factor))) in
            states.zip(stages.zip(factors)).enumerate()
        {
            let a = stage.a.fixed_view::<NX, NX>(0, 0).into_owned();
            let b = stage.b.fixed_view::<NX, NU>(0, 0).into_owned();
            let feedback = factor.feedback.fixed_columns::<NX>(0).into_owned();
            shape = self.carried(&shape, (x, u), &(a, b), &feedback);
            if let Some(drift) = self.drift.get_mut(i) {
                *drift = shape.diagonal().map(root);
            }
        }
        self.end_drift = self.size_at_end(&shape);
    }

    /// The ellipsoid `shape` one sample after (x, u), with the error of that sample.
    fn carried(
        &self,
        shape: &SMatrix<T, NX, NX>,
        (x, u): (&SVector<T, NX>, &SVector<T, NU>),
        (a, b): &Slopes<T, NX, NU>,
        feedback: &SMatrix<T, NU, NX>,
    ) -> SMatrix<T, NX, NX> {
        // A parallelepiped lies in the ellipsoid through its corners.
        let parts: T = convert(NX as f64);
        let share = self.share(x, u);
        let axes = &self.settings.rollout.error;
        let noise = product(axes, &axes.transpose()) * (parts * share * share);
        let mut moved = around(&(a + product(b, feedback)), shape);
        if self.may_saturate(u, &self.reach(feedback, shape)) {
            moved += around(a, shape);
        }
        sum(&moved, &noise)
    }

    /// The size of an ellipsoid in the norm of P.
    fn size_at_end(&self, shape: &SMatrix<T, NX, NX>) -> T {
        root(product(&self.settings.terminal.p, shape).trace())
    }

    /// How much dearer than the rest of `plan` the next sample's candidate may be, for the integration
    /// error of the sample in between: |dJ/dx_1| error and the squares.
    ///
    /// The gradient is that of the policy's own closed loop, from the end backwards. Where the input may
    /// be at its bound, the feedback may act or not; what that changes is added with its size.
    pub(super) fn epsilon(&self, plan: &Plan<T, NX, NU>) -> T {
        let (settings, aims) = (&self.settings, &self.aims);
        let two: T = convert(2.0);
        let d = &settings.direction;
        let (q, r) = (&settings.weights.q, &settings.weights.r);
        let mut gradient = settings.terminal.p * (plan.end - d * plan.set_point) * two;
        // The squares, and what saturation may change.
        let mut rest = plan.end_drift * plan.end_drift;
        let stages = plan.stages.iter().zip(plan.stages.iter().skip(1));
        let stages = stages.zip(aims.stages.iter().skip(1)).enumerate();
        for (i, ((PlannedStage { x, drift, .. }, PlannedStage { u, feedback, .. }), wanted)) in
            stages.rev()
        {
            let aim = if i + 1 < aims.changes {
                *wanted
            } else {
                plan.set_point
            };
            let (a, b) = self.differentiate(x, u);
            let by_input = r * u * two + b.transpose() * gradient;
            let reach = feedback.abs() * drift;
            gradient = q * (x - d * aim) * two + a.transpose() * gradient;
            if self.may_saturate(u, &reach) {
                rest += by_input.abs().dot(&reach);
            } else {
                gradient += feedback.transpose() * by_input;
            }
            rest += (q.abs() * drift).dot(drift) + (r.abs() * reach).dot(&reach);
        }
        let first = plan.stages.first();
        let share = first.map_or_else(T::zero, |stage| self.share(&plan.start, &stage.u));
        let along_axes = settings.rollout.error.tr_mul(&gradient);
        along_axes.abs().sum() * share + rest
    }

    /// The smallest box around the rollout's error over a sample from `x` under `u`, wherever along d that is.
    pub(super) fn error(&self, x: &SVector<T, NX>, u: &SVector<T, NU>) -> SVector<T, NX> {
        self.settings.rollout.error.abs().column_sum() * self.share(x, u)
    }

    /// What the motion from `x` under `u` has of the bounds, wherever along d that is.
    fn share(&self, x: &SVector<T, NX>, u: &SVector<T, NU>) -> T {
        let settings = &self.settings;
        let d = &settings.direction;
        let moving = x - d * (x.dot(d) / d.norm_squared());
        share_of_bounds(&moving, &settings.x, u, &settings.u)
    }

    /// How far the feedback within the ellipsoid `shape` moves the input.
    fn reach(&self, feedback: &SMatrix<T, NU, NX>, shape: &SMatrix<T, NX, NX>) -> SVector<T, NU> {
        (feedback * shape * feedback.transpose())
            .diagonal()
            .map(root)
    }

    /// Whether the feedback that moves the input by as much as `reach` can push it to its bound.
    fn may_saturate(&self, u: &SVector<T, NU>, reach: &SVector<T, NU>) -> bool {
        let bounds = &self.settings.u;
        !(bounds.hold_at(&(u + reach)) && bounds.hold_at(&(u - reach)))
    }
}

/// Of a square that rounding may have put below zero.
fn root<T: Scalar>(square: T) -> T {
    square.max(T::zero()).sqrt()
}

/// M S M'
fn around<T: Scalar, const K: usize>(
    m: &SMatrix<T, K, K>,
    s: &SMatrix<T, K, K>,
) -> SMatrix<T, K, K> {
    product(&product(m, s), &m.transpose())
}

/// An ellipsoid around the sum of two.
fn sum<T: Scalar, const K: usize>(
    one: &SMatrix<T, K, K>,
    other: &SMatrix<T, K, K>,
) -> SMatrix<T, K, K> {
    let (first, second) = (one.trace(), other.trace());
    if !(first > T::zero()) {
        return *other;
    }
    if !(second > T::zero()) {
        return *one;
    }
    let ratio = (second / first).sqrt();
    one * (T::one() + ratio) + other * (T::one() + T::one() / ratio)
}
