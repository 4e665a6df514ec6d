//! All solvers on the quadratic programs of the ballbot's closed loops, and our whole step.

use criterion::Criterion;
use lpvmpc::SolverSettings;
use lpvmpc_benchmarks::BenchmarkError;
use lpvmpc_benchmarks::closed_loop::Recording;
use lpvmpc_benchmarks::comparison::Comparison;
use lpvmpc_benchmarks::contenders::{ClarabelSolve, ClarabelUpdate, Osqp, Own, QuadProgPp};

/// The scenarios, each with the loosest power of ten as OSQP's tolerance that passes the check.
const SCENARIOS: [(&str, f64); 3] = [
    ("two-setpoints", 1e-7),
    ("single-setpoint-terminal", 1e-8),
    ("tight-bounds", 1e-7),
];

fn main() -> Result<(), BenchmarkError> {
    let mut criterion = Criterion::default().configure_from_args();
    for (scenario, osqp_tolerance) in SCENARIOS {
        compare(&mut criterion, scenario, osqp_tolerance)?;
    }
    criterion.final_summary();
    Ok(())
}

fn compare(
    criterion: &mut Criterion,
    scenario: &str,
    osqp_tolerance: f64,
) -> Result<(), BenchmarkError> {
    let recording = Recording::new(scenario)?;
    let problems = &recording.problems;
    let mut own = Own::new(problems, SolverSettings::default());
    let (expected, active) = own.solve_all()?;
    println!("{scenario}: {active:.1} active bounds on average");

    let mut comparison = Comparison::new(criterion, "closed loop", scenario, expected);
    comparison.time("lpvmpc", &mut own)?;
    comparison.time("lpvmpc, whole step", &mut recording.replay())?;
    let mut dense = QuadProgPp::new(problems)?;
    comparison.time("QuadProg++, condense and solve", &mut dense)?;
    comparison.time_unchecked("QuadProg++, condense alone", |k| dense.condense(k));
    let mut osqp = Osqp::new(problems, osqp_tolerance)?;
    comparison.time("OSQP, update and solve", &mut osqp)?;
    comparison.time(
        "Clarabel, update and solve",
        &mut ClarabelUpdate::new(problems)?,
    )?;
    comparison.time("Clarabel, solve alone", &mut ClarabelSolve::new(problems)?)
}
