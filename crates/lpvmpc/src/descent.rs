//! A sample as a descent: each quadratic program is an improvement or is not taken.
//!
//! A plan is a policy (inputs, states, feedback matrices) that is rolled out on the nonlinear model, so that it
//! stays together on an unstable plant. Its merit is the cost J of that rollout, the exact penalty
//! of the state bounds included. A quadratic program along the plan proposes another one, and the
//! plan is moved towards it as far as the merit falls: a line search (Nocedal and Wright, Numerical
//! Optimization, ch. 18), with programs whose soft bounds have the very price of the merit
//! (Fletcher, Practical Methods of Optimization, ch. 14.3).
//!
//! Two linear models take turns. The embedding's matrices are good for long steps, far from where
//! the plan has to go; but what repeats itself under them is not the optimum. The Jacobian's are
//! exact to first order: what repeats itself under them is a stationary point of the nonlinear
//! problem. What they leave out is the curvature of the model. It is measured along every step, and
//! the next program of the Jacobian gets so much of it: what it changes of the inputs costs extra,
//! as in the method of Levenberg and Marquardt.

use crate::by_stage::{CostByStage, PlantByStage};
use crate::controller::Controller;
use crate::first_plan::First;
use crate::line_search::LONGEST_STEP;
use crate::linearization::{Along, States};
use crate::model::{LpvModel, Scalar};
use crate::plan::{Aim, Merit, Prices, at};
use crate::settings::TerminalIngredient;
use crate::solution::Status;
use crate::solver_settings::{SolverSettings, WarmStart};
use crate::working_set::copy;
use crate::workspace::Workspace;
use nalgebra::{SVector, convert};

/// What came of a program.
pub(crate) enum Outcome<T> {
    /// It has no answer.
    Unsolved(Status<T>),
    /// It expects to save next to nothing.
    NothingToGain {
        /// So little that the merit's rounding would hide it.
        hidden: bool,
    },
    /// It expects to save something, but no step towards its answer lowers the merit.
    NoStep,
    /// The plan was moved.
    Moved {
        /// Part of the way to the program's answer.
        step: T,
        /// Part of the merit that it saves.
        gain: T,
        /// The damping with which the program would have expected the merit that came.
        curvature: T,
    },
}

/// From each of them to the next longer one, at least.
const LONGER: f64 = 4.0;
/// The search ends after so many programs in a row that bring nothing; each is damped more.
const MOST_FAILURES: usize = 8;
/// A difference of two merits is known to so many roundings of one of them, and of its states.
const ROUNDINGS: f64 = 30.0;
/// A full step of a sample's first program may save so many tolerances and still end the search: it is
/// what the plan was short of for the time that has passed, and what it leaves is of second order.
const FIRST: f64 = 10.0;
/// After shorter steps than this the other linear model has its turn.
const SHORT_STEP: f64 = 0.5;
/// Damping goes up by this factor without a step, and down by no more; the least is the largest entry
/// of R.
const DAMPING_FACTOR: f64 = 10.0;

