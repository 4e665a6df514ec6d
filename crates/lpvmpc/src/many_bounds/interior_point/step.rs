//! A Newton step of the interior-point method: a linear-quadratic program in which every bound has a cost.

use super::unknowns::Target;
use super::way::{Foretold, Left, Part, Prediction, Sums};
use crate::many_bounds::exchange::Program;
use crate::many_bounds::newton;
use crate::many_bounds::weighted::split_off_mut;
use crate::model::Scalar;
use crate::products::{are_in_vectors, in_vectors};
use crate::rows::Trajectory;

/// What the step to the trajectory of the policies foretells, and what there is to know of the way there.
pub(super) fn foretell<T: Scalar, const NX: usize, const NU: usize>(
    program: &mut Program<'_, T, NX, NU>,
) -> (Prediction<T>, Foretold) {
    let Program {
        span,
        u,
        x,
        unknowns,
        ..
    } = program;
    let (mut sums, mut foretold) = (Sums::begin(), Foretold::default());
    let bounds = unknowns.bounds_mut();
    newton::for_each_value(span, bounds, &Trajectory { x, u }, |bound, value| {
        bound.foretell(value, &mut sums, &mut foretold);
    });
    (sums.total(), foretold)
}

/// Moves the trajectory to where the products of slack and multiplier come to the `target` of each, which follows from the
/// one that it has; where the first unknown on that way is zero.
pub(super) fn aim<T: Scalar, const NX: usize, const NU: usize>(
    program: &mut Program<'_, T, NX, NU>,
    target: impl Fn(Target<T>) -> Target<T>,
) -> Part<T> {
    let Program {
        span,
        dual,
        factors,
        u,
        x,
        unknowns,
        ..
    } = program;
    let ocp = span.ocp;
    in_vectors(
        are_in_vectors(NX),
        #[inline(always)]
        || {
            let mut before = unknowns.bounds_mut();
            let at_end = split_off_mut(&mut before, ocp.length());
            let (mut costate, _) = newton::gradient(ocp, at_end, |bound| bound.aim(&target));
            let stages = span
                .stages()
                .zip(span.of(factors))
                .zip(span.of_mut(&mut dual.v));
            for (((i, stage), factor), v) in stages.rev() {
                let here = split_off_mut(&mut before, i);
                let (slope_x, slope_u) = newton::gradient(ocp, here, |bound| bound.aim(&target));
                *v = newton::step_back(stage, factor, &slope_u, &mut costate);
                costate += slope_x;
            }
        },
    );
    newton::deviate(span, factors, &dual.v, (u, x), &mut []);
    let mut left = Left::begin();
    let bounds = unknowns.bounds_mut();
    newton::for_each_value(span, bounds, &Trajectory { x, u }, |bound, value| {
        bound.keep_above_zero(value, &mut left);
    });
    left.part()
}
