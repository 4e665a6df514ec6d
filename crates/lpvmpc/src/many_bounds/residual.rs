//! What a trajectory is missing for a minimum of the program that the sides of the bounds make of the problem.

use super::newton::{gradient, step_back};
use super::side::{BoundSide, Role, are_inputs};
use super::span::Span;
use super::weighted::split_off_mut;
use crate::model::Scalar;
use crate::ocp::Common;
use crate::products::{are_in_vectors, in_vectors};
use crate::riccati::StageFactor;
use crate::rows::{self, Trajectory};
use crate::small_matrix::{largest, product, transposed_product, transposed_times};
use nalgebra::{SVector, convert};

/// What of the terms beside a multiplier is rounding, as a power of the smallest number beside one.
const ROUNDING: f64 = 0.4;

/// What is missing for a minimum.
pub(super) struct Residual<T> {
    /// Largest entry of the Lagrangian's gradient in inputs that are not held.
    pub rest: T,
    /// Largest term of a gradient.
    pub largest: T,
    /// Whether later inputs follow the policies.
    pub followed: bool,
    /// Whether a held side has a multiplier of the wrong sign, or above its price, by more than rounding of the costs
    /// that it stands beside, which may be of other units than the largest term.
    pub contradicted: bool,
}

/// The problem's adjoint recursion on the trajectory, with the multipliers of the sides at their
/// distances: gives every held input its multiplier, and leaves in `slopes` what is left of the gradient in
/// the inputs.
///
/// Where inputs alone are bounded, later ones follow the policies: at a minimum that makes no difference, and
/// otherwise rounding would grow along the horizon as an unstable plant does.
pub(super) fn explain<T: Scalar, const NX: usize, const NU: usize>(
    span: &Span<'_, T, NX, NU>,
    factors: &[StageFactor<T, NX, NU>],
    sides: &mut [BoundSide<T>],
    trajectory: &Trajectory<'_, T, NX, NU>,
    slopes: &mut [SVector<T, NU>],
) -> Residual<T> {
    in_vectors(
        are_in_vectors(NX),
        #[inline(always)]
        || explain_here(span, factors, sides, trajectory, slopes),
    )
}

#[inline(always)]
fn explain_here<T: Scalar, const NX: usize, const NU: usize>(
    span: &Span<'_, T, NX, NU>,
    factors: &[StageFactor<T, NX, NU>],
    sides: &mut [BoundSide<T>],
    trajectory: &Trajectory<'_, T, NX, NU>,
    slopes: &mut [SVector<T, NU>],
) -> Residual<T> {
    let ocp = span.ocp;
    let n = ocp.length();
    let mut residual = Residual {
        rest: T::zero(),
        largest: T::zero(),
        followed: are_inputs(sides),
        contradicted: false,
    };
    let rounding = T::default_epsilon().powf(convert(ROUNDING));
    let of_rows = |side: &mut BoundSide<T>| match side.input() {
        None if side.role != Role::Free => -side.sign * side.multiplier_at(side.distance),
        _ => T::zero(),
    };
    let mut before = sides;
    let end = split_off_mut(&mut before, n);
    let (mut costate, _) = gradient(ocp, end, of_rows);
    end.iter_mut().for_each(|side| side.estimate = side.base);
    let of_cost = ocp.terminal.p * span.state(trajectory, n) + ocp.terminal.linear_x;
    // The sizes of what adds up to the costate, and cancels where the sides decide.
    let mut sizes = costate.abs() + of_cost.abs();
    costate += of_cost;
    let contradicts = |side: &BoundSide<T>, sizes: &SVector<T, NX>, terms: &SVector<T, NU>| {
        let excess = side.excess();
        if !(excess > T::zero()) {
            return false;
        }
        let (x, u) = rows::normal(ocp, &side.bound);
        let of_x = x.iter().zip(sizes.iter());
        let mut beside = of_x.chain(u.iter().zip(terms.iter()));
        beside.any(|(of, size)| (*of * excess).abs() > rounding * *size)
    };
    let none = SVector::zeros();
    residual.contradicted |= end.iter().any(|side| contradicts(side, &sizes, &none));
    let stages = span.stages().zip(span.of(factors));
    for (((i, stage), factor), left) in stages.zip(span.of_mut(slopes)).rev() {
        let here = split_off_mut(&mut before, i);
        let (slope_x, slope_u) = gradient(ocp, here, of_rows);
        let (x, u) = (span.state(trajectory, i), trajectory.u.get(i));
        let u = u.copied().unwrap_or_else(SVector::zeros);
        let Common { q, r, s, .. } = ocp.common_at(i);
        let through = stage.transposed_b_times(&costate);
        let mut slope = product(r, &u) + product(s, x) + stage.linear_u + through + slope_u;
        let terms = stage.transposed_b_sizes(&sizes);
        residual.largest = residual.largest.max(largest(&terms)).max(largest(&slope_u));
        let mut most = T::zero();
        for side in here.iter_mut().filter(|side| side.role == Role::Held) {
            side.estimate = match side.input() {
                None => side.base,
                Some(j) => side.sign * core::mem::replace(&mut slope[j], T::zero()),
            };
            most = most.max(side.excess());
        }
        residual.rest = residual.rest.max(largest(&slope));
        costate = stage.transposed_a_times(&costate)
            + product(q, x)
            + transposed_times(s, &u)
            + stage.linear_x;
        if residual.followed {
            costate += transposed_product(&factor.feedback, &slope);
        }
        sizes = costate.abs() + slope_x.abs();
        if most > T::zero() {
            let terms = terms + slope_u.abs();
            residual.contradicted |= here.iter().any(|side| contradicts(side, &sizes, &terms));
        }
        costate += slope_x;
        *left = slope;
    }
    residual
}

/// Makes of a gradient in the inputs, in `v`, the deviations that take it away. Where later inputs are `followed`, it has
/// what they do already.
pub(super) fn descend<T: Scalar, const NX: usize, const NU: usize>(
    span: &Span<'_, T, NX, NU>,
    factors: &[StageFactor<T, NX, NU>],
    followed: bool,
    v: &mut [SVector<T, NU>],
) {
    in_vectors(
        are_in_vectors(NX),
        #[inline(always)]
        || {
            let mut costate = SVector::zeros();
            let stages = span.stages().zip(span.of(factors)).zip(span.of_mut(v));
            for (((_, stage), factor), v) in stages.rev() {
                if followed {
                    costate = SVector::zeros();
                }
                *v = step_back(stage, factor, v, &mut costate);
            }
        },
    );
}
