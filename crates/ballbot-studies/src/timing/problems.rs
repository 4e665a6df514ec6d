//! Quadratic programs larger than the ballbot's, and with many active bounds.

use super::{OtherWork, SequenceTimes, Stopwatch, Times};
use crate::StudyError;
use lpvmpc::{Solution, Solver, SolverSettings};
use lpvmpc_sequences::{Kind, Recipe, working_memory};
use std::hint::black_box;
use std::time::Duration;

/// The sequences of problems that are timed, `states x inputs`: many inputs at their bounds beside soft bounds of
/// states, and a long horizon.
pub const PROBLEMS: [&str; 3] = ["many-bounds-8x2", "many-bounds-12x4", "long-4x1"];

/// Many bounds: more than half as many as there are inputs.
const MANY_BOUNDS: Recipe = Recipe {
    kind: Kind::Soft,
    horizon: 20,
    samples: 20,
    share: 0.6,
    seed: 1,
};
const LONG: Recipe = Recipe {
    kind: Kind::Inputs,
    horizon: 200,
    share: 0.2,
    ..MANY_BOUNDS
};

/// Times our solver on the sequence with this name, one of [`PROBLEMS`]: each problem warm-started from the one
/// before, as in a loop.
///
/// # Errors
/// No such sequence, or it cannot be made.
pub fn time_problems(name: &str, watch: Stopwatch<'_>) -> Result<SequenceTimes, StudyError> {
    match name {
        "many-bounds-8x2" => time::<8, 2>(name, &MANY_BOUNDS, watch),
        "many-bounds-12x4" => time::<12, 4>(name, &MANY_BOUNDS, watch),
        "long-4x1" => time::<4, 1>(name, &LONG, watch),
        _ => Err(StudyError::Unsuitable("no such sequence of problems")),
    }
}

fn time<const NX: usize, const NU: usize>(
    name: &str,
    recipe: &Recipe,
    watch: Stopwatch<'_>,
) -> Result<SequenceTimes, StudyError> {
    let problems = recipe.make::<NX, NU>()?.problems;
    let room = working_memory(&problems);
    let mut solver = Solver::allocate(room);
    let mut solution: Solution<f64, NX, NU> = Solution::allocate(room);
    let settings = SolverSettings::default();
    let mut other_work = OtherWork::new();
    let (mut warm, mut cold, mut max_active) = (Vec::new(), Vec::new(), 0);
    for ocp in &problems {
        let before = solution.clone();
        let mut solve = |other_work: Option<&mut OtherWork>| -> Duration {
            solution.clone_from(&before);
            other_work.map(OtherWork::sweep);
            let start = watch.time();
            solver.solve(black_box(ocp), &settings, &mut solution);
            let elapsed = watch.time() - start;
            black_box(&solution);
            elapsed
        };
        warm.push(watch.shortest(|| solve(None)));
        cold.push(watch.shortest_cold(|| solve(Some(&mut other_work))));
        max_active = max_active.max(solution.active.len());
    }
    let (warm, cold) = (Times::new(warm), Times::new(cold));
    Ok(SequenceTimes {
        name: name.to_owned(),
        qp_us: warm,
        qp_cold_us: cold,
        step_us: warm,
        step_cold_us: cold,
        max_active,
    })
}
