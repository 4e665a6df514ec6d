//! The primal-dual active set: the program in which the sides of a guess hold with equality, and the guess
//! that follows from its answer; a semismooth Newton method (Hintermueller, Ito and Kunisch 2002).
//!
//! Held inputs are constants of the factorisation. Held states and rows are an augmented Lagrangian: a
//! large weight on their distance, and multipliers that take up what it leaves. The same passes that find
//! the multipliers remove what rounding has left in the optimality conditions.

use super::complete::complete;
use super::guess;
use super::interior_point::AllUnknowns;
use super::is_large;
use super::newton;
use super::residual::{self, Residual};
use super::roles::{
    first_change, keep_first_changes, keep_last_changes, keep_worst_change, reassign, release_unmet,
};
use super::side::{self, BoundSide, Role};
use super::span::Span;
use crate::active_set::DualActiveSet;
use crate::model::Scalar;
use crate::ocp::Ocp;
use crate::riccati::StageFactor;
use crate::rows::Trajectory;
use crate::small_matrix::{largest, product};
use core::cell::Cell;
use core::mem::swap;
use nalgebra::{SVector, convert};

/// Passes that refine an answer.
const REFINEMENTS: usize = 40;
/// Held sides come nearer when what is left of their distances is at most this part.
const COMES_NEARER: f64 = 0.8;
/// They stand when it is this part.
const STANDS: f64 = 0.99;
/// Held sides come nearer in one mode where this part of their ratio from pass to pass is all that it changes by.
const SAME_RATIO: f64 = 0.02;
/// With so many wrong sides a guess is nearly right, and worth a closer look.
const NEARLY_RIGHT: usize = 8;
/// One that is right but for what is smaller than a loose tolerance is exchanged so many times more often.
const MORE_GUESSES: usize = 4;
/// A guess of a large plant is completed so many times.
const COMPLETIONS: usize = 6;
/// A guess with more wrong sides than so many times the fewest before has gone astray.
const WORSE: usize = 3;
/// Distances of held sides that are rounding, in units of the smallest number beside one.
const ROUNDING: f64 = 8.0;

/// Numbers that the search goes by.
#[derive(Clone, Copy)]
pub(super) struct Tolerances<T> {
    /// Relative violation that counts as none.
    pub violation: T,
    /// The size of a stage's cost.
    pub scale: T,
    /// Weight of the distance of a side that is held, in cost per square of its size.
    pub penalty: T,
}

impl<T: Scalar> Tolerances<T> {
    /// For a problem whose trajectory without bounds is known, and the relative violation that counts as none.
    pub fn new<const NX: usize, const NU: usize>(
        ocp: &Ocp<T, NX, NU>,
        trajectory: &Trajectory<'_, T, NX, NU>,
        violation: T,
    ) -> Self {
        let scale = largest_cost(ocp, trajectory);
        Self {
            violation,
            scale,
            penalty: scale * T::default_epsilon().powf(convert(-0.45)),
        }
    }
}

/// The largest cost of a stage on the trajectory without bounds, in magnitudes: the size that multiplied
/// distances have.
fn largest_cost<T: Scalar, const NX: usize, const NU: usize>(
    ocp: &Ocp<T, NX, NU>,
    trajectory: &Trajectory<'_, T, NX, NU>,
) -> T {
    let of =
        |weight: T, value: T, linear: T| value.abs() * (weight.abs() * value.abs() + linear.abs());
    let mut largest = T::zero();
    let Trajectory { x, u } = *trajectory;
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

/// What the search works on.
pub(super) struct Program<'a, T: 'static, const NX: usize, const NU: usize> {
    pub span: Span<'a, T, NX, NU>,
    /// Completes guesses, for which it is at its start; in between `v` is scratch memory.
    pub dual: &'a mut DualActiveSet<T, NU>,
    /// Changes of the active set so far,
    pub spent: &'a Cell<usize>,
    /// and how many there may be when a guess has been completed.
    pub most_spent: usize,
    pub factors: &'a mut [StageFactor<T, NX, NU>],
    pub u: &'a mut [SVector<T, NU>],
    pub x: &'a mut [SVector<T, NX>],
    /// Other places for factors and trajectory.
    pub spare: Places<'a, T, NX, NU>,
    /// Of the interior-point method.
    pub unknowns: AllUnknowns<'a, T>,
}

impl<T, const NX: usize, const NU: usize> Program<'_, T, NX, NU> {
    /// Goes on in the other places, so that what is in these is kept.
    pub fn change_places(&mut self) {
        let (factors, u, x) = &mut self.spare;
        swap(&mut self.factors, factors);
        swap(&mut self.u, u);
        swap(&mut self.x, x);
    }
}

