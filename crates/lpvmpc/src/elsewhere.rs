//! Other valleys of the cost: where a sample's plan is likely to be a dear local minimum, another one is looked for, and
//! the cheaper of the two is taken.
//!
//! A descent stays in the valley in which it begins. Where there is no plan from the sample before, it begins with
//! closed loops of the regulator, all of which are rollouts. Where it has taken long from there, programs along states that
//! do not belong together (direct multiple shooting; Bock and Plitt, A multiple shooting algorithm for direct
//! solution of optimal control problems, IFAC World Congress 1984) may find another valley: their answers close the gaps while
//! the plan is already where it has to go. Later on, each plan begins with the rest of the last one. In the same valley its
//! cost falls by what the sample has cost; where it does not, the regulator's closed loops are candidates again.

use crate::by_stage::PlantByStage;
use crate::controller::Controller;
use crate::hard_bounds::DEAR;
use crate::linearization::{Along, States};
use crate::list::List;
use crate::memory::Capacity;
use crate::model::{LpvModel, Scalar};
use crate::plan::{Aim, Policy, Prices, at};
use crate::policy::input_at;
use crate::settings::TerminalIngredient;
use crate::solution::{ActiveSet, PackedRow, Status};
use crate::workspace::Workspace;
use nalgebra::{SMatrix, SVector, convert};

/// Answers along states apart that are waited for to have a rollout that stays with them.
const MOST_ANSWERS: usize = 20;
/// What each of them closes of the gaps. With the whole, plans of fast unstable plants jump about.
const GAPS_CLOSED: f64 = 0.5;
/// A rollout stays with its answer where it costs at most so many times what the answer says.
const STAYS: f64 = 2.0;
/// A plan has to fall by this part of what the sample before has cost.
const FALLS: f64 = 0.5;
/// Where fewer programs serve, the problem is nearly a convex one, and has one valley.
const FEWEST: usize = 3;
/// After a search in vain the next one has to wait twice as many samples, at most these.
const LONGEST_PAUSE: u8 = 16;

/// The plan that is the cheapest so far, while another one is looked for.
#[derive(Debug, Clone)]
pub(crate) struct Kept<T: 'static, const NX: usize, const NU: usize> {
    policy: Policy<T, NX, NU>,
    rollout: List<SVector<T, NX>>,
    active: ActiveSet<T>,
    gap: SVector<T, NX>,
}

impl<T: Scalar, const NX: usize, const NU: usize> Kept<T, NX, NU> {
    /// Room for a plan.
    pub fn allocate(Capacity { stages, active, .. }: Capacity) -> Self {
        let u = List::repeat(SVector::zeros(), stages);
        Self {
            policy: Policy::new(u, List::repeat(SMatrix::zeros(), stages)),
            rollout: List::repeat(SVector::zeros(), stages),
            active: ActiveSet::new(List::repeat(PackedRow::empty(), active)),
            gap: SVector::zeros(),
        }
    }
}

/// What tells that a plan may have stayed in a dear valley.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Watch<T> {
    /// What state and input of the last sample cost.
    paid: T,
    /// Samples in which no other plan is looked for, and how many they were at first.
    rest: u8,
    pause: u8,
}

impl<T: Scalar> Watch<T> {
    pub fn new() -> Self {
        Self {
            paid: T::zero(),
            rest: 0,
            pause: 0,
        }
    }

    /// After a search.
    fn note(&mut self, success: bool) {
        self.pause = match success {
            true => 0,
            false => (2 * self.pause).clamp(1, LONGEST_PAUSE),
        };
        self.rest = self.pause;
    }
}

/// Where another plan begins.
#[derive(Clone, Copy)]
enum Beginning {
    /// The regulator's closed loops.
    Regulator,
    /// Programs along the present state at all stages.
    Still,
    /// Programs along the straight line to the end of the reference.
    Line,
}