impl<P, T, const NX: usize, const NU: usize, const NS: usize> Controller<P, T, NX, NU, NS>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
{
    /// The plan from `x`, as the controller's solution.
    #[inline(never)]
    pub(crate) fn descend<D: PlantByStage<P, T, NX, NU, NS>>(
        &mut self,
        x: &SVector<T, NX>,
        aim: &Aim<'_, T, NX, NU, D>,
        tolerance: T,
        workspace: &mut Workspace<T, NX, NU>,
    ) {
        self.problems = 0;
        self.track(aim, &mut workspace.ocp);
        let iterations = &self.settings.iterations;
        let (along, most) = if self.initialised {
            (Along::Jacobian, iterations.most())
        } else {
            (Along::Scheduling, iterations.first())
        };
        #[cfg(all(feature = "alloc", not(target_arch = "wasm32")))]
        let last = self.initialised.then_some(self.policy.cost);
        let mut prices = Prices::none();
        let first = self.first_plan(x, aim, workspace);
        let moved = first == First::Regulator
            && !self.keeps_bounds(aim)
            && self.hold_matrices(x, aim, tolerance, &mut prices, workspace);
        let begun = first != First::Nothing;
        // Where there is another beginning to be looked for.
        #[cfg(all(feature = "alloc", not(target_arch = "wasm32")))]
        let runs_away = begun && workspace.kept.is_some() && self.runs_away(x, aim);
        #[cfg(not(all(feature = "alloc", not(target_arch = "wasm32"))))]
        let runs_away = false;
        let found = begun.then(|| {
            if runs_away {
                // As good as none.
                return Status::NotFinite;
            }
            let begin = (along, most, tolerance);
            match self.search_within_bounds(x, aim, begin, &mut prices, workspace) {
                Status::Converged => Status::Converged,
                // The program along the present state has improved the plan; whether it keeps hard bounds is judged.
                Status::NoImprovement if moved => Status::Improved,
                _ if moved && !self.has_hard_bounds(aim) => Status::Improved,
                status => status,
            }
        });
        #[cfg(all(feature = "alloc", not(target_arch = "wasm32")))]
        let found = {
            let last = last.filter(|_| !runs_away);
            self.look_elsewhere(x, aim, (last, tolerance), (found, prices), workspace)
        };
        match found {
            Some(Status::NotFinite) if runs_away => self.publish(Status::NoImprovement),
            Some(status) => self.publish(status),
            None => self.give_up(Status::NotFinite),
        }
    }

    /// Improves the plan, with programs whose matrices are `along` at first, until the sample has had `most` of
    /// them. Raises `prices` above their multipliers.
    pub(crate) fn search<D: PlantByStage<P, T, NX, NU, NS>>(
        &mut self,
        x: &SVector<T, NX>,
        aim: &Aim<'_, T, NX, NU, D>,
        (along, most, tolerance): (Along, usize, T),
        prices: &mut Prices<T, NX>,
        workspace: &mut Workspace<T, NX, NU>,
    ) -> Status<T> {
        let mut along = along;
        let mut status = Status::NoImprovement;
        // Programs in a row that have brought nothing.
        let mut failures = 0;
        // What was measured; after failures the damping is more than that.
        let mut measured = self.policy.damping;
        // The longest step that is tried along the embedding. It has no damping to shorten its answers.
        let mut longest_step = T::one();
        while self.problems() < most {
            self.linearize_plan(x, aim, (along, States::Follow), workspace);
            self.solve_program(workspace);
            let damped = self.policy.damping > T::zero();
            let longest = match along {
                Along::Scheduling => longest_step,
                Along::Jacobian if damped => convert(LONGEST_STEP),
                Along::Jacobian => T::one(),
            };
            let outcome = self.improve(x, aim, (tolerance, longest), prices, workspace);
            if let (Along::Scheduling, Outcome::Moved { step, .. }) = (along, &outcome) {
                // A longer one only after one that was not shortened.
                longest_step = if *step < longest {
                    *step
                } else {
                    (*step * convert(LONGER)).min(T::one())
                };
            }
            if along == Along::Jacobian {
                self.adapt_damping(aim, &outcome);
            }
            match outcome {
                Outcome::NothingToGain { hidden } if along == Along::Jacobian => {
                    if hidden && !damped {
                        // The answer d away is a minimum: the program saves at least d'Hd, so where that
                        // is less than rounding, d is small enough for its states to be the rollout's.
                        copy(&mut self.policy.u, &self.solution.u);
                        copy(&mut self.rollout, &self.solution.x);
                        self.gap = SVector::zeros();
                    }
                    // Damped by more than was measured, a program expects little, whatever there is
                    // to gain.
                    if !damped || failures == 0 {
                        status = Status::Converged;
                    }
                    break;
                }
                Outcome::Moved { step, gain, .. } => {
                    failures = 0;
                    measured = self.policy.damping;
                    status = Status::Improved;
                    let little = if self.problems == 1 {
                        tolerance * convert(FIRST)
                    } else {
                        tolerance
                    };
                    let settled = step >= T::one() && gain <= little;
                    if settled && along == Along::Jacobian && !damped {
                        status = Status::Converged;
                        break;
                    }
                    if settled {
                        along = Along::Jacobian;
                    } else if step < convert(SHORT_STEP) || gain <= tolerance {
                        along = along.other(self.policy.far);
                    }
                }
                Outcome::NothingToGain { .. } | Outcome::NoStep | Outcome::Unsolved(_) => {
                    if let (Outcome::Unsolved(reason), Status::NoImprovement) = (outcome, status) {
                        status = reason;
                    }
                    failures += 1;
                    // Damping makes no program feasible.
                    let infeasible = matches!(self.solution.status, Status::Infeasible(_));
                    if failures >= MOST_FAILURES || infeasible && failures > 1 {
                        break;
                    }
                    self.policy.far &= along == Along::Jacobian;
                    along = along.other(self.policy.far);
                }
            }
        }
        if failures > 0 {
            // What did not help ends with the sample: the next one would expect as little as it leaves to expect.
            self.policy.damping = measured;
        }
        status
    }