/// Places for the factors of a program, its inputs and its states.
pub(super) type Places<'a, T, const NX: usize, const NU: usize> = (
    &'a mut [StageFactor<T, NX, NU>],
    &'a mut [SVector<T, NU>],
    &'a mut [SVector<T, NX>],
);

/// How long a guess is exchanged.
#[derive(Clone, Copy)]
pub(super) struct Patience {
    /// One active side in so many may be wrong at first.
    pub few: usize,
    /// So many guesses may be hardly better than the one before, or worse,
    pub guesses: usize,
    /// as long as no more sides than these are wrong.
    pub wrong: usize,
    /// From one that is nearly right, so many exchanges of one stage alone, as long as none leaves more sides wrong than the
    /// one before: where states and inputs that are held bind each other, what is wrong at later stages may follow from
    /// what is wrong at the first of them.
    pub steps: usize,
}

impl Patience {
    /// Of a guess that is to be exchanged, one active side in so many may be wrong, and each must be better than
    /// the one before, but for a few that go in circles: from farther away it is a shorter way to begin anew.
    pub const NEAR: Self = Self {
        few: 4,
        guesses: 2,
        wrong: 4,
        steps: 0,
    };
    /// Of the last sample's inputs and states where these bind each other.
    pub const BINDING: Self = Self {
        guesses: 0,
        steps: 6,
        ..Self::NEAR
    };
    /// Of the last sample's inputs and states, held, more where several inputs act together, since no step of the
    /// interior-point method is lost for them.
    pub const KNOWN: Self = Self {
        few: 2,
        guesses: 7,
        wrong: usize::MAX,
        steps: 0,
    };
    /// The same of soft bounds, of whose three roles more are wrong.
    pub const SOFT: Self = Self {
        guesses: 4,
        ..Self::KNOWN
    };
    /// Saturated inputs may all be wrong.
    pub const FAR: Self = Self {
        few: 1,
        guesses: 4,
        ..Self::KNOWN
    };
}

