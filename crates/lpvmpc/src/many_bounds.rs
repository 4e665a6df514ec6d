//! A first phase for many active bounds, of any kind.
//!
//! The dual method takes one bound after the other, each at the price of a pass along the horizon and of
//! all rows before it. Here all of them are guessed at once. A guess comes from the last sample, or from an
//! interior-point method that goes on until it can be told which bounds will be active. The program in
//! which these hold says which of them should not, and which are missing; that takes a few factorisations,
//! however many bounds there are. Where it finds nothing the dual method begins as it would have without it.
//! Where the dual method comes to no end, most of all with few bounds that contradict each other, the
//! interior-point method has a turn after it.

mod exchange;
mod guess;
mod interior_point;
mod last_answer;
mod newton;
mod retries;
mod side;
mod span;

pub(crate) use side::BoundSide;

use crate::cost::cost;
use crate::list::List;
use crate::model::Scalar;
use crate::ocp::Ocp;
use crate::riccati::StageFactor;
use crate::rows::{self, Trajectory};
use crate::solution::{ActiveRow, ActiveSet, Part, Quantity, Solution, Status};
use crate::solver::{Solver, clip_inputs, infeasible, roll_forward, trajectory};
use crate::working_set::{copy, first, first_mut};
use exchange::{Patience, Program, Tolerances, exchange};
use interior_point::{Foretold, InteriorPoint};
use last_answer::{Kind, LastAnswer};
use nalgebra::{SVector, convert};
use retries::AllRetries;
use side::Role;
use span::Span;

/// With so many violated bounds a few factorisations cost less than a pass for each bound.
const MANY: usize = 24;
/// So many where some are soft, which takes more factorisations, or those of a single input are known, with which the
/// dual method begins.
const MORE: usize = 32;
/// So many of several inputs, and states, that were held by the last answer are worth a guess, which is right more often
/// than not.
const FAMILIAR: usize = 20;
/// And so many inputs that the regulator saturates, where there is one of each stage.
const MANY_SATURATED: usize = 8;
/// Of a guess that is to be exchanged, one active side in so many may be wrong, and each must be better than
/// the one before, but for a few that go in circles: from farther away it is a shorter way to begin anew.
const NEAR: Patience = Patience {
    few: 4,
    guesses: 2,
    wrong: 4,
};
/// Of the last sample's inputs and states, held, more where several inputs act together, since no step of the
/// interior-point method is lost for them.
const KNOWN: Patience = Patience {
    few: 2,
    guesses: 2,
    wrong: usize::MAX,
};
/// Saturated inputs may all be wrong.
const FAR: Patience = Patience { few: 1, ..KNOWN };
/// Where fewer bounds were active before than one for so many that are violated, they tell little of what to expect.
const LITTLE: usize = 2;
/// Of a single input a bound that is met keeps others: while a speed stays at its limit only half of what is violated
/// becomes active.
const LITTLE_OF_ONE: usize = 4;
/// So many factorisations for each guess of the interior-point method that is tried.
const TRIAL: usize = 5;
/// Shorter parts of the way mean that bounds may contradict each other.
const STUCK: f64 = 0.1;
/// The roles that a step foretells are tried when one in so many of the active sides, or fewer, has changed
/// its since the step before; of three roles, where bounds are soft, it is harder to foretell the right one.
const CERTAIN: usize = 8;
const CERTAIN_SOFT: usize = 10;
/// And when that step went so far.
const FREE: f64 = 0.5;
/// Once they were wrong, again when the products of slack and multiplier are this part of what they were.
const NEARER: f64 = 0.01;
/// Where the products of slack and multiplier begin, as a part of the largest cost of a stage.
const CENTRE: f64 = 0.01;
/// Factorisations, each as much work as a change of the active set for every state and input.
const MOST_FACTORISATIONS: usize = 24;
/// Where many more bounds are expected than these are for, one for so many, since the dual method would need longer
/// than in proportion,
const BOUNDS: usize = 2;
/// up to so many.
const MOST_FOR_MANY: usize = 60;
/// Part of the changes that there may be, for the dual method has to have enough where this phase has
/// no answer: one in so many.
const SHARE: usize = 4;

