//! What single precision is worth: the inputs of the `f32` solver against those of the `f64`
//! solver for the problem as `f32` sees it.
//!
//! Stated accuracy, relative to the largest input of the plan: 1e-6 for half of the problems
//! and 1e-4 for 99 % of them; 1e-3 for 99 % where the bounds leave a channel of a thousandth of
//! the quantities' size. Units that differ by 1e4 change none of this. No feasible problem is called
//! infeasible. With a terminal equality beside tight bounds: 1e-5 for half and 1e-2 for 95 %, and up to
//! 3 % are called inaccurate; where, beside such bounds, inputs cost a millionth of what states do, up
//! to 15 % are. No problem that is infeasible by more than rounding is called solved.
//!
//! Points whose derivatives are bounded, from nothing and from the last answer, relative to the bound of the
//! input (at a limit, inputs are next to nothing), the first input alone: with two states 5e-5 at most,
//! with four 1e-4 for 95 % and 2e-3 at most, with six 1e-2 for 90 % and 5e-2 at most; with six, up to a quarter
//! of the programs of 20 samples is called inaccurate. Run with `--nocapture` for the figures.

use super::support::census::{Counts, Distribution};
use super::support::precision::{double, single};
use super::support::{kind, solve, solve_with};
use lpvmpc::{Solution, Solver, SolverSettings, WarmStart, kkt_residual};
use lpvmpc_sequences::{Kind, Recipe, working_memory};
use lpvmpc_testkit::problems::{Family, each_common, problem};
use lpvmpc_testkit::rng::Rng;

/// What was found in one family.
struct Findings {
    verdicts: Counts,
    /// Error of the inputs, relative to the largest input of the problem.
    inputs: Distribution,
    /// Residual of the optimality conditions, calculated in `f32`.
    residual: Distribution,
}

const COUNT: u64 = 1000;

/// The problems of a family, with the costs of the inputs times `input_cost`.
fn measure<const NX: usize, const NU: usize>(
    family: Family,
    longest: usize,
    rows: usize,
    input_cost: f64,
) -> Findings {
    let mut findings = Findings {
        verdicts: Counts::default(),
        inputs: Distribution::default(),
        residual: Distribution::default(),
    };
    for k in 0..COUNT {
        let mut exact = problem::<NX, NU>(&mut Rng::new(k), family, longest, rows);
        for stage in &mut exact.stages {
            stage.linear_u *= input_cost;
        }
        for common in each_common(&mut exact) {
            common.r *= input_cost;
            common.s *= input_cost.sqrt();
        }
        let single = single(&exact);
        let double = double(&single);
        let reference = solve(&double);
        let settings = SolverSettings {
            warm_start: WarmStart::Cold,
            ..SolverSettings::default()
        };
        let answer = solve_with(&single, &settings);
        let verdicts = [kind(&reference.status), kind(&answer.status)];
        findings.verdicts.add(verdicts.join(" -> "));
        if verdicts == ["solved", "solved"] {
            let pairs = || reference.u.iter().zip(&answer.u).take(double.length());
            let size = pairs().map(|(a, _)| a.amax()).fold(1e-300, f64::max);
            let errors = pairs().map(|(a, b)| (a - b.cast::<f64>()).amax());
            findings.inputs.add(errors.fold(0.0, f64::max) / size);
            let residual = kkt_residual(&single, &answer).largest();
            findings.residual.add(f64::from(residual));
        }
    }
    println!("f32 {NX} {NU} {longest} {family:?}: {}", findings.verdicts);
    println!("    inputs   {}", findings.inputs);
    println!("    residual {}", findings.residual);
    findings
}

impl Findings {
    fn same_verdict(&self) -> f64 {
        let pairs = [
            "solved -> solved",
            "infeasible -> infeasible",
            "inaccurate -> inaccurate",
        ];
        let same: usize = pairs.iter().map(|pair| self.verdicts.of(pair)).sum();
        same as f64 / COUNT as f64
    }

    fn unproved(&self) -> f64 {
        let pairs = ["infeasible -> inaccurate", "inaccurate -> infeasible"];
        let unproved: usize = pairs.iter().map(|pair| self.verdicts.of(pair)).sum();
        unproved as f64 / COUNT as f64
    }
}

/// The ballbot's size.
fn single_input(family: Family) -> Findings {
    measure::<4, 1>(family, 20, 0, 1.0)
}

/// Twice as many bounds on the same states.
fn two_inputs(family: Family) -> Findings {
    measure::<4, 2>(family, 10, 2, 1.0)
}

const SIZES: [fn(Family) -> Findings; 2] = [single_input, two_inputs];