/// Exchanges sides until the guess is right, whose trajectory and multipliers (`estimate`) then are the
/// answer; `false` if that is not found. `count` is asked before every factorisation.
pub(super) fn exchange<T: Scalar, const NX: usize, const NU: usize>(
    program: &mut Program<'_, T, NX, NU>,
    sides: &mut [BoundSide<T>],
    tolerances: &Tolerances<T>,
    mut patience: Patience,
    mut count: impl FnMut() -> bool,
) -> bool {
    let active = sides.iter().filter(|side| side.role != Role::Free).count();
    let mut most = (active / patience.few).max(2);
    let (mut last, mut fewest) = (usize::MAX, usize::MAX);
    let closely = side::are_mixed(sides);
    let (mut nearly, mut one_by_one) = (false, false);
    let completed = is_large::<NX, NU>() && closely;
    let mut completions = if completed { COMPLETIONS } else { 0 };
    // Of soft bounds the multipliers decide whether they hold or are exceeded. And rounding may have grown along the
    // horizon until what follows from a trajectory as it is goes in circles.
    let mut careful = side::any_soft(sides);
    // Once, since what has to be held again would be let go again.
    let mut released = false;
    let loose: T = convert(1e-6);
    let mut loose = tolerances.violation.max(loose);
    while count() {
        for side in sides.iter_mut() {
            (side.base, side.weight) = match side.role {
                Role::Free => (T::zero(), T::zero()),
                Role::Held if side.input().is_some() => (T::zero(), T::zero()),
                Role::Held => (side.estimate, tolerances.penalty / (side.size * side.size)),
                Role::Exceeded => (side.price(), side.curvature()),
            };
        }
        if newton::factorize(&program.span, sides, program.factors).is_err() {
            return false;
        }
        newton::roll_out(&program.span, program.factors, &[], (program.u, program.x));
        measure(program, sides, rounding());
        for side in sides.iter_mut().filter(|side| side.is_weighted()) {
            side.base = side.multiplier_at(side.distance);
        }
        let mut residual = explain(program, sides);
        if careful && residual.rest > loose * residual.largest {
            refine(program, sides, &mut residual, tolerances, (loose, loose));
        }
        let mut wrong = reassign(sides, loose, loose * residual.largest);
        let misses = |side: &BoundSide<T>| side.role == Role::Held && side.last_role == Role::Free;
        if completions > 0 && !one_by_one && wrong < NX + NU && sides.iter().any(misses) {
            if complete(program, sides, loose) {
                completions -= 1;
                (last, fewest) = (wrong, fewest.min(wrong));
                continue;
            }
            completions = 0;
            residual = explain(program, sides);
            wrong = reassign(sides, loose, loose * residual.largest);
        }
        let unexplained = residual.rest > loose * residual.largest;
        if closely && !careful && unexplained && (1..=NEARLY_RIGHT).contains(&wrong) {
            // What is as near may be right, and its multipliers not yet.
            keep_last_changes(sides, 0);
            refine(program, sides, &mut residual, tolerances, (loose, loose));
            wrong = reassign(sides, loose, loose * residual.largest);
        }
        if wrong == 0 {
            let to_rounding = (T::default_epsilon() * convert(16.0), tolerances.violation);
            let near = refine(program, sides, &mut residual, tolerances, to_rounding);
            wrong = reassign(
                sides,
                tolerances.violation,
                tolerances.violation * residual.largest,
            );
            if wrong == 0 && !near && !released {
                wrong = release_unmet(sides, tolerances.violation);
                released = true;
            }
            if wrong == 0 {
                // Those that the residual is judged with: a weight makes much of a distance that is hardly more than
                // rounding.
                for side in sides.iter_mut().filter(|side| side.is_weighted()) {
                    side.estimate = side.multiplier_at(side.distance);
                }
                return near
                    && !residual.contradicted
                    && is_of_the_plant(program, tolerances.violation);
            }
            if loose > tolerances.violation {
                // What is left to exchange is too small for a loose look, which would find it right again.
                (loose, careful) = (tolerances.violation, true);
                patience.guesses += MORE_GUESSES;
                most = most.max(wrong);
            }
        }
        if one_by_one {
            if wrong > last || patience.steps == 0 {
                break;
            }
            last = wrong;
            patience.steps -= 1;
            keep_first_changes(sides);
            continue;
        }
        let much_worse = wrong / WORSE > fewest;
        fewest = fewest.min(wrong);
        // A guess from near by is right after a few exchanges, each of which leaves fewer sides wrong.
        if wrong <= most {
            most = wrong - wrong / 4;
        } else if last < usize::MAX
            && patience.guesses > 0
            && wrong <= patience.wrong
            && !much_worse
        {
            patience.guesses -= 1;
        } else if nearly {
            (one_by_one, last) = (true, wrong);
            guess::nearest(sides);
            continue;
        } else {
            break;
        }
        if wrong >= last {
            // Exchanged at once sides may go in circles, and those towards the end of the horizon do not wait for what
            // comes of the others.
            if careful {
                keep_worst_change(sides);
            } else {
                keep_last_changes(sides, wrong.div_ceil(2));
            }
        }
        careful |= wrong >= last;
        last = wrong;
        if wrong <= NEARLY_RIGHT && patience.steps > 0 {
            nearly = true;
            let first = first_change(sides);
            for side in sides.iter_mut() {
                side.nearest_role = match Some(side.bound.stage) == first {
                    true => side.role,
                    false => side.last_role,
                };
            }
        }
    }
    false
}

/// Whether the trajectory is one of the plant, and so of numbers: of others no comparison says that a side is wrong.
/// Refining adds up its changes; where some were many times larger than what is left, the states no longer follow from
/// the inputs.
fn is_of_the_plant<T: Scalar, const NX: usize, const NU: usize>(
    program: &Program<'_, T, NX, NU>,
    tolerance: T,
) -> bool {
    let span = &program.span;
    let inputs = span.of(program.u).iter();
    let mut state = &span.start;
    span.stages()
        .zip(inputs.zip(span.of(program.x)))
        .all(|((_, stage), (u, x))| {
            let terms = [product(&stage.a, state), product(&stage.b, u), stage.c, -*x];
            let size = terms
                .iter()
                .fold(T::zero(), |sum, term| sum + largest(term));
            let rest = terms.iter().fold(SVector::zeros(), |sum, term| sum + term);
            state = x;
            size.is_finite() && rest.iter().all(|entry| entry.abs() <= tolerance * size)
        })
}

pub(super) fn rounding<T: Scalar>() -> T {
    T::default_epsilon() * convert(ROUNDING)
}

/// Measures the sides on the trajectory. Of what is held, `rounding` is no distance: the weight would make
/// much of it.
pub(super) fn measure<T: Scalar, const NX: usize, const NU: usize>(
    program: &Program<'_, T, NX, NU>,
    sides: &mut [BoundSide<T>],
    rounding: T,
) {
    let trajectory = Trajectory {
        x: program.x,
        u: program.u,
    };
    newton::measure(&program.span, sides, &trajectory);
    drop_rounding(sides, rounding);
}

