//! How many changes of the active set a search needs, and what the default cap makes of it.
//!
//! Run with `--nocapture` for the figures.

use super::many_bounds::Both;
use super::support::census::{Counts, Distribution};
use super::support::{capacity, kind, solve_with};
use lpvmpc::{
    Bounds, List, Ocp, Solution, Solver, SolverSettings, Status, WarmStart, kkt_residual,
};
use lpvmpc_testkit::problems::{Family, problem};
use lpvmpc_testkit::rng::Rng;
use nalgebra::{DMatrix, SVector};

/// What [`SolverSettings::max_changes`] promises where nothing is set, per state, input and general
/// row of a stage.
const DEFAULT: usize = 10;

/// The number that was the default for every size.
const CONSTANT: usize = 500;

/// The searches of one size.
#[derive(Default)]
struct Findings {
    verdicts: Counts,
    /// Changes over the default cap.
    used: Distribution,
    beyond_constant: usize,
}

/// `count` problems of every family and as many with saturated inputs, each from a cold start and, a
/// little moved, from the answer.
fn sweep<const NX: usize, const NU: usize>(longest: usize, rows: usize, count: u64) {
    let mut findings = Findings::default();
    for k in 0..count {
        for family in Family::ALL {
            let mut rng = Rng::new(k << 8 | family as u64);
            findings.search(&mut problem::<NX, NU>(&mut rng, family, longest, rows));
        }
        findings.search(&mut saturated::<NX, NU>(&mut Rng::new(k), longest, rows));
    }
    let Findings {
        verdicts,
        used,
        beyond_constant,
    } = findings;
    println!(
        "{NX} {NU} {longest} {rows}: {} searches: {verdicts}; of the default: {used}; \
         {beyond_constant} needed more than {CONSTANT}",
        used.len()
    );
    assert!(verdicts.of("working set full") == 0, "{verdicts}");
    assert!(verdicts.of("maximum of changes") == 0, "{verdicts}");
}

impl Findings {
    fn search<const NX: usize, const NU: usize>(&mut self, ocp: &mut Ocp<f64, NX, NU>) {
        let cap = DEFAULT * ocp.length() * (NX + NU + ocp.rows_per_stage);
        let mut solver = Solver::allocate(capacity(ocp));
        let mut solution = Solution::allocate(capacity(ocp));
        for _ in 0..2 {
            solver.solve(ocp, &SolverSettings::default(), &mut solution);
            assert!(solution.changes <= cap, "{} of {cap}", solution.changes);
            self.verdicts.add(kind(&solution.status));
            self.used.add(solution.changes as f64 / cap as f64);
            self.beyond_constant += usize::from(solution.changes > CONSTANT);
            ocp.x0 *= 1.02;
        }
    }
}

/// An unstable plant whose inputs have little room: most are at a bound, and other ones at last than
/// those that the regulator saturates first. Its free motion grows at most a millionfold.
pub fn saturated<const NX: usize, const NU: usize>(
    rng: &mut Rng,
    longest: usize,
    rows: usize,
) -> Ocp<f64, NX, NU> {
    let mut ocp = problem::<NX, NU>(rng, Family::Loose, longest, rows);
    let a = DMatrix::from_column_slice(NX, NX, ocp.stages[0].a.as_slice());
    let radius = a.complex_eigenvalues().map(|z| z.norm()).max();
    let growth = 1e6_f64.powf(1.0 / ocp.length() as f64);
    let growth = rng.power_of_ten(0.0, 0.5).min(growth);
    let limit = SVector::repeat(rng.power_of_ten(-3.0, 0.3));
    for stage in &mut ocp.stages {
        stage.a *= growth / radius;
    }
    ocp.own = List::empty();
    (ocp.common.u.lower, ocp.common.u.upper) = (-limit, limit);
    ocp.terminal.x = Bounds::none();
    for row in &mut ocp.rows {
        (row.lower, row.upper) = (f64::NEG_INFINITY, f64::INFINITY);
    }
    ocp
}

#[test]
fn the_default_cap_grows_with_the_problem() {
    sweep::<4, 1>(5, 1, 20);
    sweep::<2, 1>(20, 0, 20);
    sweep::<4, 1>(20, 1, 20);
    sweep::<8, 2>(20, 1, 10);
    sweep::<6, 3>(30, 2, 10);
    sweep::<4, 1>(100, 0, 10);
    sweep::<12, 4>(50, 0, 4);
    sweep::<8, 2>(100, 1, 3);
    sweep::<4, 1>(200, 1, 4);
}

/// A search on 200 stages that a constant for short horizons has cut off, where bounds are taken one by one.
#[test]
fn a_long_horizon_gets_the_changes_that_it_needs() {
    let mut ocp = saturated::<4, 1>(&mut Rng::new(12), 200, 0);
    ocp.horizon = 200;
    let Both {
        at_once: (mut at_once, mut answer),
        one_by_one: (mut one_by_one, mut solution),
    } = Both::<4, 1>::new::<200, 300>();
    one_by_one.solve(&ocp, &SolverSettings::default(), &mut solution);
    assert_eq!(solution.status, Status::Solved);
    assert!(solution.changes > CONSTANT, "{}", solution.changes);
    let residual = kkt_residual(&ocp, &solution).largest();
    assert!(residual < 1e-8, "{residual:.1e}");

    at_once.solve(&ocp, &SolverSettings::default(), &mut answer);
    assert_eq!(answer.status, Status::Solved);
    assert!(answer.changes <= CONSTANT, "{}", answer.changes);
    let difference = (answer.u[0] - solution.u[0]).amax();
    assert!(difference < 1e-8, "{difference:.1e}");

    // A number that is set still holds.
    let set = SolverSettings {
        max_changes: Some(CONSTANT),
        warm_start: WarmStart::Cold,
        ..SolverSettings::default()
    };
    for (mut solver, mut solution) in [(one_by_one, solution), (at_once, answer)] {
        solver.solve(&ocp, &set, &mut solution);
        assert_eq!(solution.status, Status::MaxChanges);
        assert_eq!(solution.changes, CONSTANT);
    }
}

/// Inputs that cannot hold the plant over the horizon: their bounds drowned in rounding, which the search noticed only at its
/// end. Which of these problems are solved depends on the order of sums and changes; of the first dozen it was 6 and then 9, of
/// all of them 32 before an order of changes had a second one behind it.
#[test]
fn a_search_that_rounding_leads_astray_ends() {
    let (mut solved, mut changes) = (0, 0);
    for seed in 0..60 {
        let mut ocp = saturated::<4, 2>(&mut Rng::new(seed), 120, 0);
        ocp.horizon = 120;
        let a = DMatrix::from_column_slice(4, 4, ocp.stages[0].a.as_slice());
        let radius = a.complex_eigenvalues().map(|z| z.norm()).max();
        for stage in &mut ocp.stages {
            stage.a *= 1.5 / radius;
        }
        let solution = solve_with(&ocp, &SolverSettings::default());
        println!("{seed} {} {}", solution.changes, solution.status);
        changes += solution.changes;
        // The free motion grows by 1e21: no residual that goes along it backward means anything.
        solved += usize::from(solution.status == Status::Solved);
    }
    assert!(
        solved >= 40 && changes < 80_000,
        "{solved} solved, {changes}"
    );
}
