//! Sizes that are chosen when something is built: where the memory comes from changes no answer, too
//! little of it is said, and lists that are shorter than the horizon mean what they say.

use super::support::{capacity, cold, kind, solve, solve_with};
use lpvmpc::{
    Bounds, Capacity, ControllerArrays, ControllerMemory, GeneralRow, GuaranteedArrays,
    GuaranteedMemory, GuaranteedWorkspaceArrays, GuaranteedWorkspaceMemory, List, ManyBoundsArrays,
    Ocp, Solution, Solver, SolverArrays, SolverMemory, SolverSettings, Status, WorkspaceArrays,
    WorkspaceMemory, kkt_residual,
};
use lpvmpc_testkit::clarabel::{self, Verdict};
use lpvmpc_testkit::problems::{Family, problem};
use lpvmpc_testkit::rng::Rng;
use nalgebra::SVector;

const NX: usize = 3;
const NU: usize = 2;
/// Stages of the longest problem here.
const N: usize = 8;
type Problem = Ocp<f64, NX, NU>;
type Answer = Solution<f64, NX, NU>;

/// Problems of every family, with one general row.
fn problems(count: u64) -> impl Iterator<Item = Problem> {
    let seeds = (0..count).flat_map(|seed| Family::ALL.map(|family| (seed, family)));
    seeds.map(|(seed, family)| problem(&mut Rng::new(seed), family, N, 1))
}

/// Bit for bit, over the horizon.
fn assert_same(ocp: &Problem, found: &Answer, expected: &Answer) {
    let n = ocp.length();
    assert_eq!(found.status, expected.status);
    assert_eq!(found.u[..n], expected.u[..n]);
    assert_eq!(found.x[..n], expected.x[..n]);
    assert_eq!(found.cost, expected.cost);
    assert_eq!(found.changes, expected.changes);
    assert!(found.active.iter().eq(expected.active.iter()));
}

/// The bytes that are told before there is memory are those of the arrays, but for alignment: less
/// than a number for each of their parts.
#[test]
fn the_bytes_of_a_capacity_are_those_of_its_arrays() {
    const M: usize = 7;
    const OWN: usize = N;
    const ROWS: usize = 3 * (N + 1);
    fn of<T: lpvmpc::Scalar>() -> [(usize, usize); 5] {
        let plain = Capacity {
            stages: N,
            rows: M,
            active: M,
            ..Capacity::default()
        };
        let whole = Capacity {
            own_stages: OWN,
            general_rows: 3,
            ..plain
        };
        [
            (
                SolverMemory::<T, NX, NU>::bytes(plain),
                size_of::<SolverArrays<T, NX, NU, N, M>>(),
            ),
            (
                WorkspaceMemory::<T, NX, NU>::bytes(whole),
                size_of::<WorkspaceArrays<T, NX, NU, N, M, OWN, ROWS>>(),
            ),
            (
                ControllerMemory::<T, NX, NU>::bytes(plain),
                size_of::<ControllerArrays<T, NX, NU, N, M>>(),
            ),
            (
                GuaranteedMemory::<T, NX, NU>::bytes(N),
                size_of::<GuaranteedArrays<T, NX, NU, N>>(),
            ),
            (
                GuaranteedWorkspaceMemory::<T, NU, { NX + 1 }>::bytes(plain),
                size_of::<GuaranteedWorkspaceArrays<T, NU, { NX + 1 }, N, M>>(),
            ),
        ]
    }
    for (told, arrays) in of::<f64>().into_iter().chain(of::<f32>()) {
        assert!((told..told + 16).contains(&arrays), "{told} {arrays}");
    }
}

/// Lent arrays, longer than any problem and used for all of them one after the other, give the answers
/// of memory on the heap that is as large as the problem needs.
#[test]
fn lent_arrays_give_the_answers_of_memory_on_the_heap() {
    const MANY: usize = 140;
    let arrays = Box::leak(Box::new(
        SolverArrays::<f64, NX, NU, { N + 3 }, MANY>::default(),
    ));
    let many = Box::leak(Box::new(ManyBoundsArrays::<
        f64,
        NX,
        NU,
        { N + 3 },
        { 2 * (N + 1) * (NX + NU + 1) },
    >::default()));
    let mut solver = Solver::new(arrays.lend().with_many_bounds(many));
    let room = Capacity {
        stages: N + 5,
        rows: 0,
        active: MANY,
        ..Capacity::default()
    };
    let mut solution = Solution::allocate(room);
    let mut before = Solution::allocate(room);
    for ocp in problems(100) {
        solver.solve(&ocp, &cold(), &mut solution);
        assert_same(&ocp, &solution, &solve(&ocp));
        // From the active set of another problem.
        let warm = SolverSettings::default();
        let mut expected = before.clone();
        Solver::allocate(Capacity {
            rows: MANY,
            ..capacity(&ocp)
        })
        .solve(&ocp, &warm, &mut expected);
        solver.solve(&ocp, &warm, &mut before);
        assert_same(&ocp, &before, &expected);
    }
}