fn drop_rounding<T: Scalar>(sides: &mut [BoundSide<T>], rounding: T) {
    for side in sides.iter_mut().filter(|side| side.role == Role::Held) {
        if side.distance.abs() <= rounding * side.size {
            side.distance = T::zero();
        }
    }
}

fn explain<T: Scalar, const NX: usize, const NU: usize>(
    program: &mut Program<'_, T, NX, NU>,
    sides: &mut [BoundSide<T>],
) -> Residual<T> {
    let trajectory = Trajectory {
        x: program.x,
        u: program.u,
    };
    residual::explain(
        &program.span,
        program.factors,
        sides,
        &trajectory,
        &mut program.dual.v,
    )
}

/// Moves to the minimum with the sides as they are, until what is left is `enough` or does not shrink, from a point
/// whose `residual` is known; whether it is within the `tolerance`.
///
/// Held sides come nearer from pass to pass, and until they have come to rest the gradient is not zero. A side that no
/// input moves stays where it is: of so small a distance the weight makes more and more, until it counts as rounding.
/// After a pass or two the slowest mode is left, in which all distances shrink by the same ratio: what the multipliers would
/// take up in all further passes is added at once (Aitken's extrapolation).
fn refine<T: Scalar, const NX: usize, const NU: usize>(
    program: &mut Program<'_, T, NX, NU>,
    sides: &mut [BoundSide<T>],
    residual: &mut Residual<T>,
    tolerances: &Tolerances<T>,
    (enough, tolerance): (T, T),
) -> bool {
    let infinity: T = convert(f64::INFINITY);
    let (mut least, mut last_missed, mut last_ratio) = (infinity, infinity, T::zero());
    let mut stalled = false;
    let mut rounding = rounding::<T>();
    let mut waits = true;
    let mut left = REFINEMENTS;
    let mut missed = farthest(sides);
    loop {
        let unexplained = residual.rest / residual.largest.max(T::default_epsilon());
        let worst = missed.max(unexplained);
        if worst <= enough || left == 0 {
            return worst <= tolerance;
        }
        let half: T = convert(0.5);
        let shrinks = worst < least * half || missed < last_missed * convert(COMES_NEARER);
        // Rounding may hide what one pass has done, not what two have; where it is enough that does not matter, nor where all that
        // is left is a distance that does not change.
        let stands = unexplained <= enough && missed >= last_missed * convert(STANDS);
        let at_rest = stands || (!shrinks && (stalled || worst <= tolerance));
        if at_rest {
            let may_be_rounding = missed > T::zero() && missed <= tolerances.violation;
            if !(waits && may_be_rounding) {
                return worst <= tolerance;
            }
            waits = false;
            rounding = rounding.max(missed * convert(2.0));
            drop_rounding(sides, rounding);
        }
        stalled = !shrinks && !at_rest;
        (least, last_missed) = (least.min(worst), missed);
        left -= 1;
        let trajectory = (&mut *program.u, &mut *program.x);
        residual::descend(
            &program.span,
            program.factors,
            residual.followed,
            &mut program.dual.v,
        );
        newton::deviate(
            &program.span,
            program.factors,
            &program.dual.v,
            trajectory,
            sides,
        );
        measure(program, sides, rounding);
        missed = farthest(sides);
        let ratio = missed / last_missed;
        let same = (ratio - last_ratio).abs() <= ratio * convert(SAME_RATIO);
        last_ratio = ratio;
        if same && ratio <= convert(COMES_NEARER) {
            take_up_rest(sides, ratio);
            last_ratio = T::zero();
        }
        *residual = explain(program, sides);
    }
}

/// The largest relative distance of a side that is held.
fn farthest<T: Scalar>(sides: &[BoundSide<T>]) -> T {
    let held = sides.iter().filter(|side| side.role == Role::Held);
    held.fold(T::zero(), |most, side| {
        most.max(side.distance.abs() / side.size)
    })
}

/// What the multipliers of held sides will take up while their distances shrink by this ratio from pass to pass.
fn take_up_rest<T: Scalar>(sides: &mut [BoundSide<T>], ratio: T) {
    let rest = ratio / (T::one() - ratio);
    for side in sides.iter_mut().filter(|side| side.is_weighted()) {
        side.base -= side.weight * side.distance * rest;
    }
}
