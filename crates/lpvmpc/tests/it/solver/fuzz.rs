//! Arbitrary numbers, most of them nonsense: no panic, no endless search, no input that is not
//! finite or out of bounds, and a status that does not promise too much.

use super::support::census::Counts;
use super::support::kind;
use lpvmpc::{
    Bounds, Capacity, GeneralRow, List, Ocp, Penalty, Solution, Solver, SolverSettings, Status,
    WarmStart, cost, kkt_residual,
};
use lpvmpc_testkit::problems::{Family, problem};
use lpvmpc_testkit::rng::Rng;
use nalgebra::{SMatrix, Vector1};

const N: usize = 8;
const ROOM: Capacity = Capacity {
    stages: N,
    rows: 30,
    active: 30,
    own_stages: 0,
    general_rows: 0,
    second_plan: false,
};

/// A number that someone should have checked; finite ones are at most `largest`.
fn nonsense(rng: &mut Rng, largest: f64) -> f64 {
    let sign = if rng.chance(0.5) { 1.0 } else { -1.0 };
    match rng.index(9) {
        0 => f64::NAN,
        1 => f64::INFINITY * sign,
        2 => largest * sign,
        3 => largest.sqrt() * sign,
        4 => largest.powf(0.25) * sign,
        5 => 1e-300 * sign,
        6 => f64::MIN_POSITIVE * sign,
        7 => 0.0,
        _ => sign * rng.power_of_ten(-3.0, 3.0),
    }
}

fn spoil<const R: usize, const C: usize>(rng: &mut Rng, largest: f64, m: &mut SMatrix<f64, R, C>) {
    let place = rng.index(R * C);
    m[place] = nonsense(rng, largest);
}

/// Weights stay symmetric: of one that is not, the answer means nothing.
fn spoil_weight<const K: usize>(rng: &mut Rng, largest: f64, m: &mut SMatrix<f64, K, K>) {
    let (row, column) = (rng.index(K), rng.index(K));
    m[(row, column)] = nonsense(rng, largest);
    m[(column, row)] = m[(row, column)];
}

fn spoil_bounds<const K: usize>(rng: &mut Rng, largest: f64, bounds: &mut Bounds<f64, K>) {
    let j = rng.index(K);
    match rng.index(3) {
        0 => bounds.lower[j] = nonsense(rng, largest),
        1 => bounds.upper[j] = nonsense(rng, largest),
        _ => std::mem::swap(&mut bounds.lower[j], &mut bounds.upper[j]),
    }
}

fn spoil_row<const NX: usize, const NU: usize>(
    rng: &mut Rng,
    largest: f64,
    row: &mut GeneralRow<f64, NX, NU>,
) {
    let mut bounds = Bounds {
        lower: Vector1::new(row.lower),
        upper: Vector1::new(row.upper),
    };
    spoil_bounds(rng, largest, &mut bounds);
    (row.lower, row.upper) = (bounds.lower[0], bounds.upper[0]);
}

fn spoil_problem<const NX: usize, const NU: usize>(
    rng: &mut Rng,
    largest: f64,
    ocp: &mut Ocp<f64, NX, NU>,
) {
    let i = rng.index(N);
    if ocp.own.is_empty() {
        ocp.own = List::repeat(ocp.common, N);
    }
    let (stage, common, row) = (&mut ocp.stages[i], &mut ocp.own[i], &mut ocp.rows[i]);
    match rng.index(20) {
        0 => spoil(rng, largest, &mut stage.a),
        1 => spoil(rng, largest, &mut stage.b),
        2 => spoil(rng, largest, &mut stage.c),
        3 => spoil_weight(rng, largest, &mut common.q),
        4 => spoil_weight(rng, largest, &mut common.r),
        5 => spoil(rng, largest, &mut common.s),
        6 => spoil(rng, largest, &mut stage.linear_x),
        7 => spoil(rng, largest, &mut stage.linear_u),
        8 => spoil_bounds(rng, largest, &mut common.x),
        9 => spoil_bounds(rng, largest, &mut common.u),
        10 => spoil_row(rng, largest, row),
        11 => spoil(rng, largest, &mut row.x),
        12 => spoil(rng, largest, &mut row.u),
        13 => {
            common.soft_x[rng.index(NX)] = Some(Penalty {
                linear: nonsense(rng, largest).abs(),
                quadratic: nonsense(rng, largest).abs(),
            });
        }
        14 => spoil(rng, largest, &mut ocp.x0),
        15 => spoil_weight(rng, largest, &mut ocp.terminal.p),
        16 => spoil(rng, largest, &mut ocp.terminal.linear_x),
        17 => spoil_bounds(rng, largest, &mut ocp.terminal.x),
        18 => {
            let mut target = ocp.x0;
            spoil(rng, largest, &mut target);
            ocp.terminal.equality = Some(target);
        }
        _ => ocp.horizon = [0, 1, N, N + 1, usize::MAX][rng.index(5)],
    }
}

