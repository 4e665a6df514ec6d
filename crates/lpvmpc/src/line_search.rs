//! The line search of a descent: how far the plan moves towards a program's answer.

use crate::by_stage::PlantByStage;
use crate::controller::Controller;
use crate::model::{LpvModel, Scalar};
use crate::plan::{Merit, Trial, at};
use crate::policy::input_at;
use crate::working_set::copy;
use nalgebra::{SVector, convert};

/// Parts of the way to a program's answer that are tried; beyond it only where damping holds it back.
#[inline(always)]
fn steps<T: Scalar>() -> [T; 6] {
    // Number by number: a list of `f64` would be converted one after the other while the program runs.
    [
        convert(LONGEST_STEP),
        convert(1.0),
        convert(0.5),
        convert(0.25),
        convert(0.1),
        convert(0.03),
    ]
}
/// Part of the expected gain that a step has to bring (Armijo's condition).
const SUFFICIENT: f64 = 1e-4;
/// The longest of them.
pub(crate) const LONGEST_STEP: f64 = 3.0;

impl<P, T, const NX: usize, const NU: usize, const NS: usize> Controller<P, T, NX, NU, NS>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
{
    /// The longest step from the plan towards `answer` (state and input of a stage) that lowers the
    /// merit enough, of those up to the `longest`, and the merit of the rollout that it leaves in `trial`.
    #[inline(never)]
    pub(crate) fn search_line<D: PlantByStage<P, T, NX, NU, NS>>(
        &self,
        x: &SVector<T, NX>,
        merit: &Merit<'_, T, NX, NU, D>,
        (expected, longest): (T, T),
        trial: &mut Trial<T, NX, NU>,
        answer: &dyn Fn(usize) -> (SVector<T, NX>, SVector<T, NU>),
    ) -> Option<(T, T)> {
        let Self {
            policy, rollout, ..
        } = self;
        for step in steps::<T>().into_iter().filter(|step| *step <= longest) {
            // Beyond the answer, all that was expected of it.
            let part = if step > T::one() {
                T::one()
            } else {
                step * convert(SUFFICIENT)
            };
            let sufficient = policy.cost - expected * part;
            let cost = self.roll_out_plan(x, merit, sufficient, trial, &|i, x_i| {
                let x_plan = i.checked_sub(1).map_or(*x, |j| at(rollout, j));
                let (x_answer, u_answer) = answer(i);
                let planned = x_plan + (x_answer - x_plan) * step;
                let u_plan = at(&policy.u, i);
                let u = u_plan + (u_answer - u_plan) * step;
                let bounds = merit.aim.own.u(i, &self.settings.u);
                input_at(x_i, (&planned, &u), &at(&policy.feedback, i), &bounds)
            });
            if let Some(cost) = cost
                && cost < policy.cost
            {
                return Some((step, cost));
            }
        }
        None
    }

    /// Rolls the nonlinear model out from `x` into `trial`, with the inputs that `input` gives for a
    /// stage and its state. Returns the merit; `None` if it is not finite or above `most`, where the
    /// rollout ends.
    // Once in the machine code: a call per stage is nothing beside a Runge-Kutta step.
    #[inline(never)]
    pub(crate) fn roll_out_plan<D: PlantByStage<P, T, NX, NU, NS>>(
        &self,
        x: &SVector<T, NX>,
        merit: &Merit<'_, T, NX, NU, D>,
        most: T,
        trial: &mut Trial<T, NX, NU>,
        input: &dyn Fn(usize, &SVector<T, NX>) -> SVector<T, NU>,
    ) -> Option<T> {
        let mut state = *x;
        let mut total = T::zero();
        // No stage costs less than nothing, but for linear costs.
        let most_before_end = if merit.aim.own.has_linear_costs() {
            convert(f64::INFINITY)
        } else {
            most
        };
        let places = trial.u.iter_mut().zip(&mut trial.x);
        for (i, (u, next)) in places.enumerate().take(self.settings.horizon) {
            *u = input(i, &state);
            total += merit.stage(i, &state, u);
            // Negated, so that a NaN ends it.
            if !(total <= most_before_end) {
                return None;
            }
            let own = &merit.aim.own;
            state = own.next_state(i, &self.model, &self.settings, &state, u);
            *next = state;
        }
        total += merit.end(&state);
        (total <= most && total.is_finite()).then_some(total)
    }

    /// The trial becomes the plan, if it has a cost.
    pub(crate) fn take_if_some(&mut self, cost: Option<T>, trial: &Trial<T, NX, NU>) {
        if let Some(cost) = cost {
            copy(&mut self.policy.u, &trial.u);
            copy(&mut self.rollout, &trial.x);
            self.policy.cost = cost;
            self.initialised = true;
        }
    }
}
