//! What a descent does where its programs cannot keep hard bounds (elastic programming; Nocedal and Wright, Numerical
//! Optimization, ch. 18.2), and what is said of a plan that exceeds them.
//!
//! A program is linear about a plan. Where that exceeds bounds by far, the program can be infeasible though the problem is
//! not. With soft bounds the same program has an answer, towards which the plan comes closer to the bounds, until along it
//! the hard ones can be kept.

use crate::by_stage::PlantByStage;
use crate::controller::Controller;
use crate::linearization::Along;
use crate::model::{LpvModel, Scalar};
use crate::outputs;
use crate::plan::{Aim, Prices, at};
use crate::settings::{TerminalIngredient, largest};
use crate::soft_bounds::width;
use crate::solution::{BoundId, Quantity, Side, Status};
use crate::workspace::Workspace;
use nalgebra::{SVector, convert};

/// A plan keeps a hard bound that it exceeds by no more than this part of its width. A program keeps it for a plan that is
/// linear; what is left of the bend of the model is less.
const NEGLIGIBLE: f64 = 0.01;
/// The same of a plan along which a program is proved to be infeasible, where the number type is fine enough.
const ROUNDING: f64 = 1e-6;
/// Of the price that is meant to be exact, one after the other.
#[cfg(all(feature = "alloc", not(target_arch = "wasm32")))]
const FACTORS: [f64; 2] = [1.0, DEAR];
/// The larger one.
#[cfg(all(feature = "alloc", not(target_arch = "wasm32")))]
pub(crate) const DEAR: f64 = 100.0;
/// Programs with hard bounds that are left for after the soft ones.
#[cfg(all(feature = "alloc", not(target_arch = "wasm32")))]
const HARD: usize = 2;

impl<P, T, const NX: usize, const NU: usize, const NS: usize> Controller<P, T, NX, NU, NS>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
{
    /// The search for a better plan, by way of soft bounds where it leads to none that keeps the hard ones.
    pub(crate) fn search_within_bounds<D: PlantByStage<P, T, NX, NU, NS>>(
        &mut self,
        x: &SVector<T, NX>,
        aim: &Aim<'_, T, NX, NU, D>,
        begin: (Along, usize, T),
        prices: &mut Prices<T, NX>,
        workspace: &mut Workspace<T, NX, NU>,
    ) -> Status<T> {
        let status = self.search(x, aim, begin, prices, workspace);
        let infeasible = matches!(self.solution.status, Status::Infeasible(_));
        if !(self.has_hard_bounds(aim) && (infeasible || self.exceeds(x, aim).is_some())) {
            return status;
        }
        let moved = status == Status::Improved;
        // A microcontroller has neither flash nor time for it, and a module for a browser has to be small.
        #[cfg(all(feature = "alloc", not(target_arch = "wasm32")))]
        let (status, moved) = self.restore(x, aim, ((status, moved), begin), prices, workspace);
        self.judge(x, aim, (status, moved))
    }

    /// The search goes on from a plan that exceeds hard bounds, or along which no program keeps them; what is `known` is its
    /// status, and whether it was moved.
    #[cfg(all(feature = "alloc", not(target_arch = "wasm32")))]
    #[cold]
    #[inline(never)]
    fn restore<D: PlantByStage<P, T, NX, NU, NS>>(
        &mut self,
        x: &SVector<T, NX>,
        aim: &Aim<'_, T, NX, NU, D>,
        (known, (_, most, tolerance)): ((Status<T>, bool), (Along, usize, T)),
        prices: &mut Prices<T, NX>,
        workspace: &mut Workspace<T, NX, NU>,
    ) -> (Status<T>, bool) {
        if self.problems() + HARD >= most {
            return known;
        }
        let (_, mut moved) = known;
        let soft_most = most - HARD;
        for factor in FACTORS {
            self.pose_elastic(x, aim, convert(factor), workspace);
            let begin = (Along::Jacobian, soft_most, tolerance);
            let found = self.search(x, aim, begin, &mut prices.clone(), workspace);
            moved |= matches!(found, Status::Improved | Status::Converged);
            let done = self.problems() >= soft_most || self.exceeds(x, aim).is_none();
            if done || !self.solution.status.is_solved() {
                break;
            }
        }
        self.pose_hard(aim, workspace);
        let begin = (Along::Jacobian, most, tolerance);
        let status = self.search(x, aim, begin, prices, workspace);
        (status, moved)
    }

