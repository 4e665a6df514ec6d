//! The Karush-Kuhn-Tucker conditions of the problem: the oracle for every solver.

use crate::model::Scalar;
use crate::ocp::Ocp;
use crate::rows::{self, Trajectory};
use crate::solution::{ActiveRow, ActiveSet, Part, Side, Solution};
use nalgebra::SVector;

/// How far a solution is from satisfying the optimality conditions. All zero at the optimum;
/// the problem is convex, so all zero is also sufficient.
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
        self.stationarity
            .max(self.primal)
            .max(self.dual)
            .max(self.complementarity)
    }
}

/// The residual of the optimality conditions of `ocp` at `solution`.
pub fn kkt_residual<
    T: Scalar,
    const NX: usize,
    const NU: usize,
    const N: usize,
    const M: usize,
    const NG: usize,
>(
    ocp: &Ocp<T, NX, NU, N, NG>,
    solution: &Solution<T, NX, NU, N, M>,
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
        complementarity: slackness.max(unpaid),
    }
}

/// The gradient that the active rows at `stage` add to the state and the input.
fn row_gradient<
    T: Scalar,
    const NX: usize,
    const NU: usize,
    const N: usize,
    const M: usize,
    const NG: usize,
>(
    ocp: &Ocp<T, NX, NU, N, NG>,
    active: &ActiveSet<T, M>,
    stage: usize,
) -> (SVector<T, NX>, SVector<T, NU>) {
    let mut gradient = (SVector::zeros(), SVector::zeros());
    for row in active.iter().filter(|row| row.bound.stage == stage) {
        let (normal_x, normal_u) = rows::normal(ocp, &row.bound);
        let factor = match row.bound.side {
            Side::Upper => row.multiplier,
            Side::Lower | Side::Equality => -row.multiplier,
        };
        gradient.0 += normal_x * factor;
        gradient.1 += normal_u * factor;
    }
    gradient
}

fn stationarity<
    T: Scalar,
    const NX: usize,
    const NU: usize,
    const N: usize,
    const M: usize,
    const NG: usize,
>(
    ocp: &Ocp<T, NX, NU, N, NG>,
    trajectory: &Trajectory<'_, T, NX, NU, N>,
    active: &ActiveSet<T, M>,
) -> T {
    let n = ocp.length();
    let mut largest_term = T::one();
    let mut largest = T::zero();
    let x_n = state(ocp, trajectory, n);
    let mut costate = ocp.terminal.p * x_n + ocp.terminal.linear_x + row_gradient(ocp, active, n).0;
    for (i, (stage, u)) in ocp
        .stages
        .iter()
        .zip(trajectory.u)
        .enumerate()
        .take(n)
        .rev()
    {
        let x = state(ocp, trajectory, i);
        let (rows_x, rows_u) = row_gradient(ocp, active, i);
        let through_dynamics = stage.b.tr_mul(&costate);
        let weights = stage.r * u + stage.s * x + stage.linear_u;
        let gradient = weights + through_dynamics + rows_u;
        largest = largest.max(gradient.amax());
        largest_term = largest_term.max(through_dynamics.amax()).max(rows_u.amax());
        costate =
            stage.q * x + stage.s.tr_mul(u) + stage.linear_x + stage.a.tr_mul(&costate) + rows_x;
    }
    largest / largest_term
}

fn state<T: Scalar, const NX: usize, const NU: usize, const N: usize, const NG: usize>(
    ocp: &Ocp<T, NX, NU, N, NG>,
    trajectory: &Trajectory<'_, T, NX, NU, N>,
    stage: usize,
) -> SVector<T, NX> {
    match stage.checked_sub(1) {
        Some(before) => trajectory.x.get(before).copied().unwrap_or(ocp.x0),
        None => ocp.x0,
    }
}

/// Dynamics, hard bounds, terminal equality.
fn primal<T: Scalar, const NX: usize, const NU: usize, const N: usize, const NG: usize>(
    ocp: &Ocp<T, NX, NU, N, NG>,
    trajectory: &Trajectory<'_, T, NX, NU, N>,
) -> T {
    let mut largest = T::zero();
    for (i, (stage, u)) in ocp
        .stages
        .iter()
        .zip(trajectory.u)
        .enumerate()
        .take(ocp.length())
    {
        let x_next = state(ocp, trajectory, i + 1);
        let defect = stage.a * state(ocp, trajectory, i) + stage.b * u + stage.c - x_next;
        largest = largest.max(defect.amax() / x_next.amax().max(T::one()));
    }
    rows::violated_bounds(ocp, trajectory, &mut |candidate| {
        if candidate.soft.is_none() {
            largest = largest.max(candidate.violation.min(-candidate.slack));
        }
    });
    if let Some(target) = &ocp.terminal.equality {
        let x_n = state(ocp, trajectory, ocp.length());
        largest = largest.max((x_n - target).amax() / target.amax().max(T::one()));
    }
    largest
}

/// Multipliers within their intervals, and active bounds that are met (dual, complementarity).
fn multipliers<
    T: Scalar,
    const NX: usize,
    const NU: usize,
    const N: usize,
    const M: usize,
    const NG: usize,
>(
    ocp: &Ocp<T, NX, NU, N, NG>,
    trajectory: &Trajectory<'_, T, NX, NU, N>,
    active: &ActiveSet<T, M>,
) -> (T, T) {
    let mut outside = T::zero();
    let mut slackness = T::zero();
    let mut largest = T::one();
    for row in active.iter() {
        let slack = rows::slack(ocp, trajectory, &row.bound);
        let price = rows::soft_price(ocp, &row.bound);
        largest = largest.max(row.multiplier.abs());
        if row.bound.side == Side::Equality {
            continue;
        }
        outside = outside.max(-row.multiplier);
        let defect = match (row.part, price) {
            (Part::Quadratic, Some(price)) => {
                let excess = (-slack).max(T::zero());
                (row.multiplier - price.quadratic * excess).abs() / price.quadratic
            }
            (Part::Linear, Some(price)) => {
                outside = outside.max(row.multiplier - price.linear);
                if row.exceeded {
                    outside = outside.max((row.multiplier - price.linear).abs());
                    slack.max(T::zero())
                } else {
                    slack.abs()
                }
            }
            _ => slack.abs(),
        };
        slackness = slackness.max(defect);
    }
    (outside / largest, slackness)
}

/// The largest excess of a soft bound whose price is not in the active set.
fn unpaid_excess<
    T: Scalar,
    const NX: usize,
    const NU: usize,
    const N: usize,
    const M: usize,
    const NG: usize,
>(
    ocp: &Ocp<T, NX, NU, N, NG>,
    trajectory: &Trajectory<'_, T, NX, NU, N>,
    active: &ActiveSet<T, M>,
) -> T {
    let mut largest = T::zero();
    rows::violated_bounds(ocp, trajectory, &mut |candidate| {
        let Some(price) = candidate.soft else {
            return;
        };
        let paid = |part: Part, free: bool| {
            let listed = |row: &ActiveRow<T>| row.bound == candidate.bound && row.part == part;
            free || active.iter().any(listed)
        };
        let linear = paid(Part::Linear, price.linear <= T::zero());
        let quadratic = paid(Part::Quadratic, price.quadratic <= T::zero());
        if !(linear && quadratic) {
            largest = largest.max(-candidate.slack);
        }
    });
    largest
}
