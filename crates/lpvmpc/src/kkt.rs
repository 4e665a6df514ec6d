//! The Karush-Kuhn-Tucker conditions of the problem: the oracle for every solver.

use crate::adjoint::Adjoint;
use crate::model::Scalar;
use crate::ocp::Ocp;
use crate::rows::{self, Trajectory};
use crate::solution::{ActiveRow, ActiveSet, Part, Side, Solution};
use core::cmp::Ordering;
use nalgebra::SVector;

/// How far a solution is from satisfying the optimality conditions. All zero at the optimum;
/// the problem is convex, so all zero is also sufficient. Where a number of the problem or the
/// solution is not one (NaN), so is the residual.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KktResidual<T> {
    /// Largest entry of the Lagrangian's gradient in the inputs (the states are eliminated by
    /// the adjoint recursion), relative to the largest term in it (at least 1).
    pub stationarity: T,
    /// Largest defect of the dynamics, violation of a hard bound or of the terminal equality,
    /// relative to the quantity's size (at least 1).
    pub primal: T,
    /// Largest amount by which a multiplier leaves its interval, relative to the largest
    /// multiplier (at least 1).
    pub dual: T,
    /// Largest slack of a bound listed as active, or excess of a soft bound whose price is not
    /// paid, relative to the quantity's size (at least 1).
    pub complementarity: T,
}

impl<T: Scalar> KktResidual<T> {
    /// The largest of the four.
    pub fn largest(&self) -> T {
        let parts = [
            self.stationarity,
            self.primal,
            self.dual,
            self.complementarity,
        ];
        parts.into_iter().fold(T::zero(), larger)
    }
}

/// The larger of two residuals; unlike `max`, NaN if one of them is.
fn larger<T: Scalar>(a: T, b: T) -> T {
    match a.partial_cmp(&b) {
        Some(Ordering::Less) => b,
        Some(_) => a,
        None => a + b,
    }
}

/// The largest magnitude of an entry; NaN if one is.
fn magnitude<T: Scalar, const K: usize>(v: &SVector<T, K>) -> T {
    v.iter().map(|entry| entry.abs()).fold(T::zero(), larger)
}

/// The residual of the optimality conditions of `ocp` at `solution`.
pub fn kkt_residual<T: Scalar, const NX: usize, const NU: usize>(
    ocp: &Ocp<T, NX, NU>,
    solution: &Solution<T, NX, NU>,
) -> KktResidual<T> {
    let trajectory = Trajectory {
        x: &solution.x,
        u: &solution.u,
    };
    let (dual, slackness) = multipliers(ocp, &trajectory, &solution.active);
    let unpaid = unpaid_excess(ocp, &trajectory, &solution.active);
    KktResidual {
        stationarity: stationarity(ocp, &trajectory, &solution.active),
        primal: primal(ocp, &trajectory),
        dual,
        complementarity: larger(slackness, unpaid),
    }
}

fn stationarity<T: Scalar, const NX: usize, const NU: usize>(
    ocp: &Ocp<T, NX, NU>,
    trajectory: &Trajectory<'_, T, NX, NU>,
    active: &ActiveSet<T>,
) -> T {
    let mut largest_term = T::one();
    let mut largest = T::zero();
    let mut adjoint = Adjoint::new(ocp, Some(trajectory), active);
    while let Some(at) = adjoint.step(active) {
        largest = larger(largest, magnitude(&at.gradient));
        largest_term = largest_term.max(at.dynamics.amax()).max(at.rows.amax());
    }
    largest / largest_term
}

