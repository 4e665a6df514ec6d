//! The linear-quadratic program that the sides of the bounds make of the problem: its factors and its
//! trajectory.

use super::side::BoundSide;
use super::span::Span;
use super::weighted::{Weighted, split_first_mut, split_off};
use crate::model::Scalar;
use crate::ocp::Ocp;
use crate::products::{are_in_vectors, in_vectors};
use crate::riccati::{Adjustment, BadPivot, CostToGo, StageFactor, StageMinimum};
use crate::rows::Trajectory;
use crate::small_matrix::{add_outer_product, add_scaled, product, transposed_product};
use crate::solution::Quantity;
use crate::transposed::StageBothWays;
use nalgebra::SVector;

/// The factors of the problem with the costs of its bounds; inputs that are held are constants.
pub(super) fn factorize<T: Scalar, W: Weighted<T>, const NX: usize, const NU: usize>(
    span: &Span<'_, T, NX, NU>,
    bounds: &[W],
    factors: &mut [StageFactor<T, NX, NU>],
) -> Result<(), BadPivot<T>> {
    let ocp = span.ocp;
    let mut cost_to_go = CostToGo {
        quadratic: ocp.terminal.p,
        linear: ocp.terminal.linear_x,
    };
    let mut before = bounds;
    add_to_cost_to_go(ocp, split_off(&mut before, ocp.length()), &mut cost_to_go);
    let stages = span.stages().zip(span.of_mut(factors));
    for ((i, stage), factor) in stages.rev() {
        let here = split_off(&mut before, i);
        eliminate(ocp, i, stage, here, factor, &mut cost_to_go)?;
        add_to_cost_to_go(ocp, here, &mut cost_to_go);
    }
    Ok(())
}

#[inline(never)]
fn eliminate<T: Scalar, W: Weighted<T>, const NX: usize, const NU: usize>(
    ocp: &Ocp<T, NX, NU>,
    i: usize,
    stage: StageBothWays<'_, T, NX, NU>,
    bounds: &[W],
    factor: &mut StageFactor<T, NX, NU>,
    cost_to_go: &mut CostToGo<T, NX>,
) -> Result<(), BadPivot<T>> {
    if let Some(input) = constant_input(bounds) {
        factor.pass(stage, ocp.common_at(i), cost_to_go, &input);
        return Ok(());
    }
    let costs = Costs { ocp, bounds };
    factor.eliminate_adjusted(stage, ocp.common_at(i), cost_to_go, Some(&costs))?;
    for (j, _) in held_inputs(bounds) {
        factor.inverse_factor[(j, j)] = T::zero();
    }
    Ok(())
}

/// The inputs that are held, and where.
#[inline(always)]
fn held_inputs<T, W: Weighted<T>>(bounds: &[W]) -> impl Iterator<Item = (usize, T)> {
    bounds.iter().filter_map(|bound| match bound.quantity() {
        Quantity::Input(j) => Some((j, bound.held_input()?)),
        _ => None,
    })
}

/// The input of a stage, if all of it is held and there are no rows.
fn constant_input<T: Scalar, W: Weighted<T>, const NU: usize>(
    bounds: &[W],
) -> Option<SVector<T, NU>> {
    if matches!(bounds.last()?.quantity(), Quantity::Row(_)) {
        return None;
    }
    let mut input = SVector::zeros();
    let mut held = [false; NU];
    for (j, value) in held_inputs(bounds) {
        (input[j], held[j]) = (value, true);
    }
    held.iter().all(|held| *held).then_some(input)
}

/// The costs of a stage's bounds that have to do with the input.
struct Costs<'a, T: 'static, W, const NX: usize, const NU: usize> {
    ocp: &'a Ocp<T, NX, NU>,
    bounds: &'a [W],
}

