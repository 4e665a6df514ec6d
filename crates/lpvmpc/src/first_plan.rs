//! What a descent begins with: the rest of the last plan, the regulator's own closed loops, or the answer of a program
//! with the matrices of the present state.

use crate::by_stage::PlantByStage;
use crate::controller::Controller;
use crate::descent::Outcome;
use crate::linearization::Along;
use crate::model::{LpvModel, Scalar};
use crate::ocp::{Ocp, Stage};
use crate::outputs;
use crate::plan::{Aim, Prices, at};
use crate::policy::input_at;
use crate::riccati::{CostToGo, StageFactor};
use crate::workspace::Workspace;
use nalgebra::{SMatrix, SVector, convert};

/// Parts of the way to the set point to which the regulator is sent where there is no plan.
#[inline(always)]
fn parts<T: Scalar>() -> [T; 6] {
    // Number by number: see `steps` of a line search.
    [
        convert(1.0),
        convert(0.3),
        convert(0.1),
        convert(0.03),
        convert(0.01),
        convert(0.0),
    ]
}
/// Stages of the regulator, at least.
const REGULATOR: usize = 20;
/// A plan that costs more by so many times what the last one did is no longer the only candidate.
const JUMP: f64 = 1.0;

/// What a plan begins with.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum First {
    /// The rest of the last plan.
    Rest,
    /// There is none, or it has become dear: the best of it and the regulator's closed loops.
    Regulator,
    /// None of them is finite.
    Nothing,
}

impl<P, T, const NX: usize, const NU: usize, const NS: usize> Controller<P, T, NX, NU, NS>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
{
    /// The rest of the last plan from `x`; where there is none, or it has become dear, the best of
    /// the regulator's own closed loops if that is cheaper.
    pub(crate) fn first_plan<D: PlantByStage<P, T, NX, NU, NS>>(
        &mut self,
        x: &SVector<T, NX>,
        aim: &Aim<'_, T, NX, NU, D>,
        workspace: &mut Workspace<T, NX, NU>,
    ) -> First {
        let last = self.policy.cost;
        let merit = self.merit(aim, Prices::none());
        let mut best = None;
        if self.initialised {
            self.shift(aim);
            let unlimited = convert(f64::INFINITY);
            best = self.roll_out_plan(x, &merit, unlimited, &mut workspace.trial, &|i, x| {
                let policy = &self.policy;
                let planned = (&at(&self.rollout, i), &at(&policy.u, i));
                let bounds = aim.own.u(i, &self.settings.u);
                input_at(x, planned, &at(&policy.feedback, i), &bounds)
            });
            self.take_if_some(best, &workspace.trial);
        }
        let dear = best.is_none_or(|cost| cost - last > last.abs() * convert(JUMP));
        match dear.then(|| self.regulate(x, aim, best, workspace)) {
            None => First::Rest,
            Some(None) => First::Nothing,
            Some(Some(_)) => First::Regulator,
        }
    }

    /// Whether the plan keeps the bounds of the states.
    pub(crate) fn keeps_bounds<D: PlantByStage<P, T, NX, NU, NS>>(
        &self,
        aim: &Aim<'_, T, NX, NU, D>,
    ) -> bool {
        let mut states = self.rollout.iter().enumerate();
        states.all(|(i, x)| aim.own.x(i + 1).unwrap_or(&self.settings.x).hold_at(x))
    }

    /// One program with the matrices of `x` at all stages, as one program per sample begins, too. The plan moves towards its
    /// answer as far as that is better; whether it does is the answer.
    ///
    /// The regulator knows of no state bounds: where its loops exceed them, all of them may lie in a valley that no
    /// plan within the bounds is in.
    #[inline(never)]
    pub(crate) fn hold_matrices<D: PlantByStage<P, T, NX, NU, NS>>(
        &mut self,
        x: &SVector<T, NX>,
        aim: &Aim<'_, T, NX, NU, D>,
        tolerance: T,
        prices: &mut Prices<T, NX>,
        workspace: &mut Workspace<T, NX, NU>,
    ) -> bool {
        self.initialised = false;
        self.solve_scheduled(x, aim, workspace);
        self.take_feedback(workspace);
        // The states of the plan were in the way of that.
        let merit = self.merit(aim, *prices);
        let unlimited = convert(f64::INFINITY);
        let cost = self.roll_out_plan(x, &merit, unlimited, &mut workspace.trial, &|i, _| {
            at(&self.policy.u, i)
        });
        self.take_if_some(cost, &workspace.trial);
        let outcome = self.improve(x, aim, (tolerance, T::one()), prices, workspace);
        matches!(outcome, Outcome::Moved { .. })
    }

