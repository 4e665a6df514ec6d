//! Our solver and Clarabel as horizon and size grow, without and with active bounds; and of our solver
//! the factorisation alone.

use criterion::Criterion;
use lpvmpc::riccati::{BadPivot, CostToGo, StageFactor};
use lpvmpc::{Ocp, SolverSettings, WarmStart};
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
        compare::<16, 6>(&mut criterion, 20, activity)?;
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
    if activity == Activity::Inactive {
        let mut factors = vec![StageFactor::zeros(); stages];
        comparison.time_unchecked("lpvmpc, factorisation alone", |problem| {
            factorize(&problems[problem], &mut factors)
        });
    }
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

/// The policy of every stage, and the cost-to-go in front of the first.
fn factorize<const NX: usize, const NU: usize>(
    ocp: &Ocp<f64, NX, NU>,
    factors: &mut [StageFactor<f64, NX, NU>],
) -> Result<CostToGo<f64, NX>, BadPivot<f64>> {
    let mut cost_to_go = CostToGo {
        quadratic: ocp.terminal.p,
        linear: ocp.terminal.linear_x,
    };
    for (i, (stage, factor)) in ocp.stages.iter().zip(factors).enumerate().rev() {
        factor.eliminate(stage, ocp.common_at(i), &mut cost_to_go)?;
    }
    Ok(cost_to_go)
}
