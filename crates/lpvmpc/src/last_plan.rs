//! What a controller hands over to one with other settings: its last plan.

use crate::controller::Controller;
use crate::model::{LpvModel, Scalar};
use crate::solution::ActiveRow;
use crate::working_set::copy;
use crate::{controller::next_state, plan::at};
use nalgebra::{SMatrix, SVector};

/// The last plan of a controller of `NX` states and `NU` inputs, one entry per sample of its
/// horizon.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LastPlan<'a, T, const NX: usize, const NU: usize> {
    /// x_1 to x_N on the nonlinear model.
    pub x: &'a [SVector<T, NX>],
    /// u_0 to u_{N-1}.
    pub u: &'a [SVector<T, NU>],
    /// K_0 to K_{N-1} of u = u_i + K_i (x - x_i), `NU` x `NX`; zero unless it is a descent's.
    pub gain: &'a [SMatrix<T, NU, NX>],
    /// Its merit: of a descent only.
    pub cost: T,
    /// Damping of the next program along it: of a descent only.
    pub damping: T,
}

impl<P, T, const NX: usize, const NU: usize, const NS: usize> Controller<P, T, NX, NU, NS>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
{
    /// The last plan, and the rows that were active in its program; `None` if there is none to go
    /// on from.
    pub fn last_plan(
        &self,
    ) -> Option<(LastPlan<'_, T, NX, NU>, impl Iterator<Item = ActiveRow<T>>)> {
        let horizon = self.settings.horizon;
        let plan = LastPlan {
            x: self.rollout.get(..horizon)?,
            u: self.solution.u.get(..horizon)?,
            gain: self.policy.gain.get(..horizon)?,
            cost: self.policy.cost,
            damping: self.policy.damping,
        };
        self.initialised
            .then(|| (plan, self.solution.active.iter()))
    }

    /// Goes on from the last plan of another controller with the same model and sampling time, as
    /// if it were its own. A longer horizon is filled up with the last input on the nonlinear model.
    pub fn adopt(
        &mut self,
        plan: &LastPlan<'_, T, NX, NU>,
        active: impl Iterator<Item = ActiveRow<T>>,
    ) {
        self.reset();
        let (Some(mut x), Some(mut u)) = (plan.x.first().copied(), plan.u.first().copied()) else {
            return;
        };
        self.solution.clear();
        for i in 0..self.settings.horizon {
            u = plan.u.get(i).copied().unwrap_or(u);
            x = match plan.x.get(i) {
                Some(x) => *x,
                None => next_state(&self.model, &self.settings, &x, &u),
            };
            let gain = plan.gain.get(i).copied().unwrap_or_else(SMatrix::zeros);
            let places = (self.rollout.get_mut(i), self.solution.u.get_mut(i));
            if let (Some(place_x), Some(place_u)) = places {
                (*place_x, *place_u) = (x, u);
            }
            if let Some(place) = self.policy.gain.get_mut(i) {
                *place = gain;
            }
        }
        for row in active {
            // Those that do not fit are found again.
            self.solution.active.push(row);
        }
        copy(&mut self.policy.u, &self.solution.u);
        (self.policy.cost, self.policy.damping) = (plan.cost, plan.damping);
        self.initialised = at(&self.rollout, self.last_stage())
            .iter()
            .all(|entry| entry.is_finite());
    }
}