    pub(crate) fn solve_program(&mut self, workspace: &mut Workspace<T, NX, NU>) {
        // Along another plan other bounds are active, and to drop one takes longer than to find it.
        let warm_start = match self.problems {
            0 => self.settings.solver.warm_start,
            _ => WarmStart::Cold,
        };
        let settings = SolverSettings {
            warm_start,
            ..self.settings.solver
        };
        workspace
            .solver
            .solve_for_factors(&workspace.ocp, &settings, &mut self.solution);
        self.problems += 1;
        self.take_feedback(workspace);
    }

    /// The plan is followed with the feedback of the last program.
    pub(crate) fn take_feedback(&mut self, workspace: &Workspace<T, NX, NU>) {
        if self.solution.status.is_solved() {
            let factors = workspace.solver.factors();
            for (feedback, factor) in self.policy.feedback.iter_mut().zip(factors) {
                *feedback = factor.feedback;
            }
        }
    }

    /// Moves the plan towards the answer of the last program, by no more than the `longest` step, if that
    /// lowers its merit.
    pub(crate) fn improve<D: PlantByStage<P, T, NX, NU, NS>>(
        &mut self,
        x: &SVector<T, NX>,
        aim: &Aim<'_, T, NX, NU, D>,
        (tolerance, longest): (T, T),
        prices: &mut Prices<T, NX>,
        workspace: &mut Workspace<T, NX, NU>,
    ) -> Outcome<T> {
        let last = self.last_stage();
        let answer = &self.solution;
        if !answer.status.is_solved() {
            return Outcome::Unsolved(answer.status);
        }
        prices.raise(&answer.active);
        let merit = self.merit(aim, *prices);
        let before = merit.of(x, &self.policy.u, &self.rollout);
        let plan = (&*self.policy.u, &*self.rollout);
        let expected = before - merit.of_answer(x, (&answer.u, &answer.x), plan);
        self.gap = at(&self.rollout, last) - at(&answer.x, last);
        self.policy.cost = before;
        // What a full step leaves is of second order; what is less than rounding is nothing. The
        // states are rounded, too, which counts where they are far from zero and close to their aim.
        let size = if D::SOME {
            before + merit.negative(x, &self.policy.u, &self.rollout)
        } else {
            before
        };
        let from_zero = merit.end(&(aim.end() + aim.end())).abs();
        let known_to = (size * (size + from_zero)).sqrt() * convert(ROUNDINGS);
        let rounding = T::default_epsilon() * known_to;
        let least = (tolerance * tolerance * size).max(rounding);
        // Negated, so that a NaN ends the search.
        if !(expected > least) {
            let hidden = least == rounding && expected.abs() <= rounding;
            return Outcome::NothingToGain { hidden };
        }
        let wanted = (expected, longest);
        let taken = self.search_line(x, &merit, wanted, &mut workspace.trial, &|i| {
            let x_i = i.checked_sub(1).map_or(*x, |j| at(&self.solution.x, j));
            (x_i, at(&self.solution.u, i))
        });
        let Some((step, cost)) = taken else {
            return Outcome::NoStep;
        };
        let answer = &self.solution;
        let moves = answer.u.iter().zip(&self.policy.u);
        let moved = moves.take(self.settings.horizon);
        let change = moved.fold(T::zero(), |sum, (to, from)| {
            sum + (to - from).norm_squared()
        });
        // Along the way to its answer, the program's cost falls by a parabola.
        let parabola = step * (T::one() + T::one() - step);
        let shortfall = (cost - before + expected * parabola) / (change * step * step);
        let gain = (before - cost) / size;
        // What a step falls short of that saves next to nothing is the kink of a bound's price rather
        // than curvature: it asks for no more damping.
        let curvature = if gain <= tolerance {
            shortfall.min(self.policy.damping)
        } else {
            shortfall
        };
        self.take_if_some(Some(cost), &workspace.trial);
        self.gap = at(&self.rollout, last) - at(&self.solution.x, last);
        Outcome::Moved {
            step,
            gain,
            curvature,
        }
    }