/// Dynamics, hard bounds, terminal equality.
fn primal<T: Scalar, const NX: usize, const NU: usize>(
    ocp: &Ocp<T, NX, NU>,
    trajectory: &Trajectory<'_, T, NX, NU>,
) -> T {
    let mut largest = T::zero();
    for (i, (stage, u)) in ocp
        .stages
        .iter()
        .zip(trajectory.u)
        .enumerate()
        .take(ocp.length())
    {
        let x_next = trajectory.state(ocp, i + 1);
        let defect = stage.a * trajectory.state(ocp, i) + stage.b * u + stage.c - x_next;
        largest = larger(largest, magnitude(&defect) / x_next.amax().max(T::one()));
    }
    rows::violated_bounds(ocp, trajectory, &mut |candidate| {
        if candidate.soft.is_none() {
            // Relative to the bound's size, but at least to 1.
            let violation = candidate.violation();
            let relative = if violation >= -candidate.slack {
                -candidate.slack
            } else {
                violation
            };
            largest = larger(largest, relative);
        }
    });
    if let Some(target) = &ocp.terminal.equality {
        let x_n = trajectory.state(ocp, ocp.length());
        let missed = magnitude(&(x_n - target)) / target.amax().max(T::one());
        largest = larger(largest, missed);
    }
    largest
}

/// Multipliers within their intervals, and active bounds that are met (dual, complementarity).
fn multipliers<T: Scalar, const NX: usize, const NU: usize>(
    ocp: &Ocp<T, NX, NU>,
    trajectory: &Trajectory<'_, T, NX, NU>,
    active: &ActiveSet<T>,
) -> (T, T) {
    let mut outside = T::zero();
    let mut slackness = T::zero();
    let mut largest = T::one();
    for row in active.iter() {
        largest = larger(largest, row.multiplier.abs());
        if row.bound.side == Side::Equality {
            continue;
        }
        // A row that is listed twice acts with the sum.
        let same = |other: &ActiveRow<T>| other.bound == row.bound && other.part == row.part;
        let rows = active.iter().filter(same);
        let multiplier = rows.fold(T::zero(), |sum, other| sum + other.multiplier);
        let slack = rows::slack(ocp, trajectory, &row.bound);
        let (distance, defect) = conditions(&row, multiplier, slack, ocp);
        outside = larger(outside, larger(-row.multiplier, distance));
        let size = rows::size(ocp, &row.bound).max(T::one());
        slackness = larger(slackness, defect / size);
    }
    (outside / largest, slackness)
}

/// How far an active row's multiplier is above its largest value (or, if the bound is exceeded,
/// from it), and its bound from where the row says it is.
fn conditions<T: Scalar, const NX: usize, const NU: usize>(
    row: &ActiveRow<T>,
    multiplier: T,
    slack: T,
    ocp: &Ocp<T, NX, NU>,
) -> (T, T) {
    let zero = T::zero();
    let excess = if slack < zero { -slack } else { zero };
    match (row.part, rows::soft_price(ocp, &row.bound)) {
        (Part::Hard, None) => (zero, slack.abs()),
        (Part::Linear, Some(price)) if row.exceeded => {
            ((multiplier - price.linear).abs(), slack + excess)
        }
        (Part::Linear, Some(price)) => (multiplier - price.linear, slack.abs()),
        (Part::Quadratic, Some(price)) if price.quadratic > zero => {
            (zero, (multiplier / price.quadratic - excess).abs())
        }
        // A part that the bound does not have has no multiplier.
        _ => (multiplier, zero),
    }
}

/// The largest excess of a soft bound whose price is not in the active set.
fn unpaid_excess<T: Scalar, const NX: usize, const NU: usize>(
    ocp: &Ocp<T, NX, NU>,
    trajectory: &Trajectory<'_, T, NX, NU>,
    active: &ActiveSet<T>,
) -> T {
    let mut largest = T::zero();
    rows::violated_bounds(ocp, trajectory, &mut |candidate| {
        let Some(price) = candidate.soft else {
            return;
        };
        let paid = |part: Part, free: bool| {
            let listed = |row: &ActiveRow<T>| row.bound == candidate.bound && row.part == part;
            free || active.iter().any(|row| listed(&row))
        };
        let linear = paid(Part::Linear, price.linear <= T::zero());
        let quadratic = paid(Part::Quadratic, price.quadratic <= T::zero());
        if !(linear && quadratic) {
            let size = rows::size(ocp, &candidate.bound).max(T::one());
            largest = larger(largest, -candidate.slack / size);
        }
    });
    largest
}
