//! Random problems: the optimality conditions of all, the verdict and the cost of many by
//! Clarabel, and, where Clarabel gives up, by an exact dense route.
//!
//! Run with `--nocapture` for the figures.

use super::support::census::{Counts, Distribution};
use super::support::least_distance;
use super::support::{kind, solve};
use lpvmpc::{KktResidual, Ocp, Solution, cost, kkt_residual};
use lpvmpc_testkit::clarabel::{self, Verdict};
use lpvmpc_testkit::dense::DenseQp;
use lpvmpc_testkit::problems::{Family, problem};
use lpvmpc_testkit::rng::Rng;
use nalgebra::DVector;

/// How many problems of one size, of every family.
struct Campaign {
    families: &'static [Family],
    /// Problems that Clarabel solves too.
    compared: usize,
    /// Problems that are judged by their optimality conditions alone.
    more: usize,
}

/// What was found in one campaign.
#[derive(Default)]
struct Findings {
    verdicts: Counts,
    residual: Distribution,
    cost_error: Distribution,
    changes: Distribution,
    active: Distribution,
}

/// Largest residual of the optimality conditions of a problem that counts as solved.
const OPTIMAL: f64 = 1e-8;
/// Largest relative difference in cost from Clarabel.
const SAME_COST: f64 = 1e-7;

/// A verdict that rounding decides.
const NO_INTERIOR: &str = "infeasible where the feasible set has no interior";
/// A cost that Clarabel's tolerance decides.
const LOOSE_COST: &str = "cost within clarabel's own tolerance only";

impl Campaign {
    /// For problems with up to `longest` stages and `rows` general rows at each of them.
    fn run<const NX: usize, const NU: usize>(self, seed: u64, longest: usize, rows: usize) {
        let mut findings = Findings::default();
        for family in self.families {
            for k in 0..self.compared + self.more {
                let mut rng = Rng::new(seed << 40 | (k as u64) << 8 | *family as u64);
                let ocp = problem::<NX, NU>(&mut rng, *family, longest, rows);
                let place = format!("{family:?} {k} of size {NX} {NU} {longest}");
                let solution = examine(&ocp, *family, &place, &mut findings);
                if k < self.compared {
                    compare(&ocp, &solution, *family, &place, &mut findings);
                }
            }
        }
        findings.report(&format!("{NX} {NU} {longest}"));
        let few = 1 + findings.changes.len() / 1000;
        assert!(findings.verdicts.of(NO_INTERIOR) <= few);
        assert!(findings.verdicts.of(LOOSE_COST) <= few);
        // Without a proof it is not called infeasible: one in twenty at most.
        let unproved = findings.verdicts.of("inaccurate");
        assert!(unproved <= 1 + findings.verdicts.of("infeasible") / 20);
    }
}

/// Verdict, optimality conditions and input bounds of one problem.
fn examine<const NX: usize, const NU: usize>(
    ocp: &Ocp<f64, NX, NU>,
    family: Family,
    place: &str,
    findings: &mut Findings,
) -> Solution<f64, NX, NU> {
    let solution = solve(ocp);
    let verdict = kind(&solution.status);
    findings.verdicts.add(verdict);
    findings.changes.add(solution.changes as f64);
    match family.feasible() {
        Some(true) if family == Family::Degenerate && verdict == "infeasible" => {
            // The feasible set has no interior, often just one point: an arbitrarily small
            // change of a bound makes the problem infeasible. Counted, and limited at the end.
            findings.verdicts.add(NO_INTERIOR);
        }
        Some(true) => assert_eq!(verdict, "solved", "{place}"),
        // Unproved, it is not called infeasible: counted, and limited at the end.
        Some(false) => assert!(matches!(verdict, "infeasible" | "inaccurate"), "{place}"),
        None => assert!(
            matches!(verdict, "solved" | "infeasible" | "inaccurate"),
            "{place}"
        ),
    }
    for (i, u) in solution.u.iter().enumerate().take(ocp.length()) {
        assert!(
            ocp.common_at(i).u.contains(u, 0.0),
            "{place}: {u} outside its bounds"
        );
    }
    if verdict == "solved" {
        let residual: KktResidual<f64> = kkt_residual(ocp, &solution);
        assert!(residual.largest() <= OPTIMAL, "{place}: {residual:?}");
        assert_eq!(solution.cost, cost(ocp, &solution), "{place}");
        findings.residual.add(residual.largest());
        findings.active.add(solution.active.len() as f64);
    }
    solution
}

/// The other solvers' opinion.
fn compare<const NX: usize, const NU: usize>(
    ocp: &Ocp<f64, NX, NU>,
    solution: &Solution<f64, NX, NU>,
    family: Family,
    place: &str,
    findings: &mut Findings,
) {
    let solved = solution.status.is_solved();
    match clarabel::solve(ocp).unwrap() {
        Verdict::Solved { primal } if solved => {
            let error = (solution.cost - primal).abs() / primal.abs().max(1.0);
            findings.cost_error.add(error);
            if error > SAME_COST {
                findings.verdicts.add(LOOSE_COST);
                let settled = third_opinion(ocp, solution, place, findings);
                assert!(settled || explained(solution, primal), "{place}: {primal}");
            }
        }
        Verdict::Infeasible if !solved => findings.verdicts.add("infeasible for both"),
        Verdict::Infeasible if family.feasible() == Some(true) => {
            findings
                .verdicts
                .add("clarabel wrong: infeasible with a known feasible point");
        }
        Verdict::Undecided(status) => {
            findings
                .verdicts
                .add(format!("clarabel undecided: {status}"));
            third_opinion(ocp, solution, place, findings);
        }
        verdict => panic!("{place}: {verdict:?} against {:?}", solution.status),
    }
}

