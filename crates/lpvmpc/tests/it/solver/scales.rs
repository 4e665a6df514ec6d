//! Units, and limits that stand for none, change no answer.

use super::support::{capacity, cold, solve};
use lpvmpc::{
    List, Ocp, Solution, Solver, SolverSettings, Status, WarmStart, infeasibility_margin,
};
use nalgebra::{Matrix1, Matrix2, Matrix2x1, Matrix3, Vector1, Vector2, Vector3};

/// x+ = b u over `n` stages, each by itself: the costs q x^2 / 2 + w x and r u^2 / 2, and x within these limits.
fn apart(n: usize, b: f64, (q, r): (f64, f64), w: f64, limits: (f64, f64)) -> Ocp<f64, 1, 1> {
    let mut ocp = Ocp::allocate(n);
    for stage in &mut ocp.stages {
        stage.b = Matrix1::new(b);
        stage.linear_x = Vector1::new(w);
    }
    (ocp.common.q, ocp.common.r) = (Matrix1::new(q), Matrix1::new(r));
    ocp.terminal.p = ocp.common.q;
    ocp.terminal.linear_x = Vector1::new(w);
    for x in [&mut ocp.common.x, &mut ocp.terminal.x] {
        (x.lower, x.upper) = (Vector1::new(limits.0), Vector1::new(limits.1));
    }
    ocp
}

/// A bound that was active and is not any longer was held where the multiplier that it had, below zero, was little beside
/// the gradient of an input of a larger unit.
#[test]
fn a_multiplier_is_judged_beside_its_own_costs() {
    let (n, b) = (100, 1e8);
    let active = apart(n, b, (1.0, 1e14), -2.0, (f64::NEG_INFINITY, 1.0));
    let mut later = active.clone();
    for stage in later.stages.iter_mut().skip(51) {
        stage.linear_x[0] = -1.008;
    }
    later.terminal.linear_x[0] = -1.008;
    let room = capacity(&active);
    let (mut solver, mut solution) = (Solver::allocate(room), Solution::allocate(room));
    solver.solve(&active, &cold(), &mut solution);
    assert_eq!(solution.active.len(), n);
    let same = SolverSettings {
        warm_start: WarmStart::Same,
        ..cold()
    };
    solver.solve(&later, &same, &mut solution);
    assert!(solution.status.is_solved(), "{}", solution.status);
    // x = w / (q + r / b^2)
    let free = 1.008 / (1.0 + 1e14 / (b * b));
    for (i, x) in solution.x.iter().enumerate() {
        let expected = if i < 50 { 1.0 } else { free };
        assert!((x[0] - expected).abs() < 1e-9, "{i}: {x}");
    }
}

/// Beside a lower limit that is far away, held states come nearer in one slow mode, too slowly for the passes that there
/// are: then each of them was found by itself.
#[test]
fn held_states_that_come_nearer_slowly_are_found_at_once() {
    let n = 60;
    let ocp = apart(n, 1.0, (1.0, 1.0), -4.0, (-1.5e4, 1.0));
    let solution = solve(&ocp);
    assert!(solution.status.is_solved(), "{}", solution.status);
    assert_eq!(solution.active.len(), n);
    for row in solution.active.iter() {
        // w - (q + r) x
        assert!((row.multiplier - 2.0).abs() < 1e-9, "{row:?}");
    }
    // A factorisation counts as two.
    assert!(solution.changes <= 20, "{}", solution.changes);
}

/// Of a limit of 1e30, as other programs write that there is none, the other side was a part.
#[test]
fn a_limit_that_stands_for_none_lets_the_other_one_count() {
    for none in [1e20, 1e30, f64::MAX] {
        let mut ocp = apart(1, 1.0, (1.0, 1.0), 10.0, (f64::NEG_INFINITY, f64::INFINITY));
        (ocp.common.u.lower[0], ocp.common.u.upper[0]) = (0.0, none);
        let solution = solve(&ocp);
        assert!(solution.status.is_solved());
        assert_eq!((solution.u[0][0], solution.x[0][0]), (0.0, 0.0), "{none}");
        let solution = solve(&apart(1, 1.0, (1.0, 1.0), 10.0, (0.2, none)));
        assert!(solution.status.is_solved());
        assert!((solution.x[0][0] - 0.2).abs() < 1e-12, "{none}");
        let solution = solve(&apart(1, 1.0, (1.0, 1.0), -10.0, (-none, -0.2)));
        assert!((solution.x[0][0] + 0.2).abs() < 1e-12, "{none}");
    }
}

/// Rows whose multipliers are of other units than the candidate's were left out of the proof, which then was none.
#[test]
fn a_proof_of_two_units_is_one() {
    let mut ocp = Ocp::<f32, 2, 1>::allocate(1);
    ocp.stages[0].a = Matrix2::identity();
    ocp.stages[0].b = Matrix2x1::new(1e4, 1e-4);
    ocp.common.r = Matrix1::new(1.0);
    // u >= 1 by the first, and u <= -1 by the second.
    ocp.terminal.x.lower = Vector2::new(1e4, f32::NEG_INFINITY);
    ocp.terminal.x.upper = Vector2::new(f32::INFINITY, -1e-4);
    let solution = solve(&ocp);
    assert!(
        matches!(solution.status, Status::Infeasible(_)),
        "{}",
        solution.status
    );
    assert!(infeasibility_margin(&ocp, &solution.active) > 0.0);
}

/// What rounding leaves of a slope that vanishes, times a limit of 1e30 that stands for none, took the proof away.
#[test]
fn a_limit_that_stands_for_none_has_no_part_in_a_proof() {
    for none in [f64::INFINITY, 1e20, 1e30, f64::MAX] {
        let mut ocp = Ocp::<f64, 3, 1>::allocate(1);
        ocp.x0 = Vector3::new(0.3, 0.7, -0.2);
        ocp.stages[0].a = Matrix3::new(0.9, 0.3, 0.1, -0.2, 0.8, 0.4, 0.1, -0.3, 0.7);
        ocp.stages[0].b = Vector3::new(0.7, 0.37, -0.13);
        (ocp.common.q, ocp.common.r) = (Matrix3::identity(), Matrix1::new(1.0));
        (ocp.common.u.lower[0], ocp.common.u.upper[0]) = (-none, none);
        // One input cannot lead to three states.
        ocp.terminal.x.lower = Vector3::new(0.9, -0.8, 0.5);
        ocp.terminal.x.upper = Vector3::new(1.0, -0.7, 0.6);
        let solution = solve(&ocp);
        assert!(
            matches!(solution.status, Status::Infeasible(_)),
            "{none}: {}",
            solution.status
        );
        assert!(infeasibility_margin(&ocp, &solution.active) > 0.0);
        assert!(solution.u[0][0].is_finite());
    }
}

/// A lower bound of plus infinity, which no number meets, was none where many bounds are active.
#[test]
fn a_bound_that_no_number_meets_is_not_met() {
    let n = 40;
    let mut ocp = apart(
        n,
        1.0,
        (1.0, 1.0),
        -10.0,
        (f64::NEG_INFINITY, f64::INFINITY),
    );
    (ocp.common.u.lower[0], ocp.common.u.upper[0]) = (-1.0, 1.0);
    ocp.own = List::repeat(ocp.common, n);
    assert!(solve(&ocp).status.is_solved());
    ocp.own[10].x.lower[0] = f64::INFINITY;
    let solution = solve(&ocp);
    assert!(!solution.status.is_solved(), "{}", solution.status);
    assert!(solution.u.iter().all(|u| u[0].abs() <= 1.0));
}