/// When it has its turn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Turn {
    /// Before the dual method, if there are many bounds.
    First,
    /// After it has come to no end.
    Last,
}

/// What comes of it.
#[derive(Clone, Copy, Debug)]
pub(crate) enum AtOnce<T> {
    /// It was not tried, and nothing has changed.
    Untried,
    /// The solution, or the proof that there is none.
    Done(Result<(), Status<T>>),
    /// Neither: the trajectory without bounds is in the solution, and the active rows are those to begin with: of a guess
    /// that was nearly right, or else of the last solution at their new stages, if they are to be begun with.
    InVain,
}

/// The least cap with which a problem with so many `entries` of state and input has a last turn.
pub(crate) fn cap_with_last_turn(entries: usize) -> usize {
    SHARE * MOST_FACTORISATIONS * entries
}

/// Changes of the active set that are kept back for the last turn of a problem with so many `entries` of state and
/// input, out of a `cap` for all: none where the dual method would lack them.
pub(crate) fn work_of_last_turn(cap: usize, entries: usize) -> usize {
    let work = MOST_FACTORISATIONS * entries;
    if work <= cap / SHARE { work } else { 0 }
}

/// Memory of the phase, beside the step that knows it: a solver without it has no machine code for it.
#[derive(Debug)]
#[cfg_attr(feature = "alloc", derive(Clone))]
pub(crate) struct ManyBounds<T: 'static, const NX: usize, const NU: usize> {
    /// Where a Newton step is kept while a guess is tried, and where the guess is.
    places: [ManyBoundsPlace<T, NX, NU>; 2],
    sides: List<BoundSide<T>>,
    retries: AllRetries,
    pub run: Run<T, NX, NU>,
    /// Takes down the last answer, before it is overwritten.
    pub keep: fn(&mut Self, &Solution<T, NX, NU>),
}

/// Places for the factors of the problem with the sides' costs, and for a trajectory.
#[derive(Debug)]
#[cfg_attr(feature = "alloc", derive(Clone))]
pub(crate) struct ManyBoundsPlace<T: 'static, const NX: usize, const NU: usize> {
    pub factors: List<StageFactor<T, NX, NU>>,
    pub u: List<SVector<T, NU>>,
    pub x: List<SVector<T, NX>>,
}

impl<T, const NX: usize, const NU: usize> ManyBoundsPlace<T, NX, NU> {
    pub fn empty() -> Self {
        Self {
            factors: List::empty(),
            u: List::empty(),
            x: List::empty(),
        }
    }

    /// The longest horizon that there is room for.
    fn stages(&self) -> usize {
        self.factors.len().min(self.u.len()).min(self.x.len())
    }
}

/// Solves the problem, or proves that it is infeasible; counts changes of the active set. The first turn begins with
/// the trajectory without bounds in the solution, and where the active rows of the last one are to be begun with,
/// they are so many stages later.
type Run<T, const NX: usize, const NU: usize> = fn(
    &mut ManyBounds<T, NX, NU>,
    &mut Solver<T, NX, NU>,
    &Ocp<T, NX, NU>,
    Option<usize>,
    &mut Solution<T, NX, NU>,
    (Turn, &mut usize),
) -> AtOnce<T>;

impl<T: Scalar, const NX: usize, const NU: usize> ManyBounds<T, NX, NU> {
    pub fn new(places: [ManyBoundsPlace<T, NX, NU>; 2], sides: List<BoundSide<T>>) -> Self {
        Self {
            places,
            sides,
            retries: AllRetries::default(),
            run: Self::solve,
            keep: Self::keep_states,
        }
    }

    /// The states of the last answer, if bounds are active in it, as long as nothing else needs the place.
    fn keep_states(&mut self, last: &Solution<T, NX, NU>) {
        if !last.active.is_empty() {
            let [place, _] = &mut self.places;
            copy(&mut place.x, &last.x);
        }
    }