/// Clarabel meets the constraints to its tolerance only, which the multipliers turn into cost.
fn explained<const NX: usize, const NU: usize>(
    solution: &Solution<f64, NX, NU>,
    primal: f64,
) -> bool {
    let multipliers = solution.active.iter().map(|row| row.multiplier.abs());
    (solution.cost - primal).abs() <= 10.0 * clarabel::FEASIBILITY * multipliers.sum::<f64>()
}

/// The dense route, which must agree; `false` where it does not apply.
fn third_opinion<const NX: usize, const NU: usize>(
    ocp: &Ocp<f64, NX, NU>,
    solution: &Solution<f64, NX, NU>,
    place: &str,
    findings: &mut Findings,
) -> bool {
    let small = ocp.length() * NU <= 40;
    let Some(dense) = DenseQp::new(ocp).filter(|_| small) else {
        return false;
    };
    let optimum = least_distance::solve(&dense);
    assert_eq!(optimum.is_some(), solution.status.is_solved(), "{place}");
    if let Some(optimum) = optimum {
        let dense_cost = cost(ocp, &with_inputs(ocp, solution, &optimum));
        let error = (solution.cost - dense_cost).abs() / dense_cost.abs().max(1.0);
        assert!(
            error <= SAME_COST,
            "{place}: {} against {dense_cost}",
            solution.cost
        );
    }
    findings.verdicts.add("settled by the dense route");
    true
}

/// `solution` with other inputs, and the states that they lead to.
fn with_inputs<const NX: usize, const NU: usize>(
    ocp: &Ocp<f64, NX, NU>,
    solution: &Solution<f64, NX, NU>,
    inputs: &DVector<f64>,
) -> Solution<f64, NX, NU> {
    let mut other = solution.clone();
    let mut x = ocp.x0;
    for (i, stage) in ocp.stages.iter().enumerate().take(ocp.length()) {
        other.u[i].copy_from_slice(&inputs.as_slice()[i * NU..(i + 1) * NU]);
        x = stage.a * x + stage.b * other.u[i] + stage.c;
        other.x[i] = x;
    }
    other
}

impl Findings {
    fn report(&self, size: &str) {
        println!("{size}: {}", self.verdicts);
        println!("    residual   {}", self.residual);
        println!(
            "    cost error {} ({} compared)",
            self.cost_error,
            self.cost_error.len()
        );
        println!("    changes    {}", self.changes);
        println!("    active     {}", self.active);
    }
}

#[test]
fn smallest_with_a_general_row() {
    let campaign = Campaign {
        families: &Family::ALL,
        compared: 600,
        more: 3000,
    };
    campaign.run::<2, 1>(1, 10, 1);
}

#[test]
fn more_inputs_than_states_two_general_rows() {
    let campaign = Campaign {
        families: &Family::ALL,
        compared: 600,
        more: 2500,
    };
    campaign.run::<2, 3>(2, 6, 2);
}

/// The size of the ballbot's problem.
#[test]
fn four_states_one_input() {
    let campaign = Campaign {
        families: &Family::ALL,
        compared: 450,
        more: 2600,
    };
    campaign.run::<4, 1>(3, 20, 0);
}

#[test]
fn four_states_two_inputs_two_general_rows() {
    let campaign = Campaign {
        families: &Family::ALL,
        compared: 200,
        more: 300,
    };
    campaign.run::<4, 2>(4, 20, 2);
}

#[test]
fn six_states_three_inputs() {
    let campaign = Campaign {
        families: &Family::ALL,
        compared: 200,
        more: 300,
    };
    campaign.run::<6, 3>(5, 12, 1);
}

#[test]
fn eight_states_two_inputs() {
    let campaign = Campaign {
        families: &Family::ALL,
        compared: 60,
        more: 140,
    };
    campaign.run::<8, 2>(6, 12, 0);
}

#[test]
fn long_horizon() {
    let campaign = Campaign {
        families: &Family::ALL,
        compared: 60,
        more: 60,
    };
    campaign.run::<3, 1>(7, 100, 0);
}

/// With bounds close around a trajectory hundreds of them are active here, and the number of
/// changes of a cold start goes into the ten thousands: those families are left out.
#[test]
fn largest() {
    let campaign = Campaign {
        families: &[
            Family::SoftLinear,
            Family::SoftQuadratic,
            Family::SoftBoth,
            Family::Arbitrary,
        ],
        compared: 5,
        more: 5,
    };
    campaign.run::<12, 4>(8, 100, 0);
}

/// The inputs themselves, against the dense route.
#[test]
fn inputs_of_the_dense_route() {
    let families = [
        Family::Loose,
        Family::Tight,
        Family::TerminalEquality,
        Family::Arbitrary,
    ];
    for family in families {
        for k in 0..60 {
            let mut rng = Rng::new(1000 + k);
            let ocp = problem::<4, 1>(&mut rng, family, 12, 1);
            let solution = solve(&ocp);
            let optimum = least_distance::solve(&DenseQp::new(&ocp).unwrap());
            assert_eq!(
                optimum.is_some(),
                solution.status.is_solved(),
                "{family:?} {k}"
            );
            let Some(optimum) = optimum else {
                continue;
            };
            for (i, u) in solution.u.iter().enumerate().take(ocp.length()) {
                let error = (u[0] - optimum[i]).abs();
                assert!(
                    error <= 1e-7 * (1.0 + u[0].abs()),
                    "{family:?} {k}: {error:.1e}"
                );
            }
        }
    }
}
