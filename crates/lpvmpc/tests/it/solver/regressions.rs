//! What once went wrong. Each test carries the mistake that it caught.

use super::support::{capacity, cold, kind, solve};
use lpvmpc::{
    Capacity, GeneralRow, List, Ocp, Penalty, Solution, Solver, SolverSettings, Status, WarmStart,
    kkt_residual,
};
use lpvmpc_testkit::problems::{Family, each_common, problem};
use lpvmpc_testkit::rng::Rng;
use nalgebra::{Matrix1, Vector1};

/// Room for three stages with one input and one state, whichever bounds are soft.
const SMALL: Capacity = Capacity {
    stages: 3,
    rows: 6,
    active: 6,
    own_stages: 0,
    general_rows: 0,
    second_plan: false,
};

type Scalar1 = Ocp<f64, 1, 1>;

/// x+ = x + u, three stages from x = 1, everything weighted with 1.
fn integrator() -> Scalar1 {
    let mut ocp = Scalar1 {
        x0: Vector1::new(1.0),
        ..Ocp::allocate(3)
    };
    for stage in &mut ocp.stages {
        (stage.a, stage.b) = (Matrix1::new(1.0), Matrix1::new(1.0));
    }
    ocp.common.q = Matrix1::new(1.0);
    ocp.own = List::repeat(ocp.common, 3);
    ocp.terminal.p = Matrix1::new(1.0);
    ocp
}

/// A bound that was hard when it was active and is soft now was kept as a hard one by the warm
/// start, with a multiplier above its price.
#[test]
fn warm_start_from_a_bound_that_has_become_soft() {
    let mut ocp = integrator();
    ocp.own[1].x.lower[0] = 0.9;
    let (mut solver, mut solution) = (Solver::allocate(SMALL), Solution::allocate(SMALL));
    let same = SolverSettings {
        warm_start: WarmStart::Same,
        ..SolverSettings::default()
    };
    solver.solve(&ocp, &same, &mut solution);
    assert_eq!(solution.active.len(), 1);
    for common in each_common(&mut ocp) {
        common.soft_x[0] = Some(Penalty {
            linear: 0.01,
            quadratic: 0.0,
        });
    }
    solver.solve(&ocp, &same, &mut solution);
    let reference = solve(&ocp);
    assert!((solution.cost - reference.cost).abs() < 1e-12);
    assert!(
        solution.x[0][0] < 0.9 - 0.01,
        "a bound this cheap is exceeded"
    );
}

/// A bound that was active and is absent now made the warm start calculate with infinities
/// (and lose its other rows).
#[test]
fn warm_start_from_a_bound_that_has_gone() {
    let mut ocp = integrator();
    for common in &mut ocp.own {
        (common.u.lower[0], common.x.lower[0]) = (-0.2, 0.5);
    }
    let (mut solver, mut solution) = (Solver::allocate(SMALL), Solution::allocate(SMALL));
    let same = SolverSettings {
        warm_start: WarmStart::Same,
        ..SolverSettings::default()
    };
    solver.solve(&ocp, &same, &mut solution);
    assert!(solution.active.len() >= 2);
    ocp.own[0].u.lower[0] = f64::NEG_INFINITY;
    solver.solve(&ocp, &same, &mut solution);
    assert!(kkt_residual(&ocp, &solution).largest() < 1e-12);
    let reference = solve(&ocp);
    assert!((solution.cost - reference.cost).abs() < 1e-12);
}

/// Rows beyond the end of a horizon that has become shorter were formed from the factors of
/// the problem before.
#[test]
fn warm_start_from_a_longer_horizon() {
    for seed in 0..200 {
        let mut rng = Rng::new(seed);
        let mut ocp = problem::<3, 1>(&mut rng, Family::Arbitrary, 12, 0);
        ocp.horizon = 12;
        let room = capacity(&ocp);
        let (mut solver, mut solution) = (Solver::allocate(room), Solution::allocate(room));
        let same = SolverSettings {
            warm_start: WarmStart::Same,
            ..cold()
        };
        solver.solve(&ocp, &same, &mut solution);
        ocp.horizon = 5;
        solver.solve(&ocp, &same, &mut solution);
        let reference = solve(&ocp);
        assert_eq!(kind(&solution.status), kind(&reference.status), "{seed}");
        if reference.status.is_solved() {
            let residual = kkt_residual(&ocp, &solution).largest();
            assert!(residual < 1e-9, "{seed}: {residual:e}");
            assert!((solution.u[0] - reference.u[0]).amax() < 1e-8, "{seed}");
        }
    }
}