impl<T: Scalar, W: Weighted<T>, const NX: usize, const NU: usize> Adjustment<T, NX, NU>
    for Costs<'_, T, W, NX, NU>
{
    #[inline(always)]
    fn adjust(&self, minimum: &mut StageMinimum<T, NX, NU>) {
        for bound in self.bounds {
            let (weight, pull) = bound.weight_and_pull();
            match bound.quantity() {
                Quantity::Input(j) => {
                    minimum.hessian[(j, j)] += weight;
                    minimum.g[j] -= pull;
                }
                Quantity::Row(j) if weight != T::zero() || pull != T::zero() => {
                    if let Some(row) = self.ocp.row(bound.stage(), j) {
                        add_outer_product(&mut minimum.hessian, &row.u, weight, &row.u);
                        add_outer_product(&mut minimum.g_x, &row.x, weight, &row.u);
                        add_scaled(&mut minimum.g, &row.u, -pull);
                    }
                }
                _ => {}
            }
        }
        // At last, for rows may have a part in the inputs that are held.
        for (j, value) in held_inputs(self.bounds) {
            minimum.hold(j, value);
        }
    }
}

/// The parts of their costs that have to do with the state alone.
fn add_to_cost_to_go<T: Scalar, W: Weighted<T>, const NX: usize, const NU: usize>(
    ocp: &Ocp<T, NX, NU>,
    bounds: &[W],
    cost: &mut CostToGo<T, NX>,
) {
    for bound in bounds {
        let (weight, pull) = bound.weight_and_pull();
        match bound.quantity() {
            Quantity::State(j) => {
                cost.quadratic[(j, j)] += weight;
                cost.linear[j] -= pull;
            }
            Quantity::Row(j) if weight != T::zero() || pull != T::zero() => {
                if let Some(row) = ocp.row(bound.stage(), j) {
                    add_outer_product(&mut cost.quadratic, &row.x, weight, &row.x);
                    add_scaled(&mut cost.linear, &row.x, -pull);
                }
            }
            _ => {}
        }
    }
}

/// The trajectory of the factors' policies with the deviations `v` from them, none where there are fewer.
pub(super) fn roll_out<T: Scalar, const NX: usize, const NU: usize>(
    span: &Span<'_, T, NX, NU>,
    factors: &[StageFactor<T, NX, NU>],
    v: &[SVector<T, NU>],
    (u, x): (&mut [SVector<T, NU>], &mut [SVector<T, NX>]),
) {
    in_vectors(
        are_in_vectors(NX),
        #[inline(always)]
        || {
            let at_rest = SVector::zeros();
            let mut state = span.start;
            let places = span.of_mut(u).iter_mut().zip(span.of_mut(x));
            let stages = span.stages().zip(span.of(factors)).zip(places);
            for (((i, stage), factor), (u, x)) in stages {
                *u = factor.policy(&state, v.get(i).unwrap_or(&at_rest));
                state = stage.next(&state, u);
                *x = state;
            }
        },
    );
}

/// The distances of all sides on a trajectory.
pub(super) fn measure<T: Scalar, const NX: usize, const NU: usize>(
    span: &Span<'_, T, NX, NU>,
    sides: &mut [BoundSide<T>],
    trajectory: &Trajectory<'_, T, NX, NU>,
) {
    for_each_value(span, sides, trajectory, |side, value| {
        side.distance = side.distance_of(value);
    });
}

/// Calls `each` with every bound and the value of its quantity on a trajectory.
#[inline(always)]
pub(super) fn for_each_value<T: Scalar, W: Weighted<T>, const NX: usize, const NU: usize>(
    span: &Span<'_, T, NX, NU>,
    bounds: &mut [W],
    trajectory: &Trajectory<'_, T, NX, NU>,
    mut each: impl FnMut(&mut W, T),
) {
    let ocp = span.ocp;
    let n = ocp.length();
    let input = |stage| trajectory.u.get(stage).filter(|_| stage < n);
    let (mut at, mut x, mut u) = (span.begin, &span.start, input(span.begin));
    for bound in bounds {
        let stage = bound.stage();
        if stage != at {
            (at, x, u) = (stage, span.state(trajectory, stage), input(stage));
        }
        let value = match bound.quantity() {
            Quantity::State(j) => x[j],
            Quantity::Input(j) => u.map_or(T::zero(), |u| u[j]),
            Quantity::Row(j) => {
                let row = ocp.row(stage, j);
                row.map_or(T::zero(), |row| row.value(x, u))
            }
        };
        each(bound, value);
    }
}

