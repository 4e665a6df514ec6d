//! The search of a sample: quadratic programs along a plan, and what of the way to their answers the
//! rollout confirms.

use super::plan::Plan;
use super::program::{self, Slope};
use super::{Decision, GuaranteedController, GuaranteedWorkspace, Planner};
use crate::model::{LpvModel, Scalar};
use crate::solver_settings::{SolverSettings, WarmStart};
use core::mem::swap;
use nalgebra::{SVector, convert};

/// Relative decrease of the cost below which more programs of a sample are not worth their time.
const WORTHWHILE: f64 = 1e-7;
/// The shortest part of the way to the quadratic program's answer that a thorough search tries.
const SHORTEST: f64 = 0.125;
/// Programs without an answer, while no plan is known, after which all others of the sample have soft bounds at once:
/// what leaves the one none leaves the next one none, and to prove it can take a hundred times as long as to answer.
const HOPELESS: usize = 3;
/// The longest horizon, in samples, over which every search is thorough: it takes little time there.
const SHORT_HORIZON: usize = 10;

impl<P, T, const NX: usize, const NU: usize, const NS: usize> GuaranteedController<P, T, NX, NU, NS>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
{
    /// Quadratic programs along the plan `along`, the first from a `warm_start`, each answer confirmed by the
    /// rollout. Where one or more
    /// are confirmed and cost less than what is `known` (its kind, and the least cost), `along` becomes
    /// the best of them, and the answer is its gap. The search goes on after a first one as long as there
    /// are programs left and the cost falls.
    pub(super) fn improve<const NA: usize>(
        &mut self,
        known: Option<(Decision, T)>,
        mut warm_start: WarmStart,
        workspace: &mut GuaranteedWorkspace<T, NU, NA>,
    ) -> Option<SVector<T, NX>> {
        let Self {
            planner,
            along,
            trial,
            nearer,
            ..
        } = self;
        let iterations = planner.settings.iterations;
        let most = match known {
            Some((Decision::Candidate, _)) => iterations.known,
            _ => iterations.unknown,
        };
        let long = planner.settings.horizon > SHORT_HORIZON;
        let effort = match known {
            Some((Decision::Candidate, _)) if most == 1 && long => Effort::Quick,
            _ => Effort::Thorough,
        };
        let mut least = known.map(|(_, cost)| cost);
        let mut improved = None;
        let (mut unanswered, mut in_vain) = (0, 0);
        let mut served = planner.damping;
        // What is aimed at, while a first plan is looked for without it.
        let mut wanted = None;
        planner.without_room &= known.is_some();
        for _ in 0..most {
            planner.pose(along, &mut workspace.ocp);
            let hopeless = least.is_none() && unanswered == HOPELESS;
            if !hopeless {
                planner.solve(workspace, warm_start);
            }
            warm_start = WarmStart::Same;
            if hopeless || least.is_none() && !workspace.solution.status.is_solved() {
                unanswered = HOPELESS.min(unanswered + 1);
                planner.soften(&mut workspace.ocp);
                planner.solve(workspace, WarmStart::Cold);
            }
            let answered = workspace.solution.status.is_solved();
            if !answered && known.is_some() && !planner.without_room {
                planner.without_room = true;
                continue;
            }
            let outcome = if answered {
                planner.learn(workspace, along);
                let outcome = planner.search(along, least, effort, workspace, [trial, nearer]);
                match &outcome {
                    Outcome::Found(found) if found.feasible => planner.take_drift(trial),
                    _ => planner.learn_drift(along, workspace),
                }
                outcome
            } else {
                Outcome::Nothing
            };
            let found = match outcome {
                Outcome::Found(found) => found,
                Outcome::Settled => {
                    planner.damp(Some(1.0));
                    break;
                }
                Outcome::Nothing => {
                    // What does not serve far from the plan may serve close to it, and the other
                    // way round.
                    planner.damp(None);
                    planner.slope = planner.slope.other();
                    in_vain += 1;
                    if in_vain == 3 {
                        // At a plan that nothing improves on, damping says nothing of the next
                        // sample's.
                        planner.damping = served;
                        if least.is_some() || wanted.is_some() {
                            break;
                        }
                        // A far set point draws plans to the bounds; away from it there may be one.
                        wanted = Some(planner.aims.stay(along.set_point));
                        along.cost = planner.cost(along);
                        (planner.damping, planner.slope) = (T::zero(), Slope::Jacobian);
                        in_vain = 0;
                    }
                    continue;
                }
            };
            planner.damp(Some(found.fraction));
            served = planner.damping;
            in_vain = 0;
            planner.slope = Slope::Jacobian;
            let settled =
                least.is_some_and(|least| !planner.is_worthwhile(least - trial.cost, least));
            swap(along, trial);
            if found.feasible {
                planner.aim_again(wanted.take(), along);
                least = Some(along.cost);
                improved = Some(found.gap);
            }
            if settled {
                break;
            }
        }
        planner.aim_again(wanted, along);
        // From so far away that the cost overflows, it could not be told to fall.
        improved.filter(|_| along.cost.is_finite())
    }

