//! What a controller leaves to one with other settings: its last plan.

use crate::controller::{Controller, next_state};
use crate::model::{LpvModel, Scalar};
use crate::plan::at;
use crate::two_parts::Answered;
use crate::working_set::copy;
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
        let states = previous.rollout.get(..horizon).unwrap_or_default();
        let inputs = previous.solution.u.get(..horizon).unwrap_or_default();
        let matrices = previous.policy.feedback.get(..horizon).unwrap_or_default();
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
            let places = (self.rollout.get_mut(i), self.solution.u.get_mut(i));
            if let (Some(place_x), Some(place_u)) = places {
                (*place_x, *place_u) = (x, u);
            }
            if let Some(place) = self.policy.feedback.get_mut(i) {
                *place = feedback;
            }
        }
        match previous.answered {
            // The rollout that a feedback has left for later.
            Some(Answered::At(x)) => self.roll_out(&x, ()),
            // One that needs a preview is still left for later.
            later => self.answered = later,
        }
        // Rows that do not fit are found again.
        self.solution.active.copy_from(&previous.solution.active);
        copy(&mut self.policy.u, &self.solution.u);
        let (cost, damping) = (previous.policy.cost, previous.policy.damping);
        (self.policy.cost, self.policy.damping) = (cost, damping);
        self.policy.far = previous.policy.far;
        self.initialised = at(&self.rollout, self.last_stage())
            .iter()
            .all(|entry| entry.is_finite());
    }
}
