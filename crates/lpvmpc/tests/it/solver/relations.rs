//! Relations that hold exactly between the answers to different problems.

use super::support::{agree, capacity, cold, solve};
use lpvmpc::{
    Bounds, Common, Ocp, Penalty, Side, Solution, Solver, SolverSettings, WarmStart, kkt_residual,
};
use lpvmpc_testkit::problems::{Family, each_common, problem};
use lpvmpc_testkit::rng::Rng;
use proptest::prelude::*;

const NX: usize = 4;
const NU: usize = 2;
type Problem = Ocp<f64, NX, NU>;
type Answer = Solution<f64, NX, NU>;

fn random_problem(seed: u64) -> Problem {
    let mut rng = Rng::new(seed);
    let family = Family::ALL[rng.index(Family::ALL.len())];
    problem(&mut rng, family, 10, 1)
}

fn answer(ocp: &Problem, start: WarmStart, before: &Answer) -> Answer {
    let settings = SolverSettings {
        warm_start: start,
        ..cold()
    };
    let room = capacity(ocp);
    let mut solution = Answer::allocate(room);
    (solution.u, solution.x) = (before.u.clone(), before.x.clone());
    (solution.status, solution.cost) = (before.status, before.cost);
    solution.active.copy_from(&before.active);
    Solver::allocate(room).solve(ocp, &settings, &mut solution);
    solution
}

/// The same verdict, and the same optimum.
fn assert_same(ocp: &Problem, one: &Answer, other: &Answer) -> Result<(), TestCaseError> {
    prop_assert!(agree(&one.status, &other.status));
    if one.status.is_solved() {
        prop_assert!(kkt_residual(ocp, other).largest() <= 1e-8);
        let scale = one.cost.abs().max(1.0);
        prop_assert!((one.cost - other.cost).abs() <= 1e-9 * scale);
        for (a, b) in one.u.iter().zip(&other.u).take(ocp.length()) {
            prop_assert!((a - b).amax() <= 1e-6 * (1.0 + a.amax()), "{} {}", a, b);
        }
    }
    Ok(())
}

/// The problem in -x and -u.
fn mirrored(ocp: &Problem) -> Problem {
    fn flip<const K: usize>(bounds: &Bounds<f64, K>) -> Bounds<f64, K> {
        Bounds {
            lower: -bounds.upper,
            upper: -bounds.lower,
        }
    }
    let mut mirror = ocp.clone();
    mirror.x0 = -ocp.x0;
    for stage in &mut mirror.stages {
        stage.c = -stage.c;
        stage.linear_x = -stage.linear_x;
        stage.linear_u = -stage.linear_u;
    }
    for Common { x, u, .. } in each_common(&mut mirror) {
        (*x, *u) = (flip(x), flip(u));
    }
    for row in &mut mirror.rows {
        (row.lower, row.upper) = (-row.upper, -row.lower);
    }
    mirror.terminal.linear_x = -ocp.terminal.linear_x;
    mirror.terminal.x = flip(&ocp.terminal.x);
    mirror.terminal.equality = ocp.terminal.equality.map(|target| -target);
    mirror
}

/// The problem with all prices multiplied by `factor`.
fn dearer(ocp: &Problem, factor: f64) -> Problem {
    let price = |soft: Option<Penalty<f64>>| {
        soft.map(|price| Penalty {
            linear: price.linear * factor,
            quadratic: price.quadratic * factor,
        })
    };
    let mut scaled = ocp.clone();
    for stage in &mut scaled.stages {
        stage.linear_x *= factor;
        stage.linear_u *= factor;
    }
    for Common {
        q, r, s, soft_x, ..
    } in each_common(&mut scaled)
    {
        *q *= factor;
        *r *= factor;
        *s *= factor;
        *soft_x = soft_x.map(price);
    }
    for row in &mut scaled.rows {
        row.soft = price(row.soft);
    }
    scaled.terminal.p *= factor;
    scaled.terminal.linear_x *= factor;
    scaled.terminal.soft_x = scaled.terminal.soft_x.map(price);
    scaled
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 800, failure_persistence: None, ..ProptestConfig::default() })]

    /// Whatever was active before: the same problem's rows, the rows one stage later, or rows
    /// of a problem that has nothing to do with this one.
    #[test]
    fn warm_start_never_changes_the_answer(seed: u64, other: u64) {
        let ocp = random_problem(seed);
        let reference = solve(&ocp);
        let unrelated = solve(&random_problem(other));
        for before in [&reference, &unrelated] {
            for start in [WarmStart::Cold, WarmStart::Same, WarmStart::Shifted] {
                assert_same(&ocp, &reference, &answer(&ocp, start, before))?;
            }
        }
    }

    #[test]
    fn the_mirror_image_has_the_mirrored_answer(seed: u64) {
        let ocp = random_problem(seed);
        let reference = solve(&ocp);
        let mut reflection = solve(&mirrored(&ocp));
        reflection.u.iter_mut().for_each(|u| *u = -*u);
        reflection.x.iter_mut().for_each(|x| *x = -*x);
        prop_assert!(agree(&reference.status, &reflection.status));
        if reference.status.is_solved() {
            for (a, b) in reference.u.iter().zip(&reflection.u).take(ocp.length()) {
                prop_assert!((a - b).amax() <= 1e-6 * (1.0 + a.amax()));
            }
            let sides = |answer: &Answer, side| {
                answer.active.iter().filter(|row| row.bound.side == side && row.multiplier > 1e-6).count()
            };
            prop_assert_eq!(sides(&reference, Side::Lower), sides(&reflection, Side::Upper));
            prop_assert_eq!(sides(&reference, Side::Upper), sides(&reflection, Side::Lower));
        }
    }

    #[test]
    fn the_cost_scales_with_the_prices(seed: u64, exponent in -4.0..4.0f64) {
        let factor = 10f64.powf(exponent);
        let ocp = random_problem(seed);
        let reference = solve(&ocp);
        let scaled = solve(&dearer(&ocp, factor));
        prop_assert!(agree(&reference.status, &scaled.status));
        if reference.status.is_solved() {
            let size = reference.cost.abs().max(1.0);
            prop_assert!((scaled.cost / factor - reference.cost).abs() <= 1e-9 * size);
            for (a, b) in reference.u.iter().zip(&scaled.u).take(ocp.length()) {
                prop_assert!((a - b).amax() <= 1e-6 * (1.0 + a.amax()));
            }
        }
    }
}

/// Where the multipliers are unique, they scale one by one.
#[test]
fn unique_multipliers_scale_one_by_one() {
    for seed in 0..200 {
        let mut rng = Rng::new(seed);
        let ocp: Problem = problem(&mut rng, Family::Loose, 10, 1);
        let reference = solve(&ocp);
        let scaled = solve(&dearer(&ocp, 64.0));
        for row in reference.active.iter() {
            let same = scaled.active.iter().find(|other| other.bound == row.bound);
            let multiplier = same.map_or(0.0, |other| other.multiplier);
            let error = (multiplier / 64.0 - row.multiplier).abs();
            assert!(
                error <= 1e-6 * (1.0 + row.multiplier),
                "{seed}: {row:?} {same:?}"
            );
        }
    }
}
