//! The conditions of optimality once more, written apart from the crate's own oracle.
//!
//! The states are those that the inputs lead to in double precision, whatever precision the
//! inputs come from; what a multiplier may be follows from the price as a whole, not from its
//! parts.

use lpvmpc::{ActiveRow, Ocp, Penalty, Quantity, Side, Solution};
use nalgebra::SVector;

/// One bounded quantity at one stage.
struct Bounded<const NX: usize, const NU: usize> {
    stage: usize,
    quantity: Quantity,
    normal_x: SVector<f64, NX>,
    normal_u: SVector<f64, NU>,
    lower: f64,
    upper: f64,
    price: Option<Penalty<f64>>,
}

/// What is asked of a solution: its inputs, and its active bounds.
pub struct Answer<const NU: usize> {
    pub u: Vec<SVector<f64, NU>>,
    pub active: Vec<ActiveRow<f64>>,
}

impl<const NU: usize> Answer<NU> {
    /// Of a solution in any precision.
    pub fn of<T, const NX: usize, const N: usize, const M: usize>(
        solution: &Solution<T, NX, NU, N, M>,
    ) -> Self
    where
        T: lpvmpc::Scalar + Into<f64>,
    {
        let row = |row: &ActiveRow<T>| ActiveRow {
            bound: row.bound,
            part: row.part,
            multiplier: row.multiplier.into(),
            exceeded: row.exceeded,
        };
        Self {
            u: solution.u.iter().map(|u| u.map(Into::into)).collect(),
            active: solution.active.iter().map(row).collect(),
        }
    }

    /// The sum of the multipliers on one side of a quantity.
    fn multiplier(&self, stage: usize, quantity: Quantity, side: Side) -> f64 {
        let rows = self.active.iter().filter(|row| {
            row.bound.stage == stage && row.bound.quantity == quantity && row.bound.side == side
        });
        rows.map(|row| row.multiplier).sum()
    }
}

/// The largest violation of a condition, each relative to its own largest term, at least 1.
/// Zero at the optimum, and only there.
pub fn residual<const NX: usize, const NU: usize, const N: usize, const NG: usize>(
    ocp: &Ocp<f64, NX, NU, N, NG>,
    answer: &Answer<NU>,
) -> f64 {
    let n = ocp.length();
    let mut x = vec![ocp.x0];
    for (stage, u) in ocp.stages.iter().zip(&answer.u).take(n) {
        x.push(stage.a * x[x.len() - 1] + stage.b * u + stage.c);
    }
    let quantities = bounded(ocp);
    let multipliers = answer.active.iter().map(|row| row.multiplier.abs());
    let largest = multipliers.fold(1.0, f64::max);
    let mut worst: f64 = 0.0;
    for q in &quantities {
        let u = answer.u.get(q.stage).filter(|_| q.stage < n);
        let value = q.normal_x.dot(&x[q.stage]) + u.map_or(0.0, |u| q.normal_u.dot(u));
        for (side, slack) in [
            (Side::Lower, value - q.lower),
            (Side::Upper, q.upper - value),
        ] {
            let multiplier = answer.multiplier(q.stage, q.quantity, side);
            let size = value.abs().max(1.0);
            worst = worst.max(condition(slack / size, size, multiplier, largest, q.price));
        }
    }
    if let Some(target) = ocp.terminal.equality {
        worst = worst.max((x[n] - target).amax() / target.amax().max(1.0));
    }
    worst.max(stationarity(ocp, answer, &x, &quantities))
}

/// How far (slack, multiplier) is from the nearer of the cases that the price allows. `slack`
/// is in units of `size`.
fn condition(
    slack: f64,
    size: f64,
    multiplier: f64,
    largest: f64,
    price: Option<Penalty<f64>>,
) -> f64 {
    let (cap, curvature) = price.map_or((f64::INFINITY, f64::INFINITY), |price| {
        (price.linear, price.quadratic)
    });
    let outside = (-multiplier).max(multiplier - cap).max(0.0) / largest;
    let at_the_bound = slack.abs().max(outside);
    let off_it = if slack >= 0.0 {
        multiplier.abs() / largest
    } else if price.is_some() {
        (multiplier - cap + curvature * slack * size).abs() / largest
    } else {
        f64::INFINITY
    };
    at_the_bound.min(off_it)
}

