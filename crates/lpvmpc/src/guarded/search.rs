//! The search of a sample: quadratic programs along a plan, and what of the way to their answers the
//! rollout confirms.

use super::aim::SetPoints;
use super::plan::Plan;
use super::program::{self, Slope};
use super::{Decision, GuardedController, GuardedSettings, GuardedWorkspace};
use crate::model::{LpvModel, Scalar};
use crate::solver::{SolverSettings, WarmStart};
use nalgebra::{SVector, convert};

/// Relative decrease of the cost below which more programs of a sample are not worth their time.
const WORTHWHILE: f64 = 1e-7;
/// Fractions of the way to the quadratic program's answer that are tried.
const FRACTIONS: [f64; 4] = [1.0, 0.5, 0.25, 0.125];

impl<
    P,
    T,
    const NX: usize,
    const NU: usize,
    const NS: usize,
    const N: usize,
    const NA: usize,
    const NP: usize,
> GuardedController<P, T, NX, NU, NS, N, NA, NP>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
{
    /// Quadratic programs along `along`, each answer confirmed by the rollout. Returns the best
    /// confirmed plan that costs less than what is `known` (its kind, and the least cost), with its
    /// gap, and goes on after a first one as long as there are programs left and the cost falls.
    pub(super) fn improve<const M: usize>(
        &mut self,
        x: &SVector<T, NX>,
        aims: &SetPoints<T, N>,
        along: &Plan<T, NX, NU, N>,
        known: Option<(Decision, T)>,
        workspace: &mut GuardedWorkspace<T, NU, NA, NP, M>,
    ) -> Option<(Plan<T, NX, NU, N>, SVector<T, NX>)> {
        let GuardedSettings { iterations, .. } = self.settings;
        let most = match known {
            Some((Decision::Candidate, _)) => iterations.known,
            _ => iterations.unknown,
        };
        let mut along = *along;
        let mut least = known.map(|(_, cost)| cost);
        let mut improved = None;
        let mut in_vain = 0;
        let mut served = self.damping;
        let mut warm_start = WarmStart::Same;
        for _ in 0..most {
            self.pose(x, aims, &along, self.slope, &mut workspace.ocp);
            self.solve(workspace, warm_start);
            warm_start = WarmStart::Same;
            if least.is_none() && !workspace.solution.status.is_solved() {
                self.soften(&mut workspace.ocp);
                self.solve(workspace, WarmStart::Cold);
            }
            let outcome = if workspace.solution.status.is_solved() {
                self.learn(workspace, &along);
                self.search(x, aims, &along, least, workspace)
            } else {
                Outcome::Nothing
            };
            if workspace.solution.status.is_solved() {
                (self.drift, self.end_drift) = self.tube_of_program(&along, workspace);
            }
            let found = match outcome {
                Outcome::Found(found) => found,
                Outcome::Settled => {
                    self.damp(Some(1.0));
                    break;
                }
                Outcome::Nothing => {
                    // What does not serve far from the plan may serve close to it, and the other
                    // way round.
                    self.damp(None);
                    self.slope = self.slope.other();
                    in_vain += 1;
                    if in_vain == 3 {
                        // At a plan that nothing improves on, damping says nothing of the next
                        // sample's.
                        self.damping = served;
                        break;
                    }
                    continue;
                }
            };
            self.damp(Some(found.fraction));
            served = self.damping;
            in_vain = 0;
            self.slope = Slope::Jacobian;
            let settled =
                least.is_some_and(|least| !self.is_worthwhile(least - found.plan.cost, least));
            along = found.plan;
            if found.feasible {
                least = Some(found.plan.cost);
                improved = Some((found.plan, found.gap));
            }
            if settled {
                break;
            }
        }
        improved
    }

    /// The first part of the way to the program's answer that is feasible and costs less than the
    /// `least` cost so far; while no feasible plan is known, the first that is feasible, or else nearer
    /// to it.
    fn search<const M: usize>(
        &self,
        x: &SVector<T, NX>,
        aims: &SetPoints<T, N>,
        along: &Plan<T, NX, NU, N>,
        least: Option<T>,
        workspace: &GuardedWorkspace<T, NU, NA, NP, M>,
    ) -> Outcome<T, NX, NU, N> {
        let horizon = self.settings.horizon;
        let origin = self.settings.direction * along.set_point;
        let GuardedWorkspace {
            solution, solver, ..
        } = workspace;
        let towards = program::answer(solution, solver, &origin);
        let predicted = program::predicted_end(solution, horizon, &origin);
        let before = self.merit(along);
        let mut nearer = None;
        for fraction in FRACTIONS {
            let plan = self.between(x, aims, along, &towards, convert(fraction));
            let found = self.judge(plan, fraction, &predicted);
            if found.feasible && least.is_none_or(|least| plan.cost < least) {
                return Outcome::Found(found);
            }
            if fraction == 1.0
                && least.is_some_and(|least| !self.is_worthwhile(plan.cost - least, least))
            {
                return Outcome::Settled;
            }
            if least.is_none() && nearer.is_none() && self.merit(&plan) < before {
                nearer = Some(found);
            }
        }
        nearer.map_or(Outcome::Nothing, Outcome::Found)
    }

    /// A rollout with what it is worth; `predicted` is where the program expected its end.
    fn judge(
        &self,
        mut plan: Plan<T, NX, NU, N>,
        fraction: f64,
        predicted: &SVector<T, NX>,
    ) -> Found<T, NX, NU, N> {
        let gap = plan.end - predicted;
        let feasible = self.is_feasible(&plan) && {
            (plan.drift, plan.end_drift) = self.tube(&plan);
            self.is_robust(&plan)
        };
        Found {
            plan,
            fraction,
            feasible,
            gap,
        }
    }

    /// Whether a change of the `cost` by so much, up or down, is worth another program.
    fn is_worthwhile(&self, change: T, cost: T) -> bool {
        let relative = cost * convert::<f64, T>(WORTHWHILE);
        let absolute = self.settings.terminal.level * T::default_epsilon().powf(convert(0.75));
        !(change.abs() <= relative + absolute)
    }

    /// More damping where a program's answer did not hold, less where all of it did.
    fn damp(&mut self, fraction: Option<f64>) {
        let least: T = convert(0.1);
        let factor = match fraction {
            Some(1.0) => 0.1,
            Some(0.5) => 1.5,
            Some(_) => 3.0,
            None => 4.0,
        };
        let damping = self.damping.max(least) * convert(factor);
        self.damping = if damping < least {
            T::zero()
        } else {
            damping.min(convert(1e3))
        };
    }

    /// Outside of what is guaranteed: soft bounds, then the saturated terminal law.
    pub(super) fn last_resort<const M: usize>(
        &self,
        x: &SVector<T, NX>,
        aims: &SetPoints<T, N>,
        along: &Plan<T, NX, NU, N>,
        workspace: &mut GuardedWorkspace<T, NU, NA, NP, M>,
    ) -> (Plan<T, NX, NU, N>, Decision, SVector<T, NX>) {
        if along.cost.is_finite() {
            self.pose(x, aims, along, self.slope, &mut workspace.ocp);
            self.soften(&mut workspace.ocp);
            self.solve(workspace, WarmStart::Cold);
            if workspace.solution.status.is_solved() {
                let GuardedWorkspace {
                    solution, solver, ..
                } = workspace;
                let origin = self.settings.direction * along.set_point;
                let towards = program::answer(solution, solver, &origin);
                let plan = self.between(x, aims, along, &towards, T::one());
                if plan.cost.is_finite() {
                    let predicted =
                        program::predicted_end(solution, self.settings.horizon, &origin);
                    return (plan, Decision::SoftBounds, plan.end - predicted);
                }
            }
        }
        let plan = self.under_terminal_law(x, aims);
        (plan, Decision::SaturatedLqr, SVector::zeros())
    }

    fn solve<const M: usize>(
        &self,
        workspace: &mut GuardedWorkspace<T, NU, NA, NP, M>,
        warm_start: WarmStart,
    ) {
        let settings = SolverSettings {
            warm_start,
            ..self.settings.solver
        };
        workspace
            .solver
            .solve(&workspace.ocp, &settings, &mut workspace.solution);
    }
}

/// What a program's answer is good for.
#[derive(Clone, Copy)]
enum Outcome<T, const NX: usize, const NU: usize, const N: usize> {
    /// A plan to go on from.
    Found(Found<T, NX, NU, N>),
    /// It is the plan that there is, up to what is not worth its time.
    Settled,
    /// No part of the way is better.
    Nothing,
}

/// A part of the way to a program's answer, rolled out.
#[derive(Clone, Copy)]
struct Found<T, const NX: usize, const NU: usize, const N: usize> {
    plan: Plan<T, NX, NU, N>,
    /// Part of the way.
    fraction: f64,
    feasible: bool,
    /// Rolled-out minus predicted state at the end.
    gap: SVector<T, NX>,
}