    fn solve(
        &mut self,
        solver: &mut Solver<T, NX, NU>,
        ocp: &Ocp<T, NX, NU>,
        shift: Option<usize>,
        solution: &mut Solution<T, NX, NU>,
        (turn, spent): (Turn, &mut usize),
    ) -> AtOnce<T> {
        let n = ocp.length();
        let fits = self.places.iter().all(|place| n <= place.stages());
        if !fits || ocp.terminal.equality.is_some() {
            return AtOnce::Untried;
        }
        let last_turn = turn == Turn::Last;
        if !last_turn && shift.is_none() {
            // Without an answer to go on from, nothing is known of the solves before.
            self.retries = AllRetries::default();
        }
        if last_turn {
            // Held inputs may have left factors of their own.
            solver.dual.begin_again();
            let begun = solver.factorize(ocp);
            if begun.and_then(|()| solver.roll_out(ocp, solution)).is_err() {
                return AtOnce::Untried;
            }
        }
        let known = shift.map_or(0, |_| solution.active.len());
        let (mut violated, mut inputs) = (0, 0);
        let mut enough = if NU == 1 && known > 0 { MORE } else { MANY };
        rows::violated_bounds(ocp, &trajectory(solution), &mut |candidate| {
            violated += 1;
            inputs += usize::from(matches!(candidate.bound.quantity, Quantity::Input(_)));
            if candidate.soft.is_some() {
                enough = MORE;
            }
        });
        // Those that the regulator saturates are nearly right where a single input moves the states.
        let saturated = !last_turn
            && NU == 1
            && 2 * inputs > violated
            && inputs >= MANY_SATURATED
            && self.retries.saturations.are_due();
        // Where several inputs act together, general rows that were active are taken over one by one in less time.
        let rows = NU > 1 && guess::mostly_rows(&solution.active);
        // As a rule most of those that are known hold again, and others are violated only as long as they do not.
        let little = if NU == 1 { LITTLE_OF_ONE } else { LITTLE };
        let tells = !rows && little * known >= violated;
        // No more can hold independently than there are inputs.
        let expected = if tells { known } else { violated }.min(n * NU);
        let many = last_turn || expected >= enough;
        let familiar = tells && enough == MANY && known >= FAMILIAR;
        if !(many || familiar || saturated) {
            return AtOnce::Untried;
        }
        let is_turn = last_turn || saturated || self.retries.turns.are_due();
        if !is_turn {
            return AtOnce::Untried;
        }
        let Some(count) = side::collect(ocp, &mut self.sides) else {
            return AtOnce::Untried;
        };
        let sides = first_mut(&mut self.sides, count);
        let whole = Span::whole(ocp);
        newton::measure(&whole, sides, &trajectory(solution));
        let scale = largest_cost(ocp, solution);
        let tolerances = Tolerances {
            violation: solver.dual.tolerance,
            scale,
            penalty: scale * T::default_epsilon().powf(convert(-0.45)),
        };
        let factorisations = match turn {
            Turn::First => (expected / BOUNDS).clamp(MOST_FACTORISATIONS, MOST_FOR_MANY),
            Turn::Last => MOST_FACTORISATIONS,
        };
        let trials = factorisations.div_ceil(TRIAL);
        let work = factorisations * (NX + NU);
        let cap = match turn {
            Turn::First => work.min(solver.dual.changes_left() / SHARE),
            Turn::Last => *spent + work,
        };
        let (before, mut factorised) = (*spent, 0);
        let mut count = |stages: usize| {
            let with_these = before + ((NX + NU) * (factorised + stages)).div_ceil(n);
            let allowed = with_these <= cap;
            if allowed {
                (factorised, *spent) = (factorised + stages, with_these);
            }
            allowed
        };
        let [place, spare] = &mut self.places;
        let mut program = Program {
            span: whole,
            v: &mut solver.dual.v,
            factors: &mut place.factors,
            u: &mut place.u,
            x: &mut place.x,
            spare: (&mut spare.factors, &mut spare.u, &mut spare.x),
        };
        let mut found = false;
        if let Some(shift) = shift.filter(|_| known > 0) {
            guess::again(sides, &solution.active, shift);
            if (many || familiar) && self.retries.repeats.are_due() {
                let last = LastAnswer {
                    kind: match (rows, NU > 1 && side::any_soft(sides)) {
                        (true, _) => Kind::Rows,
                        (false, true) => Kind::Soft,
                        (false, false) => Kind::Simple,
                    },
                    shift,
                    trials,
                };
                let factors = &solver.factors;
                let proof = &mut solution.active;
                found = last.repeat(&mut program, sides, &tolerances, factors, proof, &mut count);
                self.retries.repeats.learn(found);
            }
        }
        if !found && saturated {
            sides.iter_mut().for_each(|side| side.role = Role::Free);
            guess::saturated(ocp, &solver.factors, sides, (0, ocp.x0));
            found = exchange(&mut program, sides, &tolerances, FAR, || count(n));
            self.retries.saturations.learn(found);
        }
        let outcome = if found {
            Some(Ok(()))
        } else if !many {
            None
        } else {
            newton::measure(&whole, sides, &trajectory(solution));
            let proof = &mut solution.active;
            search(&mut program, sides, &tolerances, trials, proof, || count(n))
        };
        let outcome = match outcome {
            Some(Ok(())) => {
                self.retries.repeats.learn_wrong(guess::wrong(sides));
                report(&program, sides, solution).then_some(Ok(()))
            }
            other => other,
        };
        if !last_turn && !saturated {
            // Of a single input the dual method needs a change for each bound, half as many more for soft ones.
            let most = match (NU > 1, enough == MORE && side::any_soft(sides)) {
                (true, _) => usize::MAX,
                (false, true) => expected + expected / 2,
                (false, false) => expected,
            };
            self.retries
                .turns
                .learn(outcome.is_some() && *spent - before <= most);
        }
        solver.dual.v.fill(SVector::zeros());
        if let Some(outcome) = outcome {
            return AtOnce::Done(outcome);
        }
        let left = solver.dual.changes_left().saturating_sub(*spent);
        solver.dual.reset(solver.dual.tolerance, left);
        // What it was made from was finite.
        solver.roll_out(ocp, solution).ok();
        guess::nearest(sides);
        list(sides, &mut solution.active);
        AtOnce::InVain
    }
}