/// The Lagrangian's gradient in the inputs, the states eliminated.
fn stationarity<const NX: usize, const NU: usize, const N: usize, const NG: usize>(
    ocp: &Ocp<f64, NX, NU, N, NG>,
    answer: &Answer<NU>,
    x: &[SVector<f64, NX>],
    quantities: &[Bounded<NX, NU>],
) -> f64 {
    let n = ocp.length();
    let mut force_x = vec![SVector::<f64, NX>::zeros(); n + 1];
    let mut force_u = vec![SVector::<f64, NU>::zeros(); n + 1];
    for q in quantities {
        let sides = [
            (Side::Upper, 1.0),
            (Side::Lower, -1.0),
            (Side::Equality, -1.0),
        ];
        for (side, sign) in sides {
            let multiplier = sign * answer.multiplier(q.stage, q.quantity, side);
            force_x[q.stage] += q.normal_x * multiplier;
            force_u[q.stage] += q.normal_u * multiplier;
        }
    }
    let mut costate = ocp.terminal.p * x[n] + ocp.terminal.linear_x + force_x[n];
    let (mut worst, mut largest): (f64, f64) = (0.0, 1.0);
    for (i, (stage, u)) in ocp.stages.iter().zip(&answer.u).enumerate().take(n).rev() {
        let own = stage.r * u + stage.s * x[i] + stage.linear_u;
        let later = stage.b.tr_mul(&costate);
        worst = worst.max((own + later + force_u[i]).amax());
        largest = largest.max(own.amax()).max(costate.amax());
        costate = stage.q * x[i]
            + stage.s.tr_mul(u)
            + stage.linear_x
            + stage.a.tr_mul(&costate)
            + force_x[i];
    }
    worst / largest
}

/// Every bounded quantity of the problem.
fn bounded<const NX: usize, const NU: usize, const N: usize, const NG: usize>(
    ocp: &Ocp<f64, NX, NU, N, NG>,
) -> Vec<Bounded<NX, NU>> {
    let n = ocp.length();
    let mut all = Vec::new();
    let mut push = |stage, quantity, normal_x, normal_u, limits: (f64, f64), price| {
        all.push(Bounded {
            stage,
            quantity,
            normal_x,
            normal_u,
            lower: limits.0,
            upper: limits.1,
            price,
        });
    };
    let unit_x = |j: usize| SVector::<f64, NX>::from_fn(|i, _| f64::from(i == j));
    let unit_u = |j: usize| SVector::<f64, NU>::from_fn(|i, _| f64::from(i == j));
    for (i, stage) in ocp.stages.iter().enumerate().take(n) {
        for j in (0..NX).filter(|_| i > 0) {
            let limits = (stage.x.lower[j], stage.x.upper[j]);
            let quantity = Quantity::State(j);
            push(
                i,
                quantity,
                unit_x(j),
                SVector::zeros(),
                limits,
                stage.soft_x[j],
            );
        }
        for j in 0..NU {
            let limits = (stage.u.lower[j], stage.u.upper[j]);
            push(
                i,
                Quantity::Input(j),
                SVector::zeros(),
                unit_u(j),
                limits,
                None,
            );
        }
        for j in 0..NG {
            let normals = (
                stage.row_x.row(j).transpose(),
                stage.row_u.row(j).transpose(),
            );
            let limits = (stage.rows.lower[j], stage.rows.upper[j]);
            push(
                i,
                Quantity::Row(j),
                normals.0,
                normals.1,
                limits,
                stage.soft_rows[j],
            );
        }
    }
    let end = &ocp.terminal;
    for j in 0..NX {
        let limits = (end.x.lower[j], end.x.upper[j]);
        push(
            n,
            Quantity::State(j),
            unit_x(j),
            SVector::zeros(),
            limits,
            end.soft_x[j],
        );
    }
    for j in 0..NG {
        let normal = end.row_x.row(j).transpose();
        let limits = (end.rows.lower[j], end.rows.upper[j]);
        push(
            n,
            Quantity::Row(j),
            normal,
            SVector::zeros(),
            limits,
            end.soft_rows[j],
        );
    }
    all
}