impl<P, T, const NX: usize, const NU: usize, const NS: usize> Controller<P, T, NX, NU, NS>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
{
    /// Whether the plan runs away, so far that what rounds off its states is no longer small beside what matters: the
    /// present state, the reference, and where one sample of anything that acts leads to. A program along it would be one of
    /// another plant.
    pub(crate) fn runs_away<D: PlantByStage<P, T, NX, NU, NS>>(
        &self,
        x: &SVector<T, NX>,
        aim: &Aim<'_, T, NX, NU, D>,
    ) -> bool {
        let plan = self.rollout.iter().take(self.settings.horizon);
        let far = plan.fold(T::zero(), |most, x| most.max(x.amax()));
        let is_small = |size: T| size < far * T::default_epsilon().sqrt();
        let one_sample = |(i, u): (usize, &SVector<T, NU>)| {
            let (model, settings) = (&self.model, &self.settings);
            aim.own.next_state(i, model, settings, x, u).amax()
        };
        is_small(x.amax())
            && (0..=self.settings.horizon).all(|i| is_small(aim.at(i).amax()))
            && (self.policy.u.iter().enumerate())
                .take(self.settings.horizon)
                .all(|acting| is_small(one_sample(acting)))
    }

    /// What was `found` (a status, if there is a plan), or something cheaper; `last` is what the plan of the sample before
    /// cost. Without room for a second plan nothing is looked for.
    #[inline(never)]
    pub(crate) fn look_elsewhere<D: PlantByStage<P, T, NX, NU, NS>>(
        &mut self,
        x: &SVector<T, NX>,
        aim: &Aim<'_, T, NX, NU, D>,
        (last, tolerance): (Option<T>, T),
        (found, prices): (Option<Status<T>>, Prices<T, NX>),
        workspace: &mut Workspace<T, NX, NU>,
    ) -> Option<Status<T>> {
        let Some(mut kept) = workspace.kept.take() else {
            return found;
        };
        let mut best = (found, prices);
        if kept.rollout.len() == self.rollout.len() {
            let programs = self.problems();
            match last {
                None => {
                    self.watch = Watch::new();
                    let is_plan = found.is_some_and(|status| status.is_solved());
                    if !is_plan || programs > self.settings.iterations.most() {
                        for beginning in [Beginning::Line, Beginning::Still] {
                            let problem = (x, aim, tolerance);
                            self.try_another(problem, beginning, &mut best, &mut kept, workspace);
                        }
                    }
                }
                Some(_) if self.watch.rest > 0 => self.watch.rest -= 1,
                Some(last) => {
                    let falls = last - self.policy.cost >= self.watch.paid * convert(FALLS);
                    // What a terminal equality is missed by has another price in each sample.
                    let terminal = aim.own.terminal().unwrap_or(&self.settings.terminal);
                    let priced = matches!(terminal, TerminalIngredient::Cost(_));
                    if found.is_some() && priced && !falls && programs >= FEWEST {
                        let beginning = Beginning::Regulator;
                        let problem = (x, aim, tolerance);
                        let cheaper =
                            self.try_another(problem, beginning, &mut best, &mut kept, workspace);
                        self.watch.note(cheaper);
                    }
                }
            }
            let first = at(&self.policy.u, 0);
            self.watch.paid = self.merit(aim, Prices::none()).stage(0, x, &first);
        }
        workspace.kept = Some(kept);
        best.0
    }