    /// Outside of what is guaranteed: soft bounds, then the saturated terminal law. The answer is the plan
    /// `along`, with its gap.
    pub(super) fn last_resort<const NA: usize>(
        &mut self,
        workspace: &mut GuaranteedWorkspace<T, NU, NA>,
    ) -> (Decision, SVector<T, NX>) {
        let Self {
            planner,
            along,
            trial,
            ..
        } = self;
        if along.cost.is_finite() {
            planner.pose(along, &mut workspace.ocp);
            planner.soften(&mut workspace.ocp);
            planner.solve(workspace, WarmStart::Cold);
            if workspace.solution.status.is_solved() {
                let origin = planner.settings.direction * along.set_point;
                let towards = program::answer(workspace, &origin);
                planner.go_between(along, towards, T::one(), None, trial);
                if trial.cost.is_finite() {
                    swap(along, trial);
                    let horizon = planner.settings.horizon;
                    let predicted = program::predicted_end(&workspace.solution, horizon, &origin);
                    return (Decision::SoftBounds, along.end - predicted);
                }
            }
        }
        let x = along.start;
        planner.follow_terminal_law(&x, along);
        (Decision::SaturatedLqr, SVector::zeros())
    }
}

impl<P, T, const NX: usize, const NU: usize, const NS: usize> Planner<P, T, NX, NU, NS>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
{
    /// The first part of the way to the program's answer that is feasible and costs less than the `least`
    /// cost so far; while no feasible plan is known, the first that is feasible, or else nearer to it.
    /// What is found is left in the first of the two plans; the second is kept where a plan is known.
    fn search<const NA: usize>(
        &mut self,
        along: &Plan<T, NX, NU>,
        least: Option<T>,
        effort: Effort,
        workspace: &GuaranteedWorkspace<T, NU, NA>,
        [trial, nearer]: [&mut Plan<T, NX, NU>; 2],
    ) -> Outcome<T, NX> {
        let horizon = self.settings.horizon;
        let origin = self.settings.direction * along.set_point;
        let predicted = program::predicted_end(&workspace.solution, horizon, &origin);
        let before = self.merit(along);
        let most = least.map(|least| least + self.worthwhile(least));
        let mut near = None;
        // How much dearer the whole way is than the plan itself.
        let mut dearer = T::zero();
        let mut next = Some(1.0);
        while let Some(fraction) = next {
            let towards = program::answer(workspace, &origin);
            self.go_between(along, towards, convert(fraction), most, trial);
            // What is too dear need not be judged, which takes longer than its rollout.
            let cheaper = least.is_none_or(|least| trial.cost < least);
            let found = Found {
                fraction,
                feasible: cheaper && self.judge(trial),
                gap: trial.end - predicted,
            };
            if found.feasible {
                return Outcome::Found(found);
            }
            if fraction == 1.0
                && least.is_some_and(|least| !self.is_worthwhile(trial.cost - least, least))
            {
                return Outcome::Settled;
            }
            if least.is_none() && near.is_none() && self.merit(trial) < before {
                swap(trial, nearer);
                near = Some(found);
            }
            let rise = trial.cost - along.cost;
            if fraction == 1.0 {
                dearer = rise;
            }
            // The parabola through the plan, half of the way and the whole of it rises from there on.
            let rises = rise * convert(4.0) - dearer >= T::zero() && rise.is_finite();
            if fraction == 0.5 && rises && least.is_some_and(|least| along.cost >= least) {
                break;
            }
            next = effort.after(fraction, trial.cost.is_finite());
        }
        if near.is_some() {
            swap(trial, nearer);
        }
        near.map_or(Outcome::Nothing, Outcome::Found)
    }