    /// The curvature that the last step showed, for the next program of the Jacobian; more where there
    /// was no step.
    pub(crate) fn adapt_damping<D: PlantByStage<P, T, NX, NU, NS>>(
        &mut self,
        aim: &Aim<'_, T, NX, NU, D>,
        outcome: &Outcome<T>,
    ) {
        let mut least = self.settings.weights.r.amax();
        if aim.own.any() {
            let stages = 0..self.settings.horizon;
            let weights = stages.filter_map(|i| aim.own.weights(i));
            least = weights.fold(least, |least, weights| least.max(weights.r.amax()));
        }
        let factor: T = convert(DAMPING_FACTOR);
        let before = self.policy.damping;
        let lower = before / factor;
        let terminal = aim.own.terminal().unwrap_or(&self.settings.terminal);
        let equality = matches!(terminal, TerminalIngredient::Equality);
        let damping = match outcome {
            Outcome::NothingToGain { .. } => lower,
            // A full step that the program was good enough for.
            Outcome::Moved { step, .. }
                if *step >= T::one() && (before == T::zero() || equality) =>
            {
                lower
            }
            // Towards a terminal equality the merit falls short by the price of missing it, too, which
            // is no curvature: only short steps ask for more damping.
            Outcome::Moved { step, .. } if equality && *step >= convert(SHORT_STEP) => before,
            Outcome::Moved { .. } if equality => (before * factor).max(least),
            Outcome::Moved { curvature, .. } => curvature.max(lower),
            Outcome::NoStep | Outcome::Unsolved(_) => (before * factor).max(least),
        };
        let sound = damping >= least && damping.is_finite();
        self.policy.damping = if sound { damping } else { T::zero() };
    }

    pub(crate) fn merit<'a, D: CostByStage<T, NX, NU>>(
        &self,
        aim: &'a Aim<'a, T, NX, NU, D>,
        prices: Prices<T, NX>,
    ) -> Merit<'a, T, NX, NU, D> {
        Merit::new(&self.settings, &self.soft, aim, prices)
    }

    /// The plan becomes the answer.
    fn publish(&mut self, status: Status<T>) {
        copy(&mut self.solution.u, &self.policy.u);
        copy(&mut self.solution.x, &self.rollout);
        // The last program's is not that of this plan.
        self.solution.cost = self.policy.cost * convert(0.5);
        self.solution.status = status;
    }

    /// The state is not finite, or nothing that follows from it is.
    pub(crate) fn give_up(&mut self, status: Status<T>) {
        self.reset();
        (self.problems, self.gap) = (0, SVector::zeros());
        self.solution
            .u
            .fill(self.settings.u.project(&SVector::zeros()));
        self.solution.status = status;
    }
}