/// The derivative of a stage's part of the Lagrangian, in state and input, of bounds with these derivatives in their
/// quantities.
#[inline(always)]
pub(super) fn gradient<T: Scalar, W: Weighted<T>, const NX: usize, const NU: usize>(
    ocp: &Ocp<T, NX, NU>,
    bounds: &mut [W],
    mut slope: impl FnMut(&mut W) -> T,
) -> (SVector<T, NX>, SVector<T, NU>) {
    let mut sum = (SVector::zeros(), SVector::zeros());
    for bound in bounds {
        let slope = slope(bound);
        // As a rule most sides are free.
        if slope == T::zero() {
            continue;
        }
        match bound.quantity() {
            Quantity::State(j) => sum.0[j] += slope,
            Quantity::Input(j) => sum.1[j] += slope,
            Quantity::Row(j) => {
                if let Some(row) = ocp.row(bound.stage(), j) {
                    add_scaled(&mut sum.0, &row.x, slope);
                    add_scaled(&mut sum.1, &row.u, slope);
                }
            }
        }
    }
    sum
}

/// The deviation that takes the gradient `slope` in the input, and what the costate means for it, away; the
/// costate becomes that in front of the stage.
#[inline(always)]
pub(super) fn step_back<T: Scalar, const NX: usize, const NU: usize>(
    stage: StageBothWays<'_, T, NX, NU>,
    factor: &StageFactor<T, NX, NU>,
    slope: &SVector<T, NU>,
    costate: &mut SVector<T, NX>,
) -> SVector<T, NU> {
    let input = stage.transposed_b_times(costate) + slope;
    *costate = stage.transposed_a_times(costate) + transposed_product(&factor.feedback, &input);
    -product(&factor.inverse_factor, &input)
}

/// Adds the deviations `v` from the policies to the trajectory. The multipliers of held states and rows take
/// up what their weight makes of the distance after it: of the change itself, since the change of a sum is
/// lost in rounding.
pub(super) fn deviate<T: Scalar, const NX: usize, const NU: usize>(
    span: &Span<'_, T, NX, NU>,
    factors: &[StageFactor<T, NX, NU>],
    v: &[SVector<T, NU>],
    (u, x): (&mut [SVector<T, NU>], &mut [SVector<T, NX>]),
    mut sides: &mut [BoundSide<T>],
) {
    let ocp = span.ocp;
    in_vectors(
        are_in_vectors(NX),
        #[inline(always)]
        || {
            let mut change = SVector::zeros();
            let places = span.of_mut(u).iter_mut().zip(span.of_mut(x));
            let stages = span.stages().zip(span.of(factors));
            for ((((i, stage), factor), v), (u, x)) in stages.zip(span.of(v)).zip(places) {
                let input = product(&factor.feedback, &change)
                    + transposed_product(&factor.inverse_factor, v);
                take_up(ocp, split_first_mut(&mut sides, i), &change, Some(&input));
                change = product(&stage.a, &change) + product(&stage.b, &input);
                *u += input;
                *x += change;
            }
            take_up(ocp, sides, &change, None);
        },
    );
}

fn take_up<T: Scalar, const NX: usize, const NU: usize>(
    ocp: &Ocp<T, NX, NU>,
    sides: &mut [BoundSide<T>],
    change_x: &SVector<T, NX>,
    change_u: Option<&SVector<T, NU>>,
) {
    for side in sides.iter_mut().filter(|side| side.is_weighted()) {
        let change = side.value(ocp, change_x, change_u) * side.sign;
        side.base -= side.weight * (side.distance + change);
    }
}

#[cfg(all(test, feature = "alloc"))]
mod tests {
    use super::*;
    use crate::list::List;
    use crate::many_bounds::side::Role;
    use crate::many_bounds::{residual, side};
    use crate::ocp::{GeneralRow, Penalty};
    use crate::solution::Side;
    use crate::transposed::Transposed;
    use alloc::vec;
    use lpvmpc_testkit::rng::Rng;
    use nalgebra::SMatrix;

