//! The oracle itself: it must object to every kind of wrong answer.

use super::support::solve;
use lpvmpc::{Ocp, Penalty, Solution, kkt_residual};
use lpvmpc_testkit::problems::{Family, each_common, problem};
use lpvmpc_testkit::rng::Rng;
use nalgebra::SVector;

type Problem = Ocp<f64, 3, 2>;
type Answer = Solution<f64, 3, 2>;

fn solved(family: Family, seed: u64) -> (Problem, Answer) {
    let ocp = problem(&mut Rng::new(seed), family, 8, 1);
    let solution = solve(&ocp);
    assert!(kkt_residual(&ocp, &solution).largest() < 1e-10);
    (ocp, solution)
}

#[test]
fn optimum_alone_passes() {
    for seed in 0..200 {
        let (ocp, solution) = solved(Family::Tight, seed);
        let mut rng = Rng::new(seed);
        let mut wrong = solution.clone();
        let direction: SVector<f64, 2> = rng.matrix();
        wrong.u[rng.index(ocp.horizon)] += direction * 1e-3;
        assert!(kkt_residual(&ocp, &wrong).largest() > 1e-6, "{seed}");
        let mut no_multipliers = solution.clone();
        no_multipliers.active.clear();
        let matters = solution.active.iter().any(|row| row.multiplier > 1e-3);
        assert!(
            !matters || kkt_residual(&ocp, &no_multipliers).stationarity > 1e-9,
            "{seed}"
        );
    }
}

/// `max` of a number and NaN is the number: a solution of NaN once had the residual zero.
#[test]
fn nothing_that_is_no_number_passes() {
    let (ocp, solution) = solved(Family::Tight, 1);
    let mut wrong = solution.clone();
    wrong.u[0][0] = f64::NAN;
    assert!(kkt_residual(&ocp, &wrong).largest().is_nan());
    let mut wrong = solution.clone();
    wrong.x[0][1] = f64::NAN;
    assert!(kkt_residual(&ocp, &wrong).largest().is_nan());
    let mut bad = ocp.clone();
    bad.own[0].q[(0, 0)] = f64::NAN;
    bad.stages[0].a[(0, 0)] = f64::NAN;
    assert!(kkt_residual(&bad, &solution).largest().is_nan());
}

/// A bound that has become soft since may not keep the multiplier of a hard one.
#[test]
fn multiplier_above_the_price_is_seen() {
    let (mut ocp, solution) = solved(Family::Tight, 3);
    let held = solution.active.iter().any(|row| {
        matches!(row.bound.quantity, lpvmpc::Quantity::State(_)) && row.multiplier > 1e-2
    });
    assert!(held, "the example needs an active state bound");
    let price = Some(Penalty {
        linear: 1e-3,
        quadratic: 0.0,
    });
    for common in each_common(&mut ocp) {
        common.soft_x = [price; 3];
    }
    ocp.terminal.soft_x = [price; 3];
    assert!(kkt_residual(&ocp, &solution).dual > 1e-4);
}

#[test]
fn unpaid_excess_is_seen() {
    let (mut ocp, mut solution) = solved(Family::SoftBoth, 5);
    ocp.terminal.x.upper = solution.x[ocp.horizon - 1] - SVector::repeat(0.1);
    ocp.terminal.x.lower = SVector::repeat(f64::NEG_INFINITY);
    solution.active.clear();
    assert!(kkt_residual(&ocp, &solution).complementarity > 0.01);
}
