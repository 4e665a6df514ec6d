//! The way of the interior-point method to a guess that is right, or to a proof that there is no point within all bounds.

use super::exchange::{Program, Tolerances};
use super::interior_point::{AllUnknowns, Foretold, InteriorPoint, STUCK};
use super::side::{self, BoundSide};
use crate::farkas::list_input_bounds;
use crate::model::Scalar;
use crate::ocp::Ocp;
use crate::solution::{ActiveRow, ActiveSet, Part, Status};
use crate::solver::infeasible;
use nalgebra::convert;

/// The roles that a step foretells are tried when one in so many of the active sides, or fewer, has changed
/// its since the step before;
const CERTAIN: usize = 8;
/// of soft bounds, which have three roles, no more than these in all;
const MOST_CHANGED: usize = 12;
/// and where states and inputs bind each other, so that one that is wrong makes others seem so, when the step leaves no more
/// than these undecided.
const MOST_UNDECIDED: usize = 8;
/// And when that step went so far.
const FREE: f64 = 0.5;
/// Once they were wrong, again when the products of slack and multiplier are this part of what they were,
const NEARER: f64 = 0.01;
/// or, where states and inputs bind each other, when one side is undecided, or has changed its role, for so many then.
const CLEARER: usize = 4;
/// Of a proof that there is no point within all bounds the multipliers above the first of these parts of the largest that
/// are a proof, too.
const LARGEST: [f64; 5] = [0.5, 0.1, 0.01, 1e-3, 1e-5];
/// Where the products of slack and multiplier begin, as a part of the largest cost of a stage: the smaller, the less the
/// sides bind each other. Those of inputs alone,
const CENTRE_OF_INPUTS: f64 = 0.003;
/// of soft bounds, and of states or rows,
const CENTRE: f64 = 0.01;
/// of states and inputs, none of them soft.
const CENTRE_OF_MIXED: f64 = 0.05;

/// The interior-point method, until the roles that it foretells are right, which is tried so many times at most, or
/// its multipliers prove that the problem is infeasible.
pub(super) fn search<T: Scalar, const NX: usize, const NU: usize>(
    program: &mut Program<'_, T, NX, NU>,
    sides: &mut [BoundSide<T>],
    tolerances: &Tolerances<T>,
    mut trials: usize,
    proof: &mut ActiveSet<T>,
    mut count: impl FnMut() -> bool,
) -> Option<Result<(), Status<T>>> {
    let mixed = side::are_mixed(sides);
    let most_changed = match side::any_soft(sides) {
        true => MOST_CHANGED,
        false => usize::MAX,
    };
    let centre = match mixed {
        true => CENTRE_OF_MIXED,
        false if side::are_inputs(sides) => CENTRE_OF_INPUTS,
        false => CENTRE,
    };
    let mut method = InteriorPoint::new(program, sides, tolerances.scale * convert(centre))?;
    let smallest = method.complementarity() * T::default_epsilon().powf(convert(0.6));
    let mut untried = true;
    let mut near_enough = convert(f64::INFINITY);
    let mut doubtful_then = usize::MAX;
    let mut part = T::zero();
    let mut stuck = 0_usize;
    while trials > 0 && count() {
        let Foretold {
            changed,
            active,
            undecided,
        } = method.predict(program).ok()?;
        let doubtful = changed + undecided;
        let clearer = mixed && CLEARER * doubtful <= doubtful_then;
        let near = clearer || method.complementarity() <= near_enough;
        // The same roles, wrong, are as a rule wrong again.
        untried |= changed > 0;
        let settled = CERTAIN * changed <= active && changed <= most_changed;
        // Rounding is about to end the method: then better now than not at all.
        let late = method.complementarity() < smallest;
        let likely = settled && (!mixed || late || undecided <= MOST_UNDECIDED);
        if untried && near && likely && part > convert(FREE) {
            untried = false;
            near_enough = method.complementarity() * convert(NEARER);
            doubtful_then = doubtful;
            trials -= 1;
            if InteriorPoint::try_foretold(program, sides, tolerances, &mut count) {
                return Some(Ok(()));
            }
        }
        part = method.correct(program);
        if part < convert(FREE) && method.complementarity() < smallest {
            // Rounding decides now which of the last few sides hold; the dual method begins with what is foretold.
            let unknowns = &program.unknowns;
            unknowns.visit(sides, |side, known| side.known_role = known.role);
            // The doubt was about those of the last answer.
            proof.doubted = 0;
            return None;
        }
        if part < convert(STUCK) {
            stuck += 1;
            let ended = !(part > convert(1e-6));
            // Where no point satisfies all bounds, multipliers grow until they are a proof of it. To look whether
            // they are takes as long as a step.
            if (ended || stuck.is_power_of_two())
                && let Some(infeasible) = prove(&program.unknowns, program.span.ocp, sides, proof)
            {
                return Some(Err(infeasible));
            }
            if ended {
                return None;
            }
        }
    }
    None
}

/// The verdict that the problem is infeasible, if the multipliers are a `proof`: all that are no rounding, or, so that it
/// names what contradicts each other, the few largest that are one, and the bounds of inputs that it rests on.
fn prove<T: Scalar, const NX: usize, const NU: usize>(
    unknowns: &AllUnknowns<'_, T>,
    ocp: &Ocp<T, NX, NU>,
    sides: &mut [BoundSide<T>],
    proof: &mut ActiveSet<T>,
) -> Option<Status<T>> {
    unknowns.visit(sides, |side, known| side.estimate = known.at.multiplier);
    let all = T::default_epsilon().sqrt();
    let mut of_largest = |share| {
        list_multipliers(sides, share, proof);
        infeasible(ocp, proof)
    };
    of_largest(all)?;
    let few = LARGEST.into_iter().map(convert);
    let verdict = few.chain([all]).find_map(of_largest);
    list_input_bounds(ocp, proof);
    verdict
}

/// Lists the hard bounds of states and rows with the multipliers of the interior-point method, as far as
/// there are places and they are more than a `share` of the largest.
fn list_multipliers<T: Scalar>(sides: &[BoundSide<T>], share: T, list: &mut ActiveSet<T>) {
    list.clear();
    let multipliers = sides.iter().filter(|side| side.may_contradict());
    let multipliers = multipliers.map(|side| (side.bound, side.estimate, side.size));
    // In units of the cost, since multipliers are of as many units as what is bounded.
    let largest = multipliers
        .clone()
        .fold(T::zero(), |most, (_, multiplier, size)| {
            most.max(multiplier * size)
        });
    for (bound, multiplier, size) in multipliers {
        if multiplier * size > largest * share {
            list.push(ActiveRow {
                bound,
                part: Part::Hard,
                multiplier: multiplier / largest,
                exceeded: false,
            });
        }
    }
}
