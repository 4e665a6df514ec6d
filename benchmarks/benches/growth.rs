//! Our solver and Clarabel as horizon and size grow, without and with active bounds.

use criterion::Criterion;
use lpvmpc::{SolverSettings, WarmStart};
use lpvmpc_benchmarks::BenchmarkError;
use lpvmpc_benchmarks::comparison::Comparison;
use lpvmpc_benchmarks::contenders::{ClarabelUpdate, Own};
use lpvmpc_sequences::{Kind, Recipe};

/// What is bounded, and the share of active bounds.
const BOUNDS: [(Kind, f64); 3] = [
    (Kind::Inputs, 0.0),
    (Kind::Inputs, 0.5),
    (Kind::States, 0.5),
];

fn main() -> Result<(), BenchmarkError> {
    let mut criterion = Criterion::default().configure_from_args();
    for (kind, share) in BOUNDS {
        let recipe = |horizon| Recipe {
            kind,
            horizon,
            samples: 20,
            share,
            seed: 1,
        };
        for horizon in [20, 50, 100, 200] {
            compare::<4, 1>(&mut criterion, &recipe(horizon))?;
        }
        compare::<8, 2>(&mut criterion, &recipe(20))?;
        compare::<12, 4>(&mut criterion, &recipe(20))?;
    }
    criterion.final_summary();
    Ok(())
}

fn compare<const NX: usize, const NU: usize>(
    criterion: &mut Criterion,
    recipe: &Recipe,
) -> Result<(), BenchmarkError> {
    let problems = recipe.make::<NX, NU>()?.problems;
    let warm = SolverSettings::default();
    let mut own = Own::new(&problems, warm);
    let (expected, active) = own.solve_all()?;
    let (kind, horizon) = (recipe.kind.name(), recipe.horizon);
    let name = format!("{NX}x{NU}, N = {horizon}, {kind}, {active:.0} active");

    let mut comparison = Comparison::new(criterion, "growth", &name, expected);
    comparison.time("lpvmpc", &mut own)?;
    if recipe.share > 0.0 {
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