/// The interior-point method, until the roles that it foretells are right, which is tried so many times at most, or
/// its multipliers prove that the problem is infeasible.
fn search<T: Scalar, const NX: usize, const NU: usize>(
    program: &mut Program<'_, T, NX, NU>,
    sides: &mut [BoundSide<T>],
    tolerances: &Tolerances<T>,
    mut trials: usize,
    proof: &mut ActiveSet<T>,
    mut count: impl FnMut() -> bool,
) -> Option<Result<(), Status<T>>> {
    let span = program.span;
    let certain = match side::any_soft(sides) {
        true => CERTAIN_SOFT,
        false => CERTAIN,
    };
    let mut method = InteriorPoint::new(sides, tolerances.scale * convert(CENTRE));
    let smallest = method.complementarity() * T::default_epsilon().powf(convert(0.6));
    let mut near_enough = convert(f64::INFINITY);
    let mut part = T::zero();
    let mut stuck = 0_usize;
    while trials > 0 && count() {
        let predicted = method.predict(&span, sides, program.factors, (program.u, program.x));
        let Foretold { changed, active } = predicted.ok()?;
        let near = method.complementarity() <= near_enough;
        if near && part > convert(FREE) && certain * changed <= active {
            near_enough = method.complementarity() * convert(NEARER);
            trials -= 1;
            if method.try_foretold(program, sides, tolerances, &mut count) {
                return Some(Ok(()));
            }
        }
        part = method.correct(
            &span,
            sides,
            program.factors,
            program.v,
            (program.u, program.x),
        );
        if part < convert(FREE) && method.complementarity() < smallest {
            // Rounding decides now.
            return None;
        }
        if part < convert(STUCK) {
            stuck += 1;
            let ended = !(part > convert(1e-6));
            // Where no point satisfies all bounds, multipliers grow until they are a proof of it. To look whether
            // they are takes as long as a step.
            if ended || stuck.is_power_of_two() {
                list_multipliers(sides, proof);
                if let Some(infeasible) = infeasible(span.ocp, proof) {
                    return Some(Err(infeasible));
                }
            }
            if ended {
                return None;
            }
        }
    }
    None
}