    /// Whether the rollout keeps all bounds wherever the plant can be that follows it, which is worked out
    /// where it does so itself.
    fn judge(&mut self, plan: &mut Plan<T, NX, NU>) -> bool {
        self.is_feasible(plan) && self.becomes_robust(plan)
    }

    /// Whether a change of the `cost` by so much, up or down, is worth another program.
    fn is_worthwhile(&self, change: T, cost: T) -> bool {
        !(change.abs() <= self.worthwhile(cost))
    }

    /// The largest change of the `cost` that is not.
    fn worthwhile(&self, cost: T) -> T {
        let relative = cost * convert::<f64, T>(WORTHWHILE);
        let absolute = self.settings.terminal.level * T::default_epsilon().powf(convert(0.75));
        relative + absolute
    }

    /// More damping where a program's answer did not hold, less where all of it did. At its largest it is
    /// not what the last one to hold had asked for, and falls faster.
    fn damp(&mut self, fraction: Option<f64>) {
        let [least, most] = [0.1, 1e3].map(convert::<f64, T>);
        let factor = match fraction {
            Some(1.0) if self.damping >= most => 0.03,
            Some(1.0) => 0.1,
            Some(0.5) => 1.5,
            Some(_) => 3.0,
            None => 4.0,
        };
        let damping = self.damping.max(least) * convert(factor);
        self.damping = if damping < least {
            T::zero()
        } else {
            damping.min(most)
        };
    }

    fn solve<const NA: usize>(
        &self,
        workspace: &mut GuaranteedWorkspace<T, NU, NA>,
        warm_start: WarmStart,
    ) {
        let settings = SolverSettings {
            warm_start,
            ..self.settings.solver
        };
        // The plan is followed: what was active in it is active again.
        let active = &mut workspace.solution.active;
        (active.doubted, active.trusted) = (0, true);
        workspace
            .solver
            .solve_for_factors(&workspace.ocp, &settings, &mut workspace.solution);
    }
}

/// How many parts of the way to a program's answer are tried.
#[derive(Clone, Copy)]
enum Effort {
    /// Halves of halves: there is no plan as good as the last one, or more than one program to spend time on.
    Thorough,
    /// Two: the samples that would try more are those that take longest, and damping brings the next answer nearer.
    Quick,
}

impl Effort {
    /// The part that is tried after this `fraction`, whose rollout came to its end or left the bounds.
    fn after(self, fraction: f64, came_to_end: bool) -> Option<f64> {
        match self {
            Self::Thorough => (fraction > SHORTEST).then_some(fraction * 0.5),
            Self::Quick if fraction == 1.0 => Some(if came_to_end { 0.5 } else { 0.3 }),
            Self::Quick => None,
        }
    }
}

/// What a program's answer is good for.
enum Outcome<T, const NX: usize> {
    /// A plan to go on from.
    Found(Found<T, NX>),
    /// It is the plan that there is, up to what is not worth its time.
    Settled,
    /// No part of the way is better.
    Nothing,
}

/// A part of the way to a program's answer, rolled out.
struct Found<T, const NX: usize> {
    /// Part of the way.
    fraction: f64,
    feasible: bool,
    /// Rolled-out minus predicted state at the end.
    gap: SVector<T, NX>,
}