/// The stages that a problem has beyond its horizon are not read.
#[test]
fn a_horizon_shorter_than_the_problem_is_a_shorter_problem() {
    for mut ocp in problems(100) {
        let n = ocp.horizon;
        let expected = solve(&Problem {
            stages: ocp.stages.clone().shortened(n),
            own: ocp.own.clone().shortened(n),
            rows: ocp.rows.clone().shortened(n + 1),
            ..ocp.clone()
        });
        for stage in &mut ocp.stages[n..] {
            (stage.a, stage.b) = (stage.a * f64::NAN, stage.b * f64::NAN);
        }
        assert_same(&ocp, &solve(&ocp), &expected);
    }
}

/// Problem, solver or solution without room for the horizon: no search, but inputs within bounds that do
/// not contain zero, and no active bounds left from before.
#[test]
fn a_horizon_without_memory_is_said() {
    let pushing = Bounds {
        lower: SVector::repeat(0.5),
        upper: SVector::repeat(2.0),
    };
    let room = Capacity {
        stages: N,
        rows: 60,
        active: 60,
        ..Capacity::default()
    };
    for mut ocp in problems(20) {
        ocp.own = List::empty();
        ocp.common.u = pushing;
        ocp.horizon = N;
        for stages in [0, 1, N - 1] {
            let short = Capacity { stages, ..room };
            let cut = Problem {
                stages: ocp.stages.clone().shortened(stages),
                ..ocp.clone()
            };
            for (ocp, of_solver, of_solution) in
                [(&ocp, short, room), (&ocp, room, short), (&cut, room, room)]
            {
                let mut solution = Solution::allocate(of_solution);
                let mut solver = Solver::allocate(of_solver);
                for _ in 0..2 {
                    solver.solve(ocp, &SolverSettings::default(), &mut solution);
                    assert_eq!(solution.status, Status::HorizonTooLong);
                    assert!(solution.active.is_empty());
                    assert!(solution.u.iter().all(|u| pushing.contains(u, 0.0)));
                }
            }
        }
        // With room it is a problem like any other.
        let mut solution = Solution::allocate(room);
        Solver::allocate(room).solve(&ocp, &cold(), &mut solution);
        assert!(solution.status != Status::HorizonTooLong);
    }
}

/// A problem of no stages at all is one that there is no memory for.
#[test]
fn a_problem_without_stages_is_too_long() {
    for equality in [None, Some(SVector::repeat(1.0))] {
        let mut ocp = Problem::allocate(0);
        ocp.terminal.equality = equality;
        let solution = solve(&ocp);
        assert_eq!(solution.status, Status::HorizonTooLong);
    }
}

/// Too few rows for the search, or for its answer.
#[test]
fn too_few_rows_are_said() {
    let mut seen = 0;
    for ocp in problems(20) {
        let room = capacity(&ocp);
        let expected = solve(&ocp);
        let needed = expected.active.len();
        if !expected.status.is_solved() || needed == 0 {
            continue;
        }
        for rows in [0, needed - 1] {
            let few = Capacity {
                rows,
                active: rows,
                ..room
            };
            let only_active = Capacity {
                active: rows,
                ..room
            };
            for (of_solver, of_solution) in [(few, room), (room, only_active)] {
                let mut solution = Solution::allocate(of_solution);
                Solver::allocate(of_solver).solve(&ocp, &cold(), &mut solution);
                for (i, u) in solution.u.iter().enumerate().take(ocp.length()) {
                    assert!(ocp.common_at(i).u.contains(u, 0.0));
                }
                if of_solution == only_active {
                    assert_eq!(solution.status, Status::WorkingSetFull);
                }
                assert!(matches!(
                    kind(&solution.status),
                    "working set full" | "solved"
                ));
                seen += usize::from(solution.status == Status::WorkingSetFull);
            }
        }
    }
    assert!(seen > 200, "{seen}");
}

/// Weights and bounds that every stage has of its own, all the same ones, are those in common; what has
/// none of its own has those in common.
#[test]
fn own_weights_and_bounds_are_those_in_common_where_they_are_missing() {
    for ocp in problems(100) {
        if ocp.own.is_empty() {
            let own = Problem {
                own: List::repeat(ocp.common, N),
                ..ocp.clone()
            };
            assert_same(&ocp, &solve(&own), &solve(&ocp));
        } else {
            let mut longer = ocp.clone();
            let mut shorter = ocp.clone();
            let kept = ocp.horizon / 2;
            shorter.own = ocp.own.clone().shortened(kept);
            longer.own[kept..].fill(ocp.common);
            assert_same(&ocp, &solve(&shorter), &solve(&longer));
        }
    }
}