/// Lists the hard bounds of states and rows with the multipliers of the interior-point method, as far as
/// there are places and they count.
fn list_multipliers<T: Scalar>(sides: &[BoundSide<T>], list: &mut ActiveSet<T>) {
    list.clear();
    let decide = |side: &&BoundSide<T>| side.input().is_none() && side.soft.is_none();
    let multipliers = sides.iter().filter(decide);
    let multipliers = multipliers.map(|side| (side.bound, side.interior.multiplier));
    let largest = multipliers
        .clone()
        .fold(T::zero(), |most, (_, multiplier)| most.max(multiplier));
    for (bound, multiplier) in multipliers {
        if multiplier > largest * T::default_epsilon().sqrt() {
            list.push(ActiveRow {
                bound,
                part: Part::Hard,
                multiplier: multiplier / largest,
                exceeded: false,
            });
        }
    }
}

/// The answer of the last guess becomes the solution; `false` where it has no place for all active rows.
fn report<T: Scalar, const NX: usize, const NU: usize>(
    program: &Program<'_, T, NX, NU>,
    sides: &[BoundSide<T>],
    solution: &mut Solution<T, NX, NU>,
) -> bool {
    let ocp = program.span.ocp;
    let n = ocp.length();
    let listed = list(sides, &mut solution.active);
    copy(first_mut(&mut solution.u, n), program.u);
    copy(first_mut(&mut solution.x, n), program.x);
    // As a rule nothing moves, and the states stay what they are.
    clip_inputs(ocp, solution);
    if first(&solution.u, n) != first(program.u, n) {
        roll_forward(ocp, solution);
    }
    solution.cost = cost(ocp, solution);
    listed && solution.cost.is_finite()
}

/// Lists the rows that are active in the answer.
fn list<T: Scalar>(sides: &[BoundSide<T>], active: &mut ActiveSet<T>) -> bool {
    active.clear();
    sides.iter().all(|side| {
        let row = |part, multiplier, exceeded| ActiveRow {
            bound: side.bound,
            part,
            multiplier,
            exceeded,
        };
        match (side.role, side.soft) {
            (Role::Free, _) | (Role::Exceeded, None) => true,
            (Role::Held, soft) => {
                let part = soft.map_or(Part::Hard, |_| Part::Linear);
                active.push(row(part, side.estimate.max(T::zero()), false))
            }
            (Role::Exceeded, Some(price)) => {
                let linear =
                    price.linear <= T::zero() || active.push(row(Part::Linear, price.linear, true));
                let excess = (-side.distance).max(T::zero());
                linear
                    && (price.quadratic <= T::zero()
                        || active.push(row(Part::Quadratic, price.quadratic * excess, false)))
            }
        }
    })
}

/// The largest cost of a stage on the trajectory without bounds, in magnitudes: the size that multiplied
/// distances have.
fn largest_cost<T: Scalar, const NX: usize, const NU: usize>(
    ocp: &Ocp<T, NX, NU>,
    solution: &Solution<T, NX, NU>,
) -> T {
    let of =
        |weight: T, value: T, linear: T| value.abs() * (weight.abs() * value.abs() + linear.abs());
    let mut largest = T::zero();
    let Trajectory { x, u } = trajectory(solution);
    let mut state = &ocp.x0;
    for (i, ((stage, u), next)) in ocp
        .stages
        .iter()
        .zip(u)
        .zip(x)
        .enumerate()
        .take(ocp.length())
    {
        let common = ocp.common_at(i);
        let mut sum = T::zero();
        for j in 0..NX {
            sum += of(common.q[(j, j)], state[j], stage.linear_x[j]);
        }
        for j in 0..NU {
            sum += of(common.r[(j, j)], u[j], stage.linear_u[j]);
        }
        largest = largest.max(sum);
        state = next;
    }
    let mut sum = T::zero();
    for j in 0..NX {
        sum += of(ocp.terminal.p[(j, j)], state[j], ocp.terminal.linear_x[j]);
    }
    largest.max(sum)
}