/// Inputs stood outside their bounds by the rounding of the last step: 1.5000000000000002 for
/// 1.5.
#[test]
fn inputs_are_within_their_bounds_to_the_last_bit() {
    for seed in 0..500 {
        let mut rng = Rng::new(seed);
        let ocp = problem::<3, 2>(&mut rng, Family::Loose, 8, 0);
        let solution = solve(&ocp);
        for (i, u) in solution.u.iter().enumerate().take(ocp.horizon) {
            assert!(ocp.common_at(i).u.contains(u, 0.0), "{seed}: {u}");
        }
    }
}

/// A pivot that is NaN was called an indefinite matrix.
#[test]
fn nan_in_a_weight_is_not_finite() {
    let mut ocp = integrator();
    ocp.own[2].r[0] = f64::NAN;
    let solution = solve(&ocp);
    assert_eq!(solution.status, Status::NotFinite);
    ocp.own[2].r[0] = -7.0;
    let solution = solve(&ocp);
    let expected = Status::NumericalFailure {
        stage: 2,
        pivot: -6.0,
    };
    assert_eq!(solution.status, expected);
}

/// An infinite target, in a component that one input cannot move any more, was "reached".
#[test]
fn infinite_target_is_not_finite() {
    let mut ocp = Ocp::<f64, 2, 1>::allocate(3);
    for stage in &mut ocp.stages {
        stage.b[(0, 0)] = 1.0;
    }
    ocp.terminal.equality = Some([1.0, f64::INFINITY].into());
    let solution = solve(&ocp);
    assert_eq!(solution.status, Status::NotFinite);
}

/// Row sizes beyond the range of the squares made a row "dependent", and the problem
/// infeasible.
#[test]
fn overflow_is_not_infeasibility() {
    let mut ocp = Ocp::<f64, 1, 1>::allocate(3);
    (ocp.rows, ocp.rows_per_stage) = (List::repeat(GeneralRow::default(), 4), 1);
    ocp.rows[0].u[0] = 1e200;
    ocp.rows[0].lower = 1.0;
    let solution = solve(&ocp);
    assert_eq!(solution.status, Status::NotFinite);
}

/// Warm starting went past the cap on changes.
#[test]
fn cap_on_changes_holds_for_the_warm_start_too() {
    let ocp = problem::<4, 2>(&mut Rng::new(17), Family::Tight, 10, 0);
    let mut solution = solve(&ocp);
    assert!(solution.active.len() > 5, "{}", solution.active.len());
    let settings = SolverSettings {
        warm_start: WarmStart::Same,
        max_changes: Some(3),
        ..cold()
    };
    Solver::allocate(capacity(&ocp)).solve(&ocp, &settings, &mut solution);
    assert_eq!(
        (kind(&solution.status), solution.changes),
        ("maximum of changes", 3)
    );
}

/// The Gram matrix of the working set lost rows that depend on others: of a problem with 20
/// inputs 75 bounds were "active", bounds were missed by 1e19, infeasible problems were
/// "solved" and feasible ones "infeasible".
#[test]
fn dependent_rows_are_recognised() {
    for (family, seed) in DEPENDENT {
        let ocp = problem::<4, 1>(&mut Rng::new(seed), family, 20, 0);
        let solution = solve(&ocp);
        if let Some(feasible) = family.feasible() {
            assert_eq!(solution.status.is_solved(), feasible, "{family:?} {seed}");
        }
        if solution.status.is_solved() {
            let residual = kkt_residual(&ocp, &solution).largest();
            assert!(residual < 1e-9, "{family:?} {seed}: {residual:e}");
        }
    }
}

const DEPENDENT: [(Family, u64); 13] = [
    (Family::Degenerate, 169),
    (Family::Degenerate, 1349),
    (Family::Degenerate, 1956),
    (Family::Degenerate, 3314),
    (Family::TerminalEquality, 19472),
    (Family::Arbitrary, 17),
    (Family::Arbitrary, 95),
    (Family::Arbitrary, 184),
    (Family::Arbitrary, 810),
    (Family::Infeasible, 12352),
    (Family::Infeasible, 21246),
    (Family::Infeasible, 25005),
    (Family::Infeasible, 43002),
];
