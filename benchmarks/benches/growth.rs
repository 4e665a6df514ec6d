//! Our solver and Clarabel as horizon and size grow, without and with active bounds.

use criterion::Criterion;
use lpvmpc::{SolverSettings, WarmStart};
use lpvmpc_benchmarks::BenchmarkError;
use lpvmpc_benchmarks::comparison::Comparison;
use lpvmpc_benchmarks::contenders::{ClarabelUpdate, Own};
use lpvmpc_benchmarks::synthetic::{self, Activity};

fn main() -> Result<(), BenchmarkError> {
    let mut criterion = Criterion::default().configure_from_args();
    for activity in [Activity::Inactive, Activity::Active] {
        for stages in [20, 50, 100, 200] {
            compare::<4, 1>(&mut criterion, stages, activity)?;
        }
        compare::<8, 2>(&mut criterion, 20, activity)?;
        compare::<12, 4>(&mut criterion, 20, activity)?;
    }
    criterion.final_summary();
    Ok(())
}

fn compare<const NX: usize, const NU: usize>(
    criterion: &mut Criterion,
    stages: usize,
    activity: Activity,
) -> Result<(), BenchmarkError> {
    let problems = synthetic::problems::<NX, NU>(stages, activity)?;
    let warm = SolverSettings::default();
    let mut own = Own::new(&problems, warm);
    let (expected, active) = own.solve_all()?;
    let name = format!("{NX}x{NU}, N = {stages}, {active:.0} active");

    let mut comparison = Comparison::new(criterion, "growth", &name, expected);
    comparison.time("lpvmpc", &mut own)?;
    if activity == Activity::Active {
        let cold = SolverSettings {
            warm_start: WarmStart::Cold,
            ..warm
        };
        comparison.time("lpvmpc, cold", &mut Own::new(&problems, cold))?;
    }
    comparison.time(
        "Clarabel, update and solve",
        &mut ClarabelUpdate::new(&problems)?,
    )
}