#[test]
fn bounds_with_room() {
    let families = [
        Family::Loose,
        Family::SoftLinear,
        Family::SoftBoth,
        Family::Arbitrary,
    ];
    for (measure, family) in SIZES.iter().flat_map(|size| families.map(|f| (size, f))) {
        let findings = measure(family);
        assert_eq!(findings.verdicts.of("solved -> infeasible"), 0);
        // Of what is infeasible, one of the two may lack the proof.
        let unproved = findings.unproved();
        assert!(findings.same_verdict() + unproved >= 0.99);
        assert!(unproved <= 0.025);
        assert!(findings.inputs.quantile(0.5) <= 1e-6);
        assert!(findings.inputs.quantile(0.99) <= 1e-4);
        assert!(findings.residual.quantile(0.99) <= 1e-4);
    }
}

/// With several inputs, one in fifty of these was called infeasible: rows that share most of
/// their support counted as dependent.
#[test]
fn feasible_sets_a_thousandth_wide() {
    let families = [Family::Tight, Family::BadlyScaled];
    for (measure, family) in SIZES.iter().flat_map(|size| families.map(|f| (size, f))) {
        let findings = measure(family);
        assert!(findings.same_verdict() >= 0.999);
        assert!(findings.inputs.quantile(0.5) <= 1e-6);
        assert!(findings.inputs.quantile(0.99) <= 1e-3);
        assert!(findings.residual.quantile(0.99) <= 1e-3);
    }
}

/// What the regulator asks for is many times the bounds.
#[test]
fn input_costs_of_a_millionth() {
    for findings in [
        measure::<4, 1>(Family::Tight, 20, 0, 1e-6),
        measure::<4, 2>(Family::Tight, 10, 2, 1e-6),
    ] {
        assert!(findings.same_verdict() >= 0.85, "{}", findings.verdicts);
        assert_eq!(findings.verdicts.of("solved -> infeasible"), 0);
    }
}

/// A bounded input must reach a given state of an arbitrary, often unstable model: rounding the
/// problem to `f32` alone makes one in seven infeasible, and it decides about the others, too.
#[test]
fn a_terminal_state_with_little_room() {
    for measure in SIZES {
        let findings = measure(Family::TerminalEquality);
        let feasible = findings.verdicts.of("solved -> solved");
        let refused = findings.verdicts.of("solved -> infeasible")
            + findings.verdicts.of("solved -> inaccurate");
        assert!(33 * refused <= refused + feasible);
        assert!(findings.inputs.quantile(0.5) <= 1e-5);
        assert!(findings.inputs.quantile(0.95) <= 1e-2);
    }
}

#[test]
fn nothing_infeasible_is_solved() {
    for measure in SIZES {
        let findings = measure(Family::Infeasible);
        assert!(findings.same_verdict() == 1.0, "{}", findings.verdicts);
    }
}

/// Points on their way with bounds on all derivatives: how far the first input is off, relative to its bound, and
/// how many of the programs are not solved.
fn points<const NX: usize>(horizon: usize, share: f64) -> (Distribution, usize) {
    let mut errors = Distribution::default();
    let mut unsolved = 0;
    for seed in 11..=16 {
        let recipe = Recipe {
            kind: Kind::Motion,
            horizon,
            samples: 30,
            share,
            seed,
        };
        let sequence = recipe.make::<NX, 1>().unwrap();
        let room = working_memory(&sequence.problems);
        let mut solvers = [WarmStart::Shifted, WarmStart::Cold].map(|warm_start| {
            let solver = Solver::<f32, NX, 1>::allocate(room);
            (warm_start, solver, Solution::allocate(room))
        });
        for exact in &sequence.problems {
            let single = single(exact);
            let reference = solve(&double(&single));
            assert!(reference.status.is_solved());
            let largest = f64::from(single.common.u.upper[0]);
            for (warm_start, solver, answer) in &mut solvers {
                let settings = SolverSettings {
                    warm_start: *warm_start,
                    ..SolverSettings::default()
                };
                solver.solve(&single, &settings, answer);
                if answer.status.is_solved() {
                    let error = f64::from(answer.u[0][0]) - reference.u[0][0];
                    errors.add(error.abs() / largest);
                } else {
                    unsolved += 1;
                }
            }
        }
    }
    println!(
        "f32 points, {NX} states, {horizon} samples, share {share}: {errors}; {unsolved} not solved"
    );
    (errors, unsolved)
}

#[test]
fn points_at_their_limits() {
    for (horizon, share) in [20, 50, 100]
        .map(|n| [0.2, 0.5, 0.8].map(|s| (n, s)))
        .concat()
    {
        let (errors, unsolved) = points::<2>(horizon, share);
        assert_eq!(unsolved, 0);
        assert!(errors.max() <= 5e-5);
        let (errors, unsolved) = points::<4>(horizon, share);
        assert_eq!(unsolved, 0);
        assert!(errors.quantile(0.95) <= 1e-4 && errors.max() <= 2e-3);
        let (errors, unsolved) = points::<6>(horizon, share);
        assert!(unsolved * 4 <= unsolved + errors.len());
        assert!(errors.quantile(0.9) <= 1e-2 && errors.max() <= 5e-2);
    }
}
