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
        compare::<4, 1, 20, 20>(&mut criterion, activity)?;
        compare::<4, 1, 50, 50>(&mut criterion, activity)?;
        compare::<4, 1, 100, 100>(&mut criterion, activity)?;
        compare::<4, 1, 200, 200>(&mut criterion, activity)?;
        compare::<8, 2, 20, 40>(&mut criterion, activity)?;
        compare::<12, 4, 20, 80>(&mut criterion, activity)?;
    }
    criterion.final_summary();
    Ok(())
}

fn compare<const NX: usize, const NU: usize, const N: usize, const M: usize>(
    criterion: &mut Criterion,
    activity: Activity,
) -> Result<(), BenchmarkError> {
    let problems = synthetic::problems::<NX, NU, N, M>(activity)?;
    let warm = synthetic::settings();
    let mut own = Own::<NX, NU, N, M>::new(&problems, warm);
    let (expected, active) = own.solve_all()?;
    let name = format!("{NX}x{NU}, N = {N}, {active:.0} active");

    let mut comparison = Comparison::new(criterion, "growth", &name, expected);
    comparison.time("lpvmpc", &mut own)?;
    if activity == Activity::Active {
        let cold = SolverSettings {
            warm_start: WarmStart::Cold,
            ..warm
        };
        comparison.time(
            "lpvmpc, cold",
            &mut Own::<NX, NU, N, M>::new(&problems, cold),
        )?;
    }
    comparison.time(
        "Clarabel, update and solve",
        &mut ClarabelUpdate::new(&problems)?,
    )
}