    /// Where all inputs of a stage are held, the step is the one that holds each of them.
    fn compare<const NX: usize, const NU: usize>() {
        let mut random = Rng::new(7);
        let mut ocp = Ocp::<f64, NX, NU>::allocate(3);
        for stage in ocp.stages.iter_mut() {
            stage.a = SMatrix::from_fn(|_, _| random.uniform(-1.0, 1.0));
            stage.b = SMatrix::from_fn(|_, _| random.uniform(-1.0, 1.0));
            stage.c = SVector::from_fn(|_, _| random.uniform(-1.0, 1.0));
            stage.linear_x = SVector::from_fn(|_, _| random.uniform(-1.0, 1.0));
        }
        (ocp.common.q, ocp.common.r) = (SMatrix::identity(), SMatrix::identity());
        ocp.common.s = SMatrix::from_fn(|_, _| random.uniform(-0.1, 0.1));
        ocp.common.u.lower.fill(-1.0);
        ocp.common.u.upper.fill(2.0);
        let mut sides = vec![BoundSide::empty(); 8 * (NX + NU)];
        let count = side::collect(&ocp, &mut sides).unwrap_or_default();
        sides.truncate(count);
        sides.retain(|side| side.bound.stage == 1 && side.input().is_some());
        assert_eq!(sides.len(), 2 * NU);
        for (j, pair) in sides.chunks_mut(2).enumerate() {
            pair[j % 2].role = Role::Held;
        }
        let (stage, weights) = (StageBothWays::new(&ocp.stages[1]), ocp.common_at(1));
        let root = SMatrix::<f64, NX, NX>::from_fn(|_, _| random.uniform(-1.0, 1.0));
        let before = CostToGo {
            quadratic: root.transpose() * root,
            linear: SVector::from_fn(|_, _| random.uniform(-1.0, 1.0)),
        };
        let [mut found, mut expected] = [StageFactor::<f64, NX, NU>::zeros(); 2];
        let (mut passed, mut held) = (before, before);
        let eliminated = eliminate(&ocp, 1, stage, &sides, &mut found, &mut passed);
        assert_eq!(eliminated, Ok(()));
        let costs = Costs {
            ocp: &ocp,
            bounds: &sides,
        };
        let eliminated = expected.eliminate_adjusted(stage, weights, &mut held, Some(&costs));
        assert_eq!(eliminated, Ok(()));
        let input = SVector::<f64, NU>::from_fn(|j, _| [-1.0, 2.0][j % 2]);
        assert_eq!(found.feedforward, input);
        assert!(found.inverse_factor.iter().all(|entry| *entry == 0.0));
        assert_eq!(found.feedback, expected.feedback);
        assert!((found.feedforward - expected.feedforward).amax() < 1e-12);
        let size = 1.0 + held.quadratic.amax() + held.linear.amax();
        assert!((passed.quadratic - held.quadratic).amax() < 1e-14 * size);
        assert!((passed.linear - held.linear).amax() < 1e-13 * size);
        // What is kept transposed changes no step and no product.
        let kept = [Transposed::of(&ocp.stages[1])];
        let both_ways = stage.with(&kept, 0);
        let (mut factor, mut cost) = (StageFactor::zeros(), before);
        let eliminated = factor.eliminate_adjusted(both_ways, weights, &mut cost, None);
        assert_eq!(eliminated, Ok(()));
        let (mut same, mut same_cost) = (StageFactor::zeros(), before);
        let eliminated = same.eliminate_adjusted(stage, weights, &mut same_cost, None);
        assert_eq!(eliminated, Ok(()));
        assert!((factor.feedback - same.feedback).amax() < 1e-12);
        assert!((cost.quadratic - same_cost.quadratic).amax() < 1e-13 * size);
        let mut cost = before;
        factor.pass(both_ways, weights, &mut cost, &input);
        assert!((cost.quadratic - passed.quadratic).amax() < 1e-14 * size);
        assert!((cost.linear - passed.linear).amax() < 1e-13 * size);
        let v = SVector::<f64, NX>::from_fn(|_, _| random.uniform(-1.0, 1.0));
        let (a, b) = (ocp.stages[1].a.transpose(), ocp.stages[1].b.transpose());
        assert!((both_ways.transposed_a_times(&v) - a * v).amax() < 1e-14 * NX as f64);
        assert!((both_ways.transposed_b_times(&v) - b * v).amax() < 1e-14 * NX as f64);
        let sizes = b.abs() * v.abs();
        assert!((both_ways.transposed_b_sizes(&v) - sizes).amax() < 1e-14 * NX as f64);
        // One that is not held is left to the minimum, though another be held on both sides.
        for side in &mut sides {
            side.role = match side.input() {
                Some(0) => Role::Free,
                _ => Role::Held,
            };
        }
        let eliminated = eliminate(&ocp, 1, stage, &sides, &mut found, &mut before.clone());
        assert_eq!(eliminated, Ok(()));
        assert!(found.feedback.row(0).amax() > 0.0);
    }