/// Whether `value` may be asked to lie within these bounds.
fn consistent<const NU: usize>(bounds: &Bounds<f64, NU>) -> bool {
    let sides = bounds.lower.iter().zip(bounds.upper.iter());
    sides
        .into_iter()
        .all(|(l, u)| l <= u && *l < f64::INFINITY && *u > f64::NEG_INFINITY)
}

fn check<const NX: usize, const NU: usize>(
    ocp: &Ocp<f64, NX, NU>,
    settings: &SolverSettings<f64>,
    solution: &Solution<f64, NX, NU>,
) {
    assert!(
        settings
            .max_changes
            .is_none_or(|most| solution.changes <= most),
        "{}",
        solution.changes
    );
    for (i, u) in solution.u.iter().enumerate().take(ocp.horizon.max(1)) {
        let bounds = &ocp.common_at(i).u;
        assert!(u.iter().all(|entry| entry.is_finite()), "{u}");
        assert!(!consistent(bounds) || bounds.contains(u, 0.0), "{u}");
    }
    if solution.status.is_solved() {
        assert!(cost(ocp, solution).is_finite());
    }
    if let Status::Infeasible(bound) = solution.status {
        assert!(bound.stage <= ocp.length());
    }
}

#[test]
fn nonsense_in_the_problem() {
    nonsense_in_problems::<3, 2>();
    // Of a single input the last answer's bounds are held.
    nonsense_in_problems::<4, 1>();
}

fn nonsense_in_problems<const NX: usize, const NU: usize>() {
    let mut statuses = Counts::default();
    let mut solver = Solver::allocate(ROOM);
    let mut solution = Solution::allocate(ROOM);
    let mut sound = None;
    for k in 0..150_000 {
        let mut rng = Rng::new(k);
        let family = Family::ALL[rng.index(Family::ALL.len())];
        let last = sound.take().filter(|_| rng.chance(0.5));
        let mut ocp = last.unwrap_or_else(|| problem::<NX, NU>(&mut rng, family, N, 1));
        sound = Some(ocp.clone());
        let largest = [1e4, 1e300][rng.index(2)];
        for _ in 0..1 + rng.index(3) {
            spoil_problem(&mut rng, largest, &mut ocp);
        }
        let settings = SolverSettings {
            max_changes: Some([0, 1, 5, 300][rng.index(4)]),
            warm_start: [WarmStart::Cold, WarmStart::Same, WarmStart::Shifted][rng.index(3)],
            ..SolverSettings::default()
        };
        // The previous solution, of an unrelated problem or of the same with other nonsense, is the warm start.
        solver.solve(&ocp, &settings, &mut solution);
        check(&ocp, &settings, &solution);
        if solution.status.is_solved() && largest < 1e100 {
            // Neither is NaN hidden in the answer, nor far from the optimum.
            let residual = kkt_residual(&ocp, &solution);
            let multipliers = solution.active.iter().map(|row| row.multiplier.abs());
            let forces = multipliers.fold(1.0, f64::max);
            let limit = (1e-6 * forces).min(1e-4).max(1e-9 * forces);
            assert!(residual.largest() <= limit, "{k}: {residual:?}");
        }
        statuses.add(kind(&solution.status));
    }
    println!("{statuses}");
    for status in [
        "solved",
        "infeasible",
        "maximum of changes",
        "numerical failure",
        "not finite",
        "horizon too long",
    ] {
        assert!(statuses.of(status) > 100, "{status}: {statuses}");
    }
}

/// Every number from the same bag: nothing of the problem's structure is left.
#[test]
fn nothing_but_nonsense() {
    no_structure::<3, 2>();
    no_structure::<4, 1>();
}

fn no_structure<const NX: usize, const NU: usize>() {
    let mut solver = Solver::allocate(ROOM);
    let mut solution = Solution::allocate(ROOM);
    for k in 0..30_000 {
        let mut rng = Rng::new(k);
        let mut ocp = Ocp::<f64, NX, NU>::allocate(N);
        (ocp.rows, ocp.rows_per_stage) = (List::repeat(GeneralRow::default(), N + 1), 1);
        let mildness = rng.uniform(0.0, 1.0);
        for _ in 0..200 {
            if rng.chance(mildness) {
                spoil_problem(&mut rng, 1e300, &mut ocp);
            }
        }
        let settings = SolverSettings {
            tolerance: nonsense(&mut rng, 1e300),
            max_changes: Some(200),
            warm_start: WarmStart::Same,
        };
        solver.solve(&ocp, &settings, &mut solution);
        check(&ocp, &settings, &solution);
    }
}