    /// The regulator's closed loops towards the set point and towards points on the way to it, from the
    /// farthest on, until they become dearer again. The plan becomes the cheapest of them, if it is
    /// cheaper than `best`; returns what it costs then. Where none of them is finite, it is the input of the
    /// reference, held.
    #[inline(never)]
    pub(crate) fn regulate<D: PlantByStage<P, T, NX, NU, NS>>(
        &mut self,
        x: &SVector<T, NX>,
        aim: &Aim<'_, T, NX, NU, D>,
        mut best: Option<T>,
        workspace: &mut Workspace<T, NX, NU>,
    ) -> Option<T> {
        let (mut feedback, indifferent) = self.regulator(aim, &workspace.ocp);
        let mut away = (x - aim.end()).component_mul(&indifferent);
        let merit = self.merit(aim, Prices::none());
        let mut found_one = false;
        let every = parts::<T>();
        let mut parts = every.iter();
        while let Some(part) = parts.next() {
            let x_aim = aim.end() + away * (T::one() - *part);
            let most = best.unwrap_or(convert(f64::INFINITY));
            let cost = self.roll_out_plan(x, &merit, most, &mut workspace.trial, &|i, x| {
                let bounds = aim.own.u(i, &self.settings.u);
                input_at(x, (&x_aim, aim.u_ref(i)), &feedback, &bounds)
            });
            if let Some(found) = cost
                && best.is_none_or(|best| found < best)
            {
                best = cost;
                self.take_if_some(cost, &workspace.trial);
                self.policy.feedback.fill(feedback);
                self.policy.damping = T::zero();
                self.policy.far = true;
                found_one = true;
            } else if found_one && self.keeps_bounds(aim) {
                break;
            }
            if away.amax() == T::zero() || parts.len() == 0 {
                if best.is_some() || feedback.amax() == T::zero() {
                    break;
                }
                // The regulator leads to nothing finite: last, the input of the reference, held.
                (feedback, away) = (SMatrix::zeros(), SVector::zeros());
                parts = every[..1].iter();
            }
        }
        best
    }

    /// The feedback matrix of the regulator at the end of the reference (u = u_ref + K (x - x_ref)), that of the
    /// first of many equal stages with the weights of `ocp`; and 1 for each state whose value is all the
    /// same to the plant (the position, as a rule), 0 for the others.
    fn regulator<D: PlantByStage<P, T, NX, NU, NS>>(
        &self,
        aim: &Aim<'_, T, NX, NU, D>,
        ocp: &Ocp<T, NX, NU>,
    ) -> (SMatrix<T, NU, NX>, SVector<T, NX>) {
        let last = self.last_stage();
        let end = (aim.end(), aim.u_ref(last));
        let (model, settings) = (&self.model, &self.settings);
        let (a, b) = { &aim.own }.sample_matrices(last, model, settings, end, Along::Jacobian);
        let own;
        let weights = if D::SOME {
            let mut common = *ocp.common_at(last);
            if let Some(outputs) = aim.own.outputs() {
                let (mut of_x, mut of_u) = (SVector::zeros(), SVector::zeros());
                outputs::add_costs(outputs, last, end, &mut common, (&mut of_x, &mut of_u));
            }
            own = common;
            &own
        } else {
            &ocp.common
        };
        let indifferent = SVector::from_fn(|j, _| {
            let column = (0..NX).all(|i| a[(i, j)] == one_if(i == j));
            one_if(column)
        });
        let stage = Stage {
            a,
            b,
            ..Stage::new()
        };
        let mut cost_to_go = CostToGo {
            quadratic: ocp.terminal.p,
            linear: SVector::zeros(),
        };
        let mut factor = StageFactor::zeros();
        for _ in 0..self.settings.horizon.max(REGULATOR) {
            if factor.eliminate(&stage, weights, &mut cost_to_go).is_err() {
                return (SMatrix::zeros(), indifferent);
            }
        }
        (factor.feedback, indifferent)
    }

    /// The plan one sample on; its last stage is the regulator's.
    fn shift<D: PlantByStage<P, T, NX, NU, NS>>(&mut self, aim: &Aim<'_, T, NX, NU, D>) {
        let last = self.last_stage();
        let feedback = at(&self.policy.feedback, last);
        let planned = (aim.end(), aim.u_ref(last));
        let end = at(&self.rollout, last);
        let bounds = aim.own.u(last, &self.settings.u);
        let u = input_at(&end, planned, &feedback, &bounds);
        // What comes in from beyond the horizon is overwritten.
        move_on(&mut self.policy.u, last, u);
        move_on(&mut self.policy.feedback, last, feedback);
    }

    /// The plan one sample back, where the state `x` is expected next. The input and the feedback before that are lost;
    /// nothing depends on them.
    #[cold]
    #[inline(never)]
    pub(crate) fn shift_back(&mut self, x: SVector<T, NX>) {
        move_back(&mut self.policy.u);
        move_back(&mut self.policy.feedback);
        move_back(&mut self.rollout);
        if let Some(first) = self.rollout.first_mut() {
            *first = x;
        }
    }
}

/// The entries one stage earlier, with `end` as that of stage `last`.
fn move_on<V: Copy>(entries: &mut [V], last: usize, end: V) {
    for i in 0..last {
        if let Some([place, next]) = entries.get_mut(i..i + 2) {
            *place = *next;
        }
    }
    if let Some(place) = entries.get_mut(last) {
        *place = end;
    }
}

/// The entries one stage later, without the last one.
fn move_back<V: Copy>(entries: &mut [V]) {
    for i in (1..entries.len()).rev() {
        if let Some([before, place]) = entries.get_mut(i - 1..=i) {
            *place = *before;
        }
    }
}

fn one_if<T: Scalar>(condition: bool) -> T {
    if condition { T::one() } else { T::zero() }
}
