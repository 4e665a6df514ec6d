//! The linear models along a plan: of the embedding, or the derivatives of its rollout.

use crate::by_stage::PlantByStage;
use crate::controller::Controller;
use crate::embedding::Tangent;
use crate::model::{LpvModel, Scalar};
use crate::plan::Aim;
use crate::settings::ControllerSettings;
use crate::small_matrix::product;
use crate::workspace::Workspace;
use nalgebra::{SMatrix, SVector};

/// Where the matrices of a program come from.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Along {
    /// The embedding, at the scheduling along the plan.
    Scheduling,
    /// The derivatives of the rollout.
    Jacobian,
}

/// Whether the states of a plan are what its inputs lead to.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum States {
    /// They are.
    Follow,
    /// They are not: the motion from one need not end at the next.
    #[cfg(all(feature = "alloc", not(target_arch = "wasm32")))]
    Apart,
}

impl<P, T, const NX: usize, const NU: usize, const NS: usize> Controller<P, T, NX, NU, NS>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
{
    /// The matrices of the program along the plan from `x`. Their affine terms make the linear model
    /// exact on the plan itself, or, of states `Apart`, on each of its samples by itself.
    #[inline(never)]
    pub(crate) fn linearize_plan<D: PlantByStage<P, T, NX, NU, NS>>(
        &self,
        x: &SVector<T, NX>,
        aim: &Aim<'_, T, NX, NU, D>,
        (along, plan): (Along, States),
        workspace: &mut Workspace<T, NX, NU>,
    ) {
        let ocp = &mut workspace.ocp;
        let settings = &self.settings;
        let linear_u = -product(&settings.weights.r, &aim.u_ref);
        ocp.horizon = settings.horizon;
        ocp.x0 = *x;
        let damping = match along {
            Along::Scheduling => T::zero(),
            Along::Jacobian => self.policy.damping,
        };
        ocp.common.r = settings.weights.r + SMatrix::identity() * damping;
        let own = &aim.own;
        let done = if P::TOGETHER {
            self.in_groups(x, &self.policy.u, 0, &mut ocp.stages, |motion, stages| {
                let made = own.sample_matrices_each(&self.model, settings, motion, along);
                let Some(made) = made else {
                    return false;
                };
                for ((_, a, b), stage) in made.iter().zip(stages) {
                    (stage.a, stage.b) = (*a, *b);
                }
                true
            })
        } else {
            0
        };
        let states = core::iter::once(x).chain(&self.rollout);
        let samples = states.zip(&self.policy.u).zip(&self.rollout);
        let stages = ocp.stages.iter_mut().zip(samples).enumerate();
        for (i, (stage, ((x, u), next))) in stages.take(settings.horizon) {
            if i >= done {
                (stage.a, stage.b) = own.sample_matrices(i, &self.model, settings, (x, u), along);
            }
            let next = match plan {
                States::Follow => *next,
                #[cfg(all(feature = "alloc", not(target_arch = "wasm32")))]
                States::Apart => own.next_state(i, &self.model, settings, x, u),
            };
            stage.c = next - stage.a * x - stage.b * u;
            stage.linear_u = linear_u - u * damping;
            if own.any() {
                let r = own.weights(i).unwrap_or(&settings.weights).r;
                stage.linear_u = aim.linear_terms(i, &settings.weights).1 - u * damping;
                if let Some(common) = ocp.own.get_mut(i) {
                    common.r = r + SMatrix::identity() * damping;
                }
            }
        }
        if D::SOME {
            self.pose_outputs((x, &self.policy.u), 0, (aim, damping), ocp);
        }
    }
}

impl Along {
    /// The matrices of one sample of `model` from `x` with the input `u`. They follow the scheduling
    /// within the sample, whatever the predictor.
    pub(crate) fn matrices<P, T, const NX: usize, const NU: usize, const NS: usize>(
        self,
        model: &P,
        settings: &ControllerSettings<T, NX, NU, NS>,
        (x, u): (&SVector<T, NX>, &SVector<T, NU>),
    ) -> (SMatrix<T, NX, NX>, SMatrix<T, NX, NU>)
    where
        T: Scalar,
        P: LpvModel<T, NX, NU, NS>,
    {
        let rk4 = settings.predictor.rk4();
        match self {
            Self::Scheduling => rk4.linearize(model, x, u, settings.t_s),
            Self::Jacobian => rk4.differentiate(model, x, u, settings.t_s),
        }
    }

    /// The same of several samples, with the states in which they end.
    pub(crate) fn matrices_each<
        P,
        T,
        const NX: usize,
        const NU: usize,
        const NS: usize,
        const POINTS: usize,
    >(
        self,
        model: &P,
        settings: &ControllerSettings<T, NX, NU, NS>,
        (x, u): (&[SVector<T, NX>; POINTS], &[SVector<T, NU>; POINTS]),
    ) -> [Tangent<T, NX, NU>; POINTS]
    where
        T: Scalar,
        P: LpvModel<T, NX, NU, NS>,
    {
        let rk4 = settings.predictor.rk4();
        match self {
            Self::Scheduling => rk4.linearize_each(model, x, u, settings.t_s),
            Self::Jacobian => rk4.differentiate_each(model, x, u, settings.t_s),
        }
    }

    /// The one whose turn is next; the embedding's only while the plan is `far` from its goal.
    pub(crate) fn other(self, far: bool) -> Self {
        match self {
            Self::Jacobian if far => Self::Scheduling,
            _ => Self::Jacobian,
        }
    }
}
