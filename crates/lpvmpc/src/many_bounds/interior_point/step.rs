//! A Newton step of the interior-point method: a linear-quadratic program in which every bound has a cost.

use super::at_stages::count_before;
use super::unknowns::{BoundUnknowns, Target};
use super::way::{Foretold, Left, Part, Prediction, Sums};
use crate::many_bounds::exchange::Program;
use crate::many_bounds::newton;
use crate::model::Scalar;
use crate::ocp::Ocp;
use crate::riccati::{Adjustment, BadPivot, CostToGo, StageMinimum};
use crate::rows::Trajectory;
use crate::small_matrix::{add_outer_product, add_scaled};
use crate::solution::Quantity;
use nalgebra::SVector;

/// The factors of the problem with the costs of its bounds.
pub(super) fn factorize<T: Scalar, const NX: usize, const NU: usize>(
    program: &mut Program<'_, T, NX, NU>,
) -> Result<(), BadPivot<T>> {
    let Program {
        span,
        factors,
        unknowns,
        ..
    } = program;
    let ocp = span.ocp;
    let mut cost_to_go = CostToGo {
        quadratic: ocp.terminal.p,
        linear: ocp.terminal.linear_x,
    };
    let bounds = unknowns.bounds();
    let (mut before, at_end) = bounds.split_at(count_before(bounds, ocp.length()));
    add_to_cost_to_go(ocp, at_end, &mut cost_to_go);
    for ((i, stage), factor) in span.stages().zip(span.of_mut(factors)).rev() {
        let (rest, here) = before.split_at(count_before(before, i));
        let costs = Costs { ocp, bounds: here };
        factor.eliminate_adjusted(stage, ocp.common_at(i), &mut cost_to_go, Some(&costs))?;
        add_to_cost_to_go(ocp, here, &mut cost_to_go);
        before = rest;
    }
    Ok(())
}

/// The costs of a stage's bounds that have to do with the input.
struct Costs<'a, T: 'static, const NX: usize, const NU: usize> {
    ocp: &'a Ocp<T, NX, NU>,
    bounds: &'a [BoundUnknowns<T>],
}

impl<T: Scalar, const NX: usize, const NU: usize> Adjustment<T, NX, NU> for Costs<'_, T, NX, NU> {
    #[inline(always)]
    fn adjust(&self, minimum: &mut StageMinimum<T, NX, NU>) {
        for bound in self.bounds {
            let (weight, pull) = bound.weight_and_pull();
            match bound.quantity {
                Quantity::Input(j) => {
                    minimum.hessian[(j, j)] += weight;
                    minimum.g[j] -= pull;
                }
                Quantity::Row(j) => {
                    if let Some(row) = self.ocp.row(bound.stage, j) {
                        add_outer_product(&mut minimum.hessian, &row.u, weight, &row.u);
                        add_outer_product(&mut minimum.g_x, &row.x, weight, &row.u);
                        add_scaled(&mut minimum.g, &row.u, -pull);
                    }
                }
                Quantity::State(_) => {}
            }
        }
    }
}

/// The parts of their costs that have to do with the state alone.
fn add_to_cost_to_go<T: Scalar, const NX: usize, const NU: usize>(
    ocp: &Ocp<T, NX, NU>,
    bounds: &[BoundUnknowns<T>],
    cost: &mut CostToGo<T, NX>,
) {
    for bound in bounds {
        let (weight, pull) = bound.weight_and_pull();
        match bound.quantity {
            Quantity::State(j) => {
                cost.quadratic[(j, j)] += weight;
                cost.linear[j] -= pull;
            }
            Quantity::Row(j) => {
                if let Some(row) = ocp.row(bound.stage, j) {
                    add_outer_product(&mut cost.quadratic, &row.x, weight, &row.x);
                    add_scaled(&mut cost.linear, &row.x, -pull);
                }
            }
            Quantity::Input(_) => {}
        }
    }
}

/// What the step to the trajectory of the policies foretells, and what there is to know of the way there.
pub(super) fn foretell<T: Scalar, const NX: usize, const NU: usize>(
    program: &mut Program<'_, T, NX, NU>,
) -> (Prediction<T>, Foretold) {
    let (mut sums, mut foretold) = (Sums::begin(), Foretold::default());
    for_each_value(program, |bound, value| {
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
        v,
        factors,
        u,
        x,
        unknowns,
        ..
    } = program;
    let ocp = span.ocp;
    let bounds = unknowns.bounds_mut();
    let (mut before, at_end) = bounds.split_at_mut(count_before(bounds, ocp.length()));
    let (mut costate, _) = slopes(ocp, at_end, &target);
    let stages = span.stages().zip(span.of(factors)).zip(span.of_mut(v));
    for (((i, stage), factor), v) in stages.rev() {
        let (rest, here) = before.split_at_mut(count_before(before, i));
        let (slope_x, slope_u) = slopes(ocp, here, &target);
        *v = newton::step_back(stage, factor, &slope_u, &mut costate);
        costate += slope_x;
        before = rest;
    }
    newton::deviate(span, factors, v, (u, x), &mut []);
    let mut left = Left::begin();
    for_each_value(program, |bound, value| {
        bound.keep_above_zero(value, &mut left)
    });
    left.part()
}

/// Aims at the targets of a stage's bounds; the derivative of what that adds to the costs, in its state and input.
#[inline(always)]
fn slopes<T: Scalar, const NX: usize, const NU: usize>(
    ocp: &Ocp<T, NX, NU>,
    bounds: &mut [BoundUnknowns<T>],
    target: &impl Fn(Target<T>) -> Target<T>,
) -> (SVector<T, NX>, SVector<T, NU>) {
    let mut sum = (SVector::zeros(), SVector::zeros());
    for bound in bounds {
        let slope = bound.aim(target);
        match bound.quantity {
            Quantity::State(j) => sum.0[j] += slope,
            Quantity::Input(j) => sum.1[j] += slope,
            Quantity::Row(j) => {
                if let Some(row) = ocp.row(bound.stage, j) {
                    add_scaled(&mut sum.0, &row.x, slope);
                    add_scaled(&mut sum.1, &row.u, slope);
                }
            }
        }
    }
    sum
}

/// Calls `each` with every bound and the value of its quantity on the trajectory.
#[inline(always)]
fn for_each_value<T: Scalar, const NX: usize, const NU: usize>(
    program: &mut Program<'_, T, NX, NU>,
    mut each: impl FnMut(&mut BoundUnknowns<T>, T),
) {
    let Program {
        span,
        u,
        x,
        unknowns,
        ..
    } = program;
    let trajectory = Trajectory { x, u };
    let at = |stage| {
        let u = trajectory
            .u
            .get(stage)
            .filter(|_| stage < span.ocp.length());
        (span.state(&trajectory, stage), u)
    };
    let mut stage = span.begin;
    let (mut x, mut u) = at(stage);
    for bound in unknowns.bounds_mut() {
        if bound.stage != stage {
            stage = bound.stage;
            (x, u) = at(stage);
        }
        let value = match bound.quantity {
            Quantity::State(j) => x[j],
            Quantity::Input(j) => u.map_or(T::zero(), |u| u[j]),
            Quantity::Row(j) => {
                let row = span.ocp.row(stage, j);
                row.map_or(T::zero(), |row| row.value(x, u))
            }
        };
        each(bound, value);
    }
}
