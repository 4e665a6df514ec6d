//! The dense and the sparse form against the problem itself: cost and bounded quantities of inputs
//! that somebody chooses.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot go on must fail, in its support functions too"
)]

use lpvmpc::{BoundId, Ocp, Quantity, Side};
use lpvmpc_testkit::dense::{DenseQp, Rows};
use lpvmpc_testkit::problems::{Family, problem};
use lpvmpc_testkit::rng::Rng;
use lpvmpc_testkit::sparse::{Csc, SparseQp};
use nalgebra::{DVector, SVector};

type Problem = Ocp<f64, 3, 2>;

/// States x_0.., inputs, and their cost.
struct Rollout {
    x: Vec<SVector<f64, 3>>,
    u: Vec<SVector<f64, 2>>,
    cost: f64,
}

impl Rollout {
    fn random(ocp: &Problem, rng: &mut Rng) -> Self {
        let (mut x, mut u, mut cost) = (vec![ocp.x0], Vec::new(), 0.0);
        for (i, stage) in ocp.stages.iter().enumerate().take(ocp.length()) {
            let (state, input) = (x[i], rng.matrix());
            let common = ocp.common_at(i);
            cost += (common.q * state * 0.5 + stage.linear_x).dot(&state);
            cost += (common.r * input * 0.5 + common.s * state + stage.linear_u).dot(&input);
            x.push(stage.a * state + stage.b * input + stage.c);
            u.push(input);
        }
        let end = x[ocp.length()];
        cost += (ocp.terminal.p * end * 0.5 + ocp.terminal.linear_x).dot(&end);
        Self { x, u, cost }
    }

    fn inputs(&self) -> DVector<f64> {
        DVector::from_iterator(2 * self.u.len(), self.u.iter().flatten().copied())
    }

    /// By how much a bound holds; of an equality, the defect.
    fn slack(&self, ocp: &Problem, bound: &BoundId) -> f64 {
        let BoundId { stage, side, .. } = *bound;
        let common = ocp.common_at(stage);
        let states = if stage == ocp.length() {
            ocp.terminal.x
        } else {
            common.x
        };
        let (value, lower, upper) = match bound.quantity {
            Quantity::State(j) => (self.x[stage][j], states.lower[j], states.upper[j]),
            Quantity::Input(j) => (self.u[stage][j], common.u.lower[j], common.u.upper[j]),
            Quantity::Row(j) => {
                let row = ocp.row(stage, j).unwrap();
                let of_u = self.u.get(stage).map_or(0.0, |u| row.u.dot(u));
                (row.x.dot(&self.x[stage]) + of_u, row.lower, row.upper)
            }
        };
        match (side, bound.quantity) {
            (Side::Lower, _) => value - lower,
            (Side::Upper, _) => upper - value,
            (Side::Equality, Quantity::State(j)) => value - ocp.terminal.equality.unwrap()[j],
            (Side::Equality, _) => f64::NAN,
        }
    }
}

fn each(families: &[Family], mut check: impl FnMut(&Problem, &mut Rng)) {
    for &family in families {
        for seed in 0..40 {
            let mut rng = Rng::new(seed);
            check(&problem(&mut rng, family, 6, 2), &mut rng);
        }
    }
}

const HARD: [Family; 5] = [
    Family::Loose,
    Family::Tight,
    Family::NearlyParallel,
    Family::TerminalEquality,
    Family::Arbitrary,
];

/// Sum of finite sides of all bounds.
fn finite_sides(ocp: &Problem) -> usize {
    let finite = |limits: &[f64]| limits.iter().filter(|limit| limit.is_finite()).count();
    let end = ocp.length();
    let mut sides = finite(ocp.terminal.x.lower.as_slice());
    sides += finite(ocp.terminal.x.upper.as_slice());
    for i in 0..end {
        let common = ocp.common_at(i);
        sides += finite(common.u.lower.as_slice()) + finite(common.u.upper.as_slice());
        if i > 0 {
            sides += finite(common.x.lower.as_slice()) + finite(common.x.upper.as_slice());
        }
    }
    let rows = ocp.rows.iter().take((end + 1) * ocp.rows_per_stage);
    sides
        + rows
            .map(|row| finite(&[row.lower, row.upper]))
            .sum::<usize>()
}

#[test]
fn dense_form_has_the_problems_costs_and_bounds() {
    each(&HARD, |ocp, rng| {
        let qp = DenseQp::new(ocp).unwrap();
        let rollouts = [(); 2].map(|()| Rollout::random(ocp, rng));
        // Up to the constant, which the difference of two does not have.
        let [one, other] = [0, 1].map(|k| {
            let u = rollouts[k].inputs();
            let cost = (&qp.hessian * &u * 0.5 + &qp.gradient).dot(&u);
            (cost, cost - rollouts[k].cost)
        });
        let size = rollouts[0].cost.abs() + rollouts[1].cost.abs() + one.0.abs() + other.0.abs();
        assert!((one.1 - other.1).abs() <= 1e-12 * size, "{one:?} {other:?}");

        assert_eq!(qp.inequality.bounds.len(), finite_sides(ocp));
        let equalities = ocp.terminal.equality.map_or(0, |_| 3);
        assert_eq!(qp.equality.bounds.len(), equalities);
        let Rows {
            bounds,
            coefficients,
            constants,
        } = &qp.inequality;
        let values = coefficients * rollouts[0].inputs() + constants;
        let equality = &qp.equality.coefficients * rollouts[0].inputs() + &qp.equality.constants;
        let all = bounds.iter().zip(&values);
        for (bound, value) in all.chain(qp.equality.bounds.iter().zip(&equality)) {
            let slack = rollouts[0].slack(ocp, bound);
            assert!(
                (value - slack).abs() <= 1e-10 * (1.0 + slack.abs()),
                "{bound}: {value}, {slack}"
            );
        }
    });
}

