//! What a controller leaves to one with other settings: its last plan.

use crate::controller::{Controller, next_state};
use crate::model::{LpvModel, Scalar};
use crate::plan::at;
use crate::settings::Iterations;
use crate::two_parts::Answered;
use nalgebra::SMatrix;

impl<P, T, const NX: usize, const NU: usize, const NS: usize> Controller<P, T, NX, NU, NS>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
{
    /// Goes on from the last plan of another controller of the same plant, as if it were its own. A
    /// longer horizon is filled up with the last input on the nonlinear model. At another sampling
    /// time the plan's inputs would be another motion: then, and where there is no plan, this one
    /// begins without a past.
    pub fn take_over(&mut self, previous: &Self) {
        self.reset();
        let horizon = previous.settings.horizon;
        let last = &previous.solution;
        // Of a plan that has moved on to the coming sample, the answer to the last one has not.
        let moved_on = previous.prepared.is_some_and(|prepared| prepared.moved_on);
        let inputs = if moved_on {
            &previous.policy.u
        } else {
            &last.u
        };
        let inputs = inputs.get(..horizon).unwrap_or_default();
        let states = previous.rollout.get(..horizon).unwrap_or_default();
        // The paper's loop keeps none.
        let descent = matches!(previous.settings.iterations, Iterations::Descent { .. });
        let kept = if descent { horizon } else { 0 };
        let matrices = previous.policy.feedback.get(..kept).unwrap_or_default();
        let (Some(mut x), Some(mut u)) = (states.first().copied(), inputs.first().copied()) else {
            return;
        };
        if !previous.initialised || previous.settings.t_s != self.settings.t_s {
            return;
        }
        for i in 0..self.settings.horizon {
            u = inputs.get(i).copied().unwrap_or(u);
            x = match states.get(i) {
                Some(x) => *x,
                None => next_state(&self.model, &self.settings, &x, &u),
            };
            let feedback = matrices.get(i).copied().unwrap_or_else(SMatrix::zeros);
            put(&mut self.rollout, i, x);
            put(&mut self.policy.u, i, u);
            put(&mut self.policy.feedback, i, feedback);
            let answered = (last.x.get(i), last.u.get(i));
            put(&mut self.solution.x, i, *answered.0.unwrap_or(&x));
            put(&mut self.solution.u, i, *answered.1.unwrap_or(&u));
        }
        (self.solution.status, self.solution.cost) = (last.status, last.cost);
        (self.gap, self.target) = (previous.gap, previous.target);
        match previous.answered {
            // The rollout that a feedback has left for later.
            Some(Answered::At(x)) => self.roll_out(&x, ()),
            // One that needs a preview is still left for later.
            later => self.answered = later,
        }
        // Rows that do not fit are found again.
        self.solution.active.copy_from(&last.active);
        let (cost, damping) = match descent {
            true => (previous.policy.cost, previous.policy.damping),
            // So dear that others are looked for beside it.
            false => (T::zero(), T::zero()),
        };
        (self.policy.cost, self.policy.damping) = (cost, damping);
        self.policy.far = previous.policy.far;
        self.initialised = at(&self.rollout, self.last_stage())
            .iter()
            .all(|entry| entry.is_finite());
        self.prepared = previous.prepared;
        self.put_back();
    }
}

fn put<V>(entries: &mut [V], i: usize, entry: V) {
    if let Some(place) = entries.get_mut(i) {
        *place = entry;
    }
}
