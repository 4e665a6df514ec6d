//! One input: the bounds of the last answer are held first. What comes of it is the answer from nothing.

use super::support::{agree, capacity, cold, solve};
use lpvmpc::{Ocp, Penalty, Solution, Solver, SolverSettings, Status, WarmStart, kkt_residual};
use lpvmpc_testkit::clarabel::{self, Verdict};
use lpvmpc_testkit::problems::{Family, problem};
use lpvmpc_testkit::rng::Rng;
use nalgebra::{Matrix2, Matrix2x1, SMatrix, SVector, Vector2};

/// How often a problem with three active bounds or more was solved without a change of them, out of how many.
#[derive(Debug, Default)]
struct Held {
    unchanged: usize,
    problems: usize,
    worst_residual: f64,
}

/// Solves `before`, then `ocp` from its answer, and compares with the answer from nothing.
fn check<const NX: usize>(
    [before, ocp]: [&Ocp<f64, NX, 1>; 2],
    warm_start: WarmStart,
    held: &mut Held,
) {
    let room = capacity(before);
    let mut solver = Solver::allocate(room);
    let mut solution = Solution::allocate(room);
    solver.solve(before, &cold(), &mut solution);
    let settings = SolverSettings {
        warm_start,
        ..cold()
    };
    solver.solve(ocp, &settings, &mut solution);
    let expected = solve(ocp);
    assert!(
        agree(&solution.status, &expected.status),
        "{} for {}",
        solution.status,
        expected.status
    );
    if expected.status != Status::Solved || solution.status != Status::Solved {
        return;
    }
    let residual = kkt_residual(ocp, &solution).largest();
    held.worst_residual = held.worst_residual.max(residual);
    let size = 1.0 + expected.cost.abs();
    assert!(
        (solution.cost - expected.cost).abs() <= 1e-9 * size,
        "{} for {}",
        solution.cost,
        expected.cost
    );
    if expected.active.len() >= 3 {
        held.problems += 1;
        held.unchanged += usize::from(solution.changes == 0);
    }
}

/// Random problems, and then others: from a start nearby, whose findings are returned, or with other bounds.
fn sweep<const NX: usize>(seeds: u64, horizon: usize) -> Held {
    let mut nearby = Held::default();
    let mut elsewhere = Held::default();
    for seed in 0..seeds {
        let mut rng = Rng::new(seed);
        let family = Family::ALL[rng.index(Family::ALL.len())];
        let before = problem::<NX, 1>(&mut rng, family, horizon, 0);
        let mut ocp = before.clone();
        ocp.x0 *= 1.0 - 1e-3;
        check([&before, &ocp], WarmStart::Same, &mut nearby);
        check([&before, &ocp], WarmStart::Shifted, &mut elsewhere);

        // What was a hard bound is soft, is gone, or is narrower now.
        for common in std::iter::once(&mut ocp.common).chain(ocp.own.iter_mut()) {
            match seed % 3 {
                0 => {
                    common.soft_x[0] = Some(Penalty {
                        linear: 0.1,
                        quadratic: 0.1,
                    })
                }
                1 => common.x.upper = SVector::repeat(f64::INFINITY),
                _ => {
                    (common.u.lower, common.u.upper) = (common.u.lower * 0.5, common.u.upper * 0.5)
                }
            }
        }
        check([&before, &ocp], WarmStart::Same, &mut elsewhere);
        // Another problem altogether.
        let other = problem::<NX, 1>(&mut rng, family, horizon, 0);
        check([&before, &other], WarmStart::Shifted, &mut elsewhere);
    }
    println!("{NX} {horizon} {nearby:?} {elsewhere:?}");
    // Residuals of up to 1e-8 are those of problems whose units differ by 1e4, from nothing, too.
    for held in [&nearby, &elsewhere] {
        assert!(held.worst_residual < 1e-7, "{held:?}");
    }
    nearby
}

/// From a start nearby one problem in five has exactly the bounds of the last one, which takes no change then.
#[test]
fn bounds_of_the_last_answer_lead_to_the_answer_from_nothing() {
    let sweeps = [
        sweep::<1>(600, 10),
        sweep::<2>(1200, 12),
        sweep::<4>(1200, 20),
        sweep::<6>(300, 30),
    ];
    let unchanged: usize = sweeps.iter().map(|held| held.unchanged).sum();
    let problems: usize = sweeps.iter().map(|held| held.problems).sum();
    assert!(5 * unchanged > problems, "{unchanged} of {problems}");
}