    /// Descends from another beginning. Where that leads to a cheaper plan it becomes the `best`, and `true` is returned.
    fn try_another<D: PlantByStage<P, T, NX, NU, NS>>(
        &mut self,
        (x, aim, tolerance): (&SVector<T, NX>, &Aim<'_, T, NX, NU, D>, T),
        beginning: Beginning,
        best: &mut (Option<Status<T>>, Prices<T, NX>),
        kept: &mut Kept<T, NX, NU>,
        workspace: &mut Workspace<T, NX, NU>,
    ) -> bool {
        let (status, prices) = best;
        let iterations = &self.settings.iterations;
        let (most, along) = match beginning {
            Beginning::Regulator => (iterations.most(), Along::Scheduling),
            Beginning::Still | Beginning::Line => (iterations.first(), Along::Jacobian),
        };
        let most = (self.problems() + most).min(usize::from(u16::MAX));
        self.exchange(kept);
        // Without what the last program had of its own.
        self.pose_hard(aim, workspace);
        let known = status.filter(Status::is_solved);
        let dearest = known.map(|_| kept.policy.cost);
        let begun = match beginning {
            Beginning::Regulator => self.regulate(x, aim, None, workspace).is_some(),
            _ => self.close_gaps((x, aim), beginning, (dearest, most), prices, workspace),
        };
        let begin = (along, most, tolerance);
        let other = begun.then(|| self.search_within_bounds(x, aim, begin, prices, workspace));
        let merit = self.merit(aim, *prices);
        let cost = merit.of(x, &self.policy.u, &self.rollout);
        let before = merit.of(x, &kept.policy.u, &kept.rollout);
        let is_plan = other.is_some_and(|other| other.is_solved());
        // A NaN is not cheaper.
        let better = match (*status, known) {
            (_, Some(_)) => is_plan && before - cost > before.abs() * tolerance,
            (Some(_), None) => is_plan && cost.is_finite(),
            (None, None) => other.is_some() && cost.is_finite(),
        };
        if better {
            *status = other;
            return true;
        }
        self.exchange(kept);
        false
    }

    /// Programs along states apart, which go a part of the way to each answer, until the rollout of an answer stays with it,
    /// or costs less than `dearest`; that rollout is the plan then. `false` where none does before the sample has had
    /// `most` programs.
    fn close_gaps<D: PlantByStage<P, T, NX, NU, NS>>(
        &mut self,
        (x, aim): (&SVector<T, NX>, &Aim<'_, T, NX, NU, D>),
        beginning: Beginning,
        (dearest, most): (Option<T>, usize),
        prices: &mut Prices<T, NX>,
        workspace: &mut Workspace<T, NX, NU>,
    ) -> bool {
        let samples: T = convert(self.settings.horizon as f64);
        let places = self.rollout.iter_mut().zip(self.policy.u.iter_mut());
        for (i, (place, u)) in places.enumerate() {
            let part = match beginning {
                Beginning::Line => convert::<f64, T>((i + 1) as f64) / samples,
                _ => T::zero(),
            };
            *place = x + (aim.end() - x) * part;
            *u = aim.own.u(i, &self.settings.u).project(aim.u_ref(i));
        }
        (self.policy.damping, self.policy.far) = (T::zero(), false);
        for _ in 0..MOST_ANSWERS {
            if self.problems() >= most {
                break;
            }
            self.linearize_plan(x, aim, (Along::Jacobian, States::Apart), workspace);
            self.solve_program(workspace);
            let answer = &self.solution;
            if !answer.status.is_solved() {
                // Gaps are closed sooner than hard bounds are kept.
                if dearest.is_some() || self.soft.is_elastic() {
                    break;
                }
                self.pose_elastic(x, aim, convert(DEAR), workspace);
                continue;
            }
            prices.raise(&answer.active);
            let merit = self.merit(aim, *prices);
            let expected = merit.of(x, &answer.u, &answer.x);
            let stays = expected + expected.abs() * convert(STAYS - 1.0);
            let limit = dearest.map_or(stays, |dearest| stays.max(dearest));
            let cost = self.roll_out_plan(x, &merit, limit, &mut workspace.trial, &|i, x_i| {
                let planned = i.checked_sub(1).map_or(*x, |j| at(&answer.x, j));
                let bounds = aim.own.u(i, &self.settings.u);
                let feedback = at(&self.policy.feedback, i);
                input_at(x_i, (&planned, &at(&answer.u, i)), &feedback, &bounds)
            });
            if cost.is_some() {
                self.take_if_some(cost, &workspace.trial);
                return true;
            }
            let part: T = convert(GAPS_CLOSED);
            for (place, to) in self.policy.u.iter_mut().zip(&answer.u) {
                *place += (to - *place) * part;
            }
            for (place, to) in self.rollout.iter_mut().zip(&answer.x) {
                *place += (to - *place) * part;
            }
        }
        false
    }

    /// The plan and the one that is kept change places.
    fn exchange(&mut self, kept: &mut Kept<T, NX, NU>) {
        core::mem::swap(&mut self.policy, &mut kept.policy);
        core::mem::swap(&mut self.rollout, &mut kept.rollout);
        core::mem::swap(&mut self.solution.active, &mut kept.active);
        core::mem::swap(&mut self.gap, &mut kept.gap);
    }
}