    #[test]
    fn a_stage_whose_inputs_are_all_held_is_passed() {
        compare::<4, 1>();
        compare::<5, 3>();
        compare::<8, 2>();
        compare::<16, 6>();
    }

    /// A row in which a held input has a part, exceeded or held by a weight, does not move it, and the other inputs are
    /// at their minimum.
    #[test]
    fn held_inputs_stay_beside_rows_of_them() {
        const N: usize = 5;
        let mut random = Rng::new(11);
        let mut ocp = Ocp::<f64, 3, 2>::allocate(N);
        ocp.x0 = SVector::from_fn(|_, _| random.uniform(-1.0, 1.0));
        ocp.rows_per_stage = 1;
        let row = GeneralRow {
            x: SVector::from_fn(|_, _| random.uniform(-1.0, 1.0)),
            u: SVector::from([1.0, 0.7]),
            lower: -0.1,
            upper: 0.1,
            soft: Some(Penalty {
                linear: 3.0,
                quadratic: 5.0,
            }),
        };
        ocp.rows = List::repeat(row, N + 1);
        for stage in ocp.stages.iter_mut() {
            stage.a = SMatrix::from_fn(|_, _| random.uniform(-1.0, 1.0));
            stage.b = SMatrix::from_fn(|_, _| random.uniform(-1.0, 1.0));
        }
        (ocp.common.q, ocp.common.r) = (SMatrix::identity(), SMatrix::identity());
        ocp.common.u.lower.fill(-1.0);
        ocp.common.u.upper.fill(2.0);
        let mut sides = vec![BoundSide::empty(); 20 * N];
        let count = side::collect(&ocp, &mut sides).unwrap_or_default();
        sides.truncate(count);
        for side in &mut sides {
            let stage = side.bound.stage;
            let second = side.bound.side == Side::Upper;
            side.role = match side.bound.quantity {
                Quantity::Input(0) if second && stage != 1 => Role::Held,
                Quantity::Input(1) if !second && stage == 3 => Role::Held,
                Quantity::Row(_) if second == (stage == 2) => Role::Exceeded,
                _ => Role::Free,
            };
            if side.role == Role::Exceeded {
                (side.base, side.weight) = (side.price(), side.curvature());
            }
        }
        let span = Span::whole(&ocp, &[]);
        let mut factors = vec![StageFactor::zeros(); N];
        let (mut u, mut x) = (vec![SVector::zeros(); N], vec![SVector::zeros(); N]);
        factorize(&span, &sides, &mut factors).unwrap();
        roll_out(&span, &factors, &[], (&mut u, &mut x));
        let trajectory = Trajectory { x: &x, u: &u };
        measure(&span, &mut sides, &trajectory);
        for (i, u) in u.iter().enumerate() {
            assert!(i == 1 || u[0] == 2.0, "{i}: {u}");
            assert!(i != 3 || u[1] == -1.0, "{i}: {u}");
        }
        let mut slopes = vec![SVector::zeros(); N];
        let residual = residual::explain(&span, &factors, &mut sides, &trajectory, &mut slopes);
        assert!(residual.rest < 1e-13 * residual.largest);
    }
}
