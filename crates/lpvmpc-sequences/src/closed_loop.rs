//! The loop: each problem begins where the first input of the one before has led.

use crate::limits::Limits;
use crate::plant::Plant;
use crate::{Recipe, SequenceError};
use lpvmpc::{Capacity, Ocp, Penalty, Quantity, Solution, Solver, SolverSettings, WarmStart};
use nalgebra::SVector;
use std::collections::BTreeSet;

/// States are multiples of this, which is far above rounding.
const STATE_STEP: f64 = 1.0 / (1 << 30) as f64;

/// The problems of a loop, sample by sample.
#[derive(Clone, Debug, PartialEq)]
pub struct Sequence<const NX: usize, const NU: usize> {
    /// The quadratic programs.
    pub problems: Vec<Ocp<f64, NX, NU>>,
    /// Active bounds of each divided by the inputs of its horizon, N `NU`, on average.
    pub share: f64,
}

/// Room for every bound of these problems.
pub fn working_memory<const NX: usize, const NU: usize>(problems: &[Ocp<f64, NX, NU>]) -> Capacity {
    let stages = problems.iter().map(Ocp::length).max().unwrap_or(1);
    let rows = problems.iter().map(|ocp| ocp.rows_per_stage).max();
    let is_soft = |ocp| each_soft(ocp).any(Option::is_some);
    // A row for each input, and those of a terminal equality; then the bounds of the states, of which
    // those that are soft and exceeded are rows of two parts.
    let states = stages * NX;
    let soft = if problems.iter().any(is_soft) {
        states
    } else {
        0
    };
    let rows_of_inputs = stages * NU + NX;
    Capacity {
        stages,
        rows: rows_of_inputs + soft,
        active: rows_of_inputs + states + 2 * soft,
        ..Capacity::default()
    }
    .with_general_rows(rows.unwrap_or(0))
}

/// The prices of all soft bounds of states.
fn each_soft<const NX: usize, const NU: usize>(
    ocp: &Ocp<f64, NX, NU>,
) -> impl Iterator<Item = &Option<Penalty<f64>>> {
    let stages = ocp.own.iter().chain(std::iter::once(&ocp.common));
    let stages = stages.flat_map(|common| &common.soft_x);
    stages.chain(&ocp.terminal.soft_x)
}

/// What plans in the loop need if nothing is bounded.
///
/// # Errors
/// [`SequenceError::NotSolved`].
pub fn needed<const NX: usize, const NU: usize>(
    recipe: &Recipe,
    plant: &impl Plant<NX, NU>,
) -> Result<Limits<NX, NU>, SequenceError> {
    let mut limits = Limits::zero();
    close(
        recipe,
        plant,
        |_| {},
        |ocp, solution| {
            // There is no input at the end of the horizon.
            let end = SVector::zeros();
            let x = std::iter::once(&ocp.x0).chain(&*solution.x);
            let u = solution.u.iter().chain(std::iter::once(&end));
            x.zip(u).for_each(|(x, u)| limits.widen(x, u));
        },
    )?;
    Ok(limits)
}

/// The loop within these limits.
///
/// # Errors
/// [`SequenceError::NotSolved`].
pub fn within<const NX: usize, const NU: usize>(
    recipe: &Recipe,
    plant: &impl Plant<NX, NU>,
    limits: &Limits<NX, NU>,
) -> Result<Sequence<NX, NU>, SequenceError> {
    let mut problems = Vec::with_capacity(recipe.samples);
    let mut active = 0;
    let impose = |ocp: &mut _| limits.impose(recipe.kind, plant, ocp);
    close(recipe, plant, impose, |ocp, solution| {
        problems.push(ocp.clone());
        active += active_bounds(solution);
    })?;
    let inputs = recipe.samples * recipe.horizon * NU;
    Ok(Sequence {
        problems,
        share: active as f64 / inputs as f64,
    })
}

/// Closes the loop, and shows each problem with its solution.
fn close<const NX: usize, const NU: usize, P: Plant<NX, NU>>(
    recipe: &Recipe,
    plant: &P,
    impose: impl Fn(&mut Ocp<f64, NX, NU>),
    mut show: impl FnMut(&Ocp<f64, NX, NU>, &Solution<f64, NX, NU>),
) -> Result<(), SequenceError> {
    let mut x = plant.start();
    let mut memory: Option<(Solver<f64, NX, NU>, Solution<f64, NX, NU>)> = None;
    // Where rounding decides which bounds are active, those of a cold start do not depend on the samples
    // before.
    let settings = SolverSettings {
        warm_start: WarmStart::Cold,
        ..SolverSettings::default()
    };
    for sample in 0..recipe.samples {
        let mut ocp = plant.problem(sample, x, recipe.horizon);
        impose(&mut ocp);
        let (solver, solution) = memory.get_or_insert_with(|| {
            let room = working_memory(std::slice::from_ref(&ocp));
            (Solver::allocate(room), Solution::allocate(room))
        });
        solver.solve(&ocp, &settings, solution);
        if !solution.status.is_solved() {
            let status = solution.status.to_string();
            return Err(SequenceError::NotSolved { sample, status });
        }
        show(&ocp, solution);
        let now = &ocp.stages[0];
        x = (now.a * x + now.b * solution.first_input()) * P::KEPT;
        x.apply(|entry| *entry = (*entry / STATE_STEP).round() * STATE_STEP);
    }
    Ok(())
}

/// Bounds that are active; a soft one that is exceeded at both its prices counts once.
fn active_bounds<const NX: usize, const NU: usize>(solution: &Solution<f64, NX, NU>) -> usize {
    let place = |quantity| match quantity {
        Quantity::State(index) => (0, index),
        Quantity::Input(index) => (1, index),
        Quantity::Row(index) => (2, index),
    };
    let rows = solution.active.iter();
    let bounds: BTreeSet<_> = rows
        .map(|row| (row.bound.stage, place(row.bound.quantity)))
        .collect();
    bounds.len()
}