/// One NaN in a number that matters is never answered with "solved".
#[test]
fn one_number_that_is_none() {
    one_nan::<3, 2>();
    one_nan::<4, 1>();
}

fn one_nan<const NX: usize, const NU: usize>() {
    let mut solver = Solver::allocate(ROOM);
    for k in 0..20_000 {
        let mut rng = Rng::new(k);
        let mut ocp = problem::<NX, NU>(&mut rng, Family::Tight, N, 1);
        let i = rng.index(ocp.horizon);
        let (stage, common) = (&mut ocp.stages[i], &mut ocp.own[i]);
        let (row, column, input) = (rng.index(NX), rng.index(NX), rng.index(NU));
        match rng.index(12) {
            0 => stage.a[(row, column)] = f64::NAN,
            1 => stage.b[(row, input)] = f64::NAN,
            2 => stage.c[row] = f64::NAN,
            3 => common.q[(row, column)] = f64::NAN,
            4 => common.r[(input, input)] = f64::NAN,
            5 => common.s[(input, column)] = f64::NAN,
            6 => stage.linear_x[row] = f64::NAN,
            7 => stage.linear_u[input] = f64::NAN,
            8 => common.u.lower[input] = f64::NAN,
            9 => ocp.terminal.x.upper[row] = f64::NAN,
            10 => ocp.terminal.p[(row, column)] = f64::NAN,
            _ => ocp.x0[row] = f64::NAN,
        }
        let mut solution = Solution::allocate(ROOM);
        solver.solve(&ocp, &SolverSettings::default(), &mut solution);
        assert_eq!(solution.status, Status::NotFinite, "{k}");
    }
}

/// Lists of any length, memory of any size: what there is no memory for is not begun, and said.
#[test]
fn sizes_that_do_not_fit() {
    any_sizes::<3, 2>();
    any_sizes::<4, 1>();
}

fn any_sizes<const NX: usize, const NU: usize>() {
    let mut statuses = Counts::default();
    for k in 0..60_000 {
        let mut rng = Rng::new(k);
        let family = Family::ALL[rng.index(Family::ALL.len())];
        let mut ocp = problem::<NX, NU>(&mut rng, family, N, 1);
        let sizes = [0, 1, N - 1, N, N + 1];
        let size = |rng: &mut Rng| sizes[rng.index(sizes.len())];
        for _ in 0..1 + rng.index(3) {
            let length = size(&mut rng);
            match rng.index(5) {
                0 => ocp.stages = ocp.stages.shortened(length),
                1 => ocp.own = List::repeat(ocp.common_at(0).to_owned(), length),
                2 => ocp.rows = ocp.rows.shortened(length),
                3 => ocp.rows_per_stage = [0, 2, N, usize::MAX][rng.index(4)],
                _ => ocp.horizon = [length, usize::MAX][rng.index(2)],
            }
        }
        let mut room = || Capacity {
            stages: size(&mut rng),
            rows: size(&mut rng) * NU,
            active: size(&mut rng) * NU,
            ..Capacity::default()
        };
        let (of_solver, of_solution) = (room(), room());
        let mut solution = Solution::allocate(of_solution);
        let settings = SolverSettings {
            max_changes: Some(300),
            ..SolverSettings::default()
        };
        for _ in 0..2 {
            Solver::allocate(of_solver).solve(&ocp, &settings, &mut solution);
            check(&ocp, &settings, &solution);
            let places = [ocp.stages.len(), of_solver.stages, of_solution.stages];
            let too_long = places.iter().any(|places| *places < ocp.horizon.max(1));
            assert_eq!(solution.status == Status::HorizonTooLong, too_long, "{k}");
            if solution.status.is_solved() {
                let residual = kkt_residual(&ocp, &solution);
                assert!(residual.largest() <= 1e-8, "{k}: {residual:?}");
            }
        }
        statuses.add(kind(&solution.status));
    }
    println!("{statuses}");
    for status in [
        "solved",
        "infeasible",
        "working set full",
        "horizon too long",
    ] {
        assert!(statuses.of(status) > 100, "{status}: {statuses}");
    }
}