/// A guess that fails costs no more changes than all may be.
#[test]
fn no_more_changes_than_there_may_be() {
    let mut capped = 0;
    for seed in 0..400 {
        let mut rng = Rng::new(seed);
        let before = problem::<4, 1>(&mut rng, Family::Tight, 16, 0);
        let ocp = problem::<4, 1>(&mut rng, Family::Tight, 16, 0);
        let room = capacity(&before);
        for most in [0, 1, 2, 3, 5, 8] {
            let mut solver = Solver::allocate(room);
            let mut solution = Solution::allocate(room);
            solver.solve(&before, &cold(), &mut solution);
            let settings = SolverSettings {
                max_changes: Some(most),
                warm_start: WarmStart::Same,
                ..cold()
            };
            solver.solve(&ocp, &settings, &mut solution);
            assert!(solution.changes <= most, "{} of {most}", solution.changes);
            capped += usize::from(solution.status == Status::MaxChanges);
        }
    }
    assert!(capped > 100, "{capped}");
}

/// A cart on its way to a place ahead, no faster and with no more force than it may have, with the program of its present
/// state.
fn cart(rng: &mut Rng, horizon: usize) -> Ocp<f64, 2, 1> {
    let h = 0.05 + 0.1 * rng.uniform(0.0, 1.0);
    let mut ocp = Ocp::<f64, 2, 1>::allocate(horizon);
    ocp.horizon = horizon;
    let target = Vector2::new(1.0 + 4.0 * rng.uniform(0.0, 1.0), 0.0);
    ocp.common.q = Matrix2::new(1.0, 0.0, 0.0, 0.1);
    ocp.common.r = SMatrix::from_element(0.01 + 0.1 * rng.uniform(0.0, 1.0));
    ocp.terminal.p = ocp.common.q * 10.0;
    for stage in ocp.stages.iter_mut() {
        stage.a = Matrix2::new(1.0, h, 0.0, 1.0);
        stage.b = Matrix2x1::new(h * h / 2.0, h);
        stage.linear_x = -ocp.common.q * target;
    }
    ocp.terminal.linear_x = -ocp.terminal.p * target;
    ocp.common.x.upper = Vector2::new(f64::INFINITY, 0.5 + rng.uniform(0.0, 1.0));
    ocp.common.x.lower = -ocp.common.x.upper;
    ocp.terminal.x = ocp.common.x;
    ocp.common.u.upper[0] = 0.5 + 2.0 * rng.uniform(0.0, 1.0);
    ocp.common.u.lower = -ocp.common.u.upper;
    ocp
}

/// Closed loops, each sample begun with the answer to the one before: the cost is Clarabel's, which shares nothing with this
/// solver, and most samples with three active bounds or more take one change of them at most. As rows they took one each.
#[test]
fn carts_at_their_limits_take_few_changes() {
    let (mut few, mut many) = (0, 0);
    for seed in 0..24 {
        let mut rng = Rng::new(seed);
        let horizon = 8 + rng.index(20);
        let mut ocp = cart(&mut rng, horizon);
        let room = capacity(&ocp);
        let mut solver = Solver::allocate(room);
        let mut solution = Solution::allocate(room);
        let settings = SolverSettings {
            warm_start: WarmStart::Shifted,
            ..cold()
        };
        for sample in 0..40 {
            solver.solve(&ocp, &settings, &mut solution);
            assert_eq!(solution.status, Status::Solved, "{seed} {sample}");
            let Verdict::Solved { primal } = clarabel::solve(&ocp).unwrap() else {
                panic!("{seed} {sample}: Clarabel has no answer");
            };
            let size = 1.0 + primal.abs();
            assert!(
                (solution.cost - primal).abs() < 1e-6 * size,
                "{seed} {sample}: {} for {primal}",
                solution.cost
            );
            assert!(kkt_residual(&ocp, &solution).largest() < 1e-12);
            if solution.active.len() >= 3 {
                many += 1;
                few += usize::from(solution.changes <= 1);
            }
            let noise = Vector2::new(rng.uniform(0.0, 1.0) - 0.5, rng.uniform(0.0, 1.0) - 0.5);
            ocp.x0 = ocp.stages[0].next(&ocp.x0, &solution.u[0]) + noise * 1e-3;
            ocp.x0[1] = ocp.x0[1].clamp(ocp.common.x.lower[1], ocp.common.x.upper[1]);
        }
    }
    println!("{few} of {many}");
    assert!(many > 100 && 2 * few > many, "{few} of {many}");
}