/// Memory of one problem, used for another of its pattern, holds nothing of the first.
#[test]
fn condensing_again_leaves_nothing_behind() {
    let mut rng = Rng::new(1);
    let first = problem::<3, 2>(&mut rng, Family::Tight, 6, 1);
    let mut second = first.clone();
    for stage in &mut second.stages {
        stage.a = rng.matrix();
        stage.b = rng.matrix();
    }
    second.x0 = rng.matrix();
    let mut reused = DenseQp::new(&first).unwrap();
    reused.condense(&second);
    let fresh = DenseQp::new(&second).unwrap();
    assert_eq!(reused.hessian, fresh.hessian);
    assert_eq!(reused.gradient, fresh.gradient);
    assert_eq!(
        reused.inequality.coefficients,
        fresh.inequality.coefficients
    );
    assert_eq!(reused.inequality.constants, fresh.inequality.constants);
}

#[test]
fn soft_bounds_have_no_dense_form() {
    each(&[Family::SoftLinear, Family::SoftQuadratic], |ocp, _| {
        assert!(DenseQp::new(ocp).is_none());
    });
}

fn times(matrix: &Csc, z: &[f64]) -> DVector<f64> {
    let mut product = DVector::zeros(matrix.rows);
    for (column, value) in z.iter().enumerate() {
        for entry in matrix.starts[column]..matrix.starts[column + 1] {
            product[matrix.row_indices[entry]] += matrix.values[entry] * value;
        }
    }
    product
}

/// A point of the dynamics has the problem's cost; within the sparse form's rows it is exactly where
/// the problem's bounds hold, and exceeding a soft bound costs its price.
#[test]
fn sparse_form_has_the_problems_costs_and_bounds() {
    let soft = [Family::SoftLinear, Family::SoftQuadratic, Family::SoftBoth];
    each(&[&HARD[..], &soft].concat(), |ocp, rng| {
        let qp = SparseQp::new(ocp);
        let rollout = Rollout::random(ocp, rng);
        let (u, x) = (rollout.u.iter(), rollout.x[1..].iter());
        let mut z: Vec<f64> = u
            .zip(x)
            .flat_map(|(u, x)| u.iter().chain(x.iter()).copied().collect::<Vec<_>>())
            .collect();
        let excesses = qp.q.len() - z.len();
        z.resize(qp.q.len(), 0.0);
        // The least excess with which each row holds; the row of the excess alone stands before it.
        let values = times(&qp.a, &z);
        let dynamics = 3 * ocp.length();
        let mut largest = 0.0_f64;
        for row in 0..dynamics {
            assert!((values[row] - qp.lower[row]).abs() <= 1e-12 * (1.0 + qp.lower[row].abs()));
        }
        let beyond = |row: usize| (qp.lower[row] - values[row]).max(values[row] - qp.upper[row]);
        for row in dynamics + 3 * usize::from(ocp.terminal.equality.is_some())..qp.lower.len() {
            largest = largest.max(beyond(row));
        }
        let mut penalty = 0.0;
        let base = z.len() - excesses;
        for (excess, size) in z.iter_mut().enumerate().skip(base) {
            let rows: Vec<usize> = (0..qp.a.starts[excess + 1] - qp.a.starts[excess])
                .map(|k| qp.a.row_indices[qp.a.starts[excess] + k])
                .collect();
            let [own, bounded] = rows[..] else {
                panic!("an excess has two rows: {rows:?}")
            };
            assert_eq!(
                (own + 1, qp.lower[own], qp.upper[own]),
                (bounded, 0.0, f64::INFINITY)
            );
            *size = beyond(bounded).max(0.0);
            let price = ocp.common.soft_x[0].unwrap();
            penalty += (price.linear + 0.5 * price.quadratic * *size) * *size;
        }
        if excesses == 0 {
            let all = DenseQp::new(ocp).unwrap().inequality.bounds;
            let slacks = all.iter().map(|bound| rollout.slack(ocp, bound));
            let worst = slacks.fold(0.0, |worst: f64, slack| worst.max(-slack));
            assert!(
                (largest - worst).abs() <= 1e-10 * (1.0 + worst),
                "{largest} {worst}"
            );
        }
        let (upper, diagonal) = (times(&qp.p, &z), &qp.p);
        // z'Pz of the upper triangle: twice z'Uz less the diagonal.
        let mut square = 2.0 * DVector::from_column_slice(&z).dot(&upper);
        for (column, value) in z.iter().enumerate() {
            for entry in diagonal.starts[column]..diagonal.starts[column + 1] {
                if diagonal.row_indices[entry] == column {
                    square -= diagonal.values[entry] * value * value;
                }
            }
        }
        let linear: f64 = qp.q.iter().zip(&z).map(|(q, z)| q * z).sum();
        let cost = square / 2.0 + linear + qp.constant;
        let expected = rollout.cost + penalty;
        assert!(
            (cost - expected).abs() <= 1e-11 * (1.0 + expected.abs()),
            "{cost} {expected}"
        );
    });
}