/// A general row that is one component of state or input bounds it like the bounds of that component, at
/// the stages that have it.
#[test]
fn general_rows_at_some_stages_only() {
    let mut active = 0;
    for seed in 0..300 {
        let mut rng = Rng::new(seed);
        let mut bounded: Problem = problem(&mut rng, Family::Tight, N, 0);
        let n = bounded.horizon;
        let mut with_rows = bounded.clone();
        (with_rows.rows, with_rows.rows_per_stage) =
            (List::repeat(GeneralRow::default(), 2 * (N + 1)), 2);
        let infinite = f64::INFINITY;
        for i in 1..n {
            // Where the bounds go, the rows come; which of the two is drawn.
            let (of_x, of_u) = (rng.index(NX), rng.index(NU));
            if rng.chance(0.5) {
                let row = &mut with_rows.rows[2 * i];
                let Bounds { lower, upper } = &mut with_rows.own[i].x;
                row.x[of_x] = 1.0;
                (row.lower, row.upper) = (lower[of_x], upper[of_x]);
                (lower[of_x], upper[of_x]) = (-infinite, infinite);
            }
            if rng.chance(0.5) {
                let row = &mut with_rows.rows[2 * i + 1];
                let Bounds { lower, upper } = &mut with_rows.own[i].u;
                row.u[of_u] = 1.0;
                (row.lower, row.upper) = (lower[of_u], upper[of_u]);
                (lower[of_u], upper[of_u]) = (-infinite, infinite);
            }
        }
        // At the end there is no input: its coefficients count for nothing.
        let row = &mut with_rows.rows[2 * n];
        let Bounds { lower, upper } = &mut with_rows.terminal.x;
        (row.x[0], row.u) = (1.0, SVector::repeat(1e3));
        (row.lower, row.upper) = (lower[0], upper[0]);
        (lower[0], upper[0]) = (-infinite, infinite);
        // And a row behind the end is none.
        if let Some(beyond) = with_rows.rows.get_mut(2 * (n + 1)) {
            (beyond.x[0], beyond.lower) = (1.0, 1e6);
        }

        let (found, expected) = (solve(&with_rows), solve(&bounded));
        assert!(found.status.is_solved() && expected.status.is_solved());
        assert!(kkt_residual(&with_rows, &found).largest() <= 1e-8);
        let error = (found.cost - expected.cost).abs();
        assert!(
            error <= 1e-9 * expected.cost.abs().max(1.0),
            "{seed}: {error:e}"
        );
        for (a, b) in found.u.iter().zip(&expected.u).take(n) {
            assert!((a - b).amax() <= 1e-6 * (1.0 + a.amax()), "{seed}");
        }
        let Verdict::Solved { primal } = clarabel::solve(&with_rows).unwrap() else {
            panic!("{seed}");
        };
        let error = (found.cost - primal).abs();
        assert!(error <= 1e-6 * primal.abs().max(1.0), "{seed}: {error:e}");
        let of_rows =
            |row: &lpvmpc::ActiveRow<f64>| matches!(row.bound.quantity, lpvmpc::Quantity::Row(_));
        active += found.active.iter().filter(of_rows).count();

        // A list that ends where the rows do is enough.
        let last = if rng.chance(0.5) { 1 } else { n / 2 };
        for row in &mut with_rows.rows[2 * last..] {
            *row = GeneralRow::default();
        }
        bounded = with_rows.clone();
        bounded.rows = bounded.rows.shortened(2 * last);
        assert_same(&bounded, &solve(&bounded), &solve(&with_rows));
    }
    assert!(active > 300, "{active} active rows");
}

/// One solver and one solution for problems whose horizons go up and down: nothing outlives a solve.
#[test]
fn nothing_is_left_from_a_longer_problem() {
    let room = Capacity {
        stages: N,
        rows: 60,
        active: 60,
        ..Capacity::default()
    };
    let mut solver = Solver::allocate(room);
    for ocp in problems(100) {
        let mut found = Solution::allocate(room);
        solver.solve(&ocp, &cold(), &mut found);
        assert_same(&ocp, &found, &solve_with(&ocp, &cold()));
    }
}

/// Rows that fill the space of the inputs are all that can be independent: with that many places in the
/// working set, and a place in the list for every bound, a hard problem has the verdict that it has with
/// any number of them.
#[test]
fn rows_that_fill_the_space_of_the_inputs_are_enough() {
    for (family, k) in [(Family::Infeasible, 56), (Family::Tight, 0)] {
        let mut rng = Rng::new(7 << 40 | k << 8 | family as u64);
        let ocp: Ocp<f64, 3, 1> = problem(&mut rng, family, 100, 0);
        let least = Capacity {
            stages: 100,
            rows: 103,
            active: 403,
            ..Capacity::default()
        };
        let mut solution = Solution::allocate(least);
        Solver::allocate(least).solve(&ocp, &cold(), &mut solution);
        assert_eq!(
            kind(&solution.status),
            kind(&solve(&ocp).status),
            "{family:?} {k}"
        );
    }
}