    /// What a plan is worth that exceeds hard bounds, or along which no program keeps them, after a search with this `status`.
    #[cold]
    #[inline(never)]
    fn judge<D: PlantByStage<P, T, NX, NU, NS>>(
        &self,
        x: &SVector<T, NX>,
        aim: &Aim<'_, T, NX, NU, D>,
        (status, moved): (Status<T>, bool),
    ) -> Status<T> {
        let terminal = aim.own.terminal().unwrap_or(&self.settings.terminal);
        let equality = matches!(terminal, TerminalIngredient::Equality);
        match (self.exceeds(x, aim), self.solution.status) {
            (Some(bound), last) if last.is_solved() => Status::Exceeded(bound),
            (Some(_), reason) => reason,
            // The plan keeps all bounds, whatever the programs along it do; a terminal equality it may miss.
            (None, _) => match status {
                Status::Infeasible(_) if equality => status,
                Status::Infeasible(_) | Status::NoImprovement if moved => Status::Improved,
                Status::Infeasible(_) => Status::NoImprovement,
                status => status,
            },
        }
    }

    /// Whether there may be a hard bound of states or a hard general row.
    #[inline(always)]
    pub(crate) fn has_hard_bounds<D: PlantByStage<P, T, NX, NU, NS>>(
        &self,
        aim: &Aim<'_, T, NX, NU, D>,
    ) -> bool {
        let bounds = &self.settings.x;
        let sides = bounds.lower.iter().zip(bounds.upper.iter());
        let mut states = self.settings.soft_x.iter().zip(sides);
        let hard = states.any(|(soft, (lower, upper))| {
            soft.is_none() && (lower.is_finite() || upper.is_finite())
        });
        hard || aim.own.any()
    }

    /// The earliest hard bound that the plan does not keep. Where a program has proved that it cannot be kept, nothing but
    /// rounding is negligible.
    #[inline(never)]
    fn exceeds<D: PlantByStage<P, T, NX, NU, NS>>(
        &self,
        x: &SVector<T, NX>,
        aim: &Aim<'_, T, NX, NU, D>,
    ) -> Option<BoundId> {
        let negligible = match self.solution.status {
            Status::Infeasible(_) => largest(convert(ROUNDING), T::default_epsilon().sqrt()),
            _ => convert(NEGLIGIBLE),
        };
        (0..=self.settings.horizon).find_map(|i| self.exceeds_at(i, x, aim, negligible))
    }

    /// The first of those at stage `i`.
    fn exceeds_at<D: PlantByStage<P, T, NX, NU, NS>>(
        &self,
        stage: usize,
        x: &SVector<T, NX>,
        aim: &Aim<'_, T, NX, NU, D>,
        negligible: T,
    ) -> Option<BoundId> {
        let (own, end) = (&aim.own, stage == self.settings.horizon);
        let state = stage
            .checked_sub(1)
            .map_or(*x, |last| at(&self.rollout, last));
        let u = at(&self.policy.u, stage);
        let input = (!end).then_some(&u);
        let id = |quantity, side| BoundId {
            stage,
            quantity,
            side,
        };
        if stage > 0 {
            let bounds = own.x(stage).unwrap_or(&self.settings.x);
            let soft = own.soft_x(stage).unwrap_or(&self.settings.soft_x);
            let sides = bounds.lower.iter().zip(bounds.upper.iter());
            let states = state.iter().zip(sides).zip(soft).enumerate();
            for (j, ((value, (lower, upper)), soft)) in states {
                if soft.is_none()
                    && let Some(side) = side_of(*value, (*lower, *upper), negligible)
                {
                    return Some(id(Quantity::State(j), side));
                }
            }
        }
        let mut found = None;
        if let Some(outputs) = own.outputs() {
            outputs::hard_bounds(
                outputs,
                stage,
                (&state, input),
                &mut |j, y, lower, upper| {
                    let side = side_of(y, (lower, upper), negligible);
                    found = found.or(side.map(|side| id(Quantity::Row(j), side)));
                },
            );
        }
        let rows = own.rows(stage).iter().enumerate();
        let mut hard = rows.filter(|(_, row)| row.soft.is_none() && row.counts(stage == 0, end));
        found.or_else(|| {
            hard.find_map(|(j, row)| {
                let side = side_of(row.value(&state, input), (row.lower, row.upper), negligible)?;
                Some(id(Quantity::Row(outputs::rows(own) + j), side))
            })
        })
    }
}

/// The side on which a value is beyond its bounds by more than a `negligible` part of their width.
fn side_of<T: Scalar>(value: T, (lower, upper): (T, T), negligible: T) -> Option<Side> {
    let negligible = width(lower, upper)? * negligible;
    // Negated, so that a NaN is beyond them.
    if !(value >= lower - negligible) {
        Some(Side::Lower)
    } else if !(value <= upper + negligible) {
        Some(Side::Upper)
    } else {
        None
    }
}
