//! One input: the bounds of the last answer are held first. What comes of it is the answer from nothing.

use super::support::{agree, capacity, cold, solve};
use lpvmpc::{Ocp, Penalty, Solution, Solver, SolverSettings, Status, WarmStart, kkt_residual};
use lpvmpc_testkit::problems::{Family, problem};
use lpvmpc_testkit::rng::Rng;
use nalgebra::SVector;

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
