//! The search: CMA-ES, once for each way of weighing the goals, over coordinates from 0 to 1. It knows
//! no robot.

use crate::judge::Outcome;
use fcmaes_core::{Cmaes, CmaesParams, Fitness};
use serde::Serialize;

/// How long is searched, and how.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Weights of the goals, one search for each; see [`weightings`].
    pub weightings: Vec<Vec<f64>>,
    /// Candidates, at most, the start included.
    pub evaluations: u64,
    /// Candidates of a generation.
    pub population: usize,
    /// Standard deviation of the first generation.
    pub step: f64,
    /// A search ends after so many generations without an improvement.
    pub patience: u32,
    /// Seed of everything random.
    pub seed: u64,
}

/// What is searched.
pub trait Problem {
    /// Why a candidate has no value.
    type Error;

    /// The outcomes of points with coordinates from 0 to 1. A point of which `is_hopeless` says yes
    /// for a lower bound may be left there, with that bound for its outcome.
    ///
    /// # Errors
    /// A point cannot be evaluated, and the search has to end.
    fn evaluate(
        &mut self,
        points: &[Vec<f64>],
        is_hopeless: &(dyn Fn(&Outcome) -> bool + Sync),
    ) -> Result<Vec<Outcome>, Self::Error>;

    /// How many candidates were evaluated; one that comes again counts once.
    fn evaluations(&self) -> u64;
}

/// How one search went.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Searched {
    /// Its weights of the goals.
    pub weights: Vec<f64>,
    /// Its generations.
    pub generations: u32,
    /// Candidates evaluated when it ended, of all searches.
    pub evaluations: u64,
    /// Why it ended.
    pub end: SearchEnd,
}

/// Why a search ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum SearchEnd {
    /// Its share of the evaluations is used up.
    Budget,
    /// Nothing was better for as many generations as its patience.
    NoImprovement,
    /// The distribution has become too narrow, too wide or too long for numbers.
    Degenerate,
    /// All targets are reached and all limits kept.
    Reached,
}

/// The value of an outcome under weights, to be made small: from 0 to 1 if it keeps all limits, by the
/// augmented Chebyshev norm of its goals (Steuer and Choo 1983); from 1 to 2, by how far it does not,
/// else (the rules of Deb 2000).
pub fn value(outcome: &Outcome, weights: &[f64]) -> f64 {
    let small = |value: f64| match value.is_finite() {
        true => value / (1.0 + value),
        false => 1.0,
    };
    if outcome.violation > 0.0 {
        return 1.0 + small(outcome.violation);
    }
    let weighted = || {
        outcome
            .goals
            .iter()
            .zip(weights)
            .map(|(goal, weight)| goal * weight)
    };
    small(weighted().fold(0.0, f64::max) + AUGMENTATION * weighted().sum::<f64>())
}

/// The share of the sum in the augmented norm, which tells those apart that are equal in the worst goal.
const AUGMENTATION: f64 = 0.05;
/// The least weight of a goal: one of 0 would leave it free.
const LEAST_WEIGHT: f64 = 0.02;

/// Weights of so many goals: the simplex lattice (Das and Dennis 1998), its middle first. One for one
/// goal, 5 for two, 10 for three.
pub fn weightings(goals: usize) -> Vec<Vec<f64>> {
    let parts = match goals {
        0 | 1 => return vec![vec![1.0]],
        2 => 4,
        _ => 3,
    };
    let mut all = vec![Vec::new()];
    for _ in 1..goals {
        let longer = |begun: &Vec<u32>| {
            let left = parts - begun.iter().sum::<u32>();
            let begun = begun.clone();
            (0..=left).map(move |part| [begun.clone(), vec![part]].concat())
        };
        all = all.iter().flat_map(longer).collect();
    }
    for weights in &mut all {
        weights.push(parts - weights.iter().sum::<u32>());
    }
    // From the middle out.
    all.sort_by_key(|weights| weights.iter().map(|part| part * part).sum::<u32>());
    let share = |part: u32| (f64::from(part) / f64::from(parts)).max(LEAST_WEIGHT);
    all.into_iter()
        .map(|weights| weights.into_iter().map(share).collect())
        .collect()
}

/// Less is no improvement.
const IMPROVEMENT: f64 = 1e-4;
/// Later searches begin at what is known already, with a smaller step.
const LATER_STEP: f64 = 0.5;

/// Searches from a start that is evaluated. Each search begins at the best point so far under its
/// weights, and has the same share of what is left of the evaluations. A candidate is left when it is
/// certain that it is worse than half of the generation before.
///
/// # Errors
/// What the problem says.
pub fn search<P: Problem>(
    plan: &Plan,
    start: (Vec<f64>, Outcome),
    problem: &mut P,
) -> Result<Vec<Searched>, P::Error> {
    let mut known = vec![start];
    let mut searches = Vec::new();
    for (index, weights) in plan.weightings.iter().enumerate() {
        let left = plan.evaluations.saturating_sub(problem.evaluations());
        let share = left / (plan.weightings.len() - index) as u64;
        let until = problem.evaluations() + share;
        let searched = search_one(plan, index, until, &mut known, problem)?;
        let reached = searched.end == SearchEnd::Reached;
        searches.push(Searched {
            weights: weights.clone(),
            ..searched
        });
        if reached {
            break;
        }
    }
    Ok(searches)
}

fn search_one<P: Problem>(
    plan: &Plan,
    index: usize,
    until: u64,
    known: &mut Vec<(Vec<f64>, Outcome)>,
    problem: &mut P,
) -> Result<Searched, P::Error> {
    let weights = &plan.weightings[index];
    let of = |outcome: &Outcome| value(outcome, weights);
    let exact = known.iter().filter(|(_, outcome)| outcome.exact);
    let best_known = exact.min_by(|a, b| of(&a.1).total_cmp(&of(&b.1)));
    let (from, mut best) = match best_known {
        Some((point, outcome)) => (point.clone(), of(outcome)),
        None => (
            vec![0.5; known.first().map_or(0, |first| first.0.len())],
            f64::INFINITY,
        ),
    };
    let dimensions = from.len();
    let box_of_one = Fitness::bounded(
        dimensions,
        1,
        &vec![0.0; dimensions],
        &vec![1.0; dimensions],
    );
    let parameters = CmaesParams {
        popsize: plan.population as i32,
        seed: plan.seed,
        runid: index as i64,
        ..CmaesParams::default()
    };
    let step = if index == 0 {
        plan.step
    } else {
        LATER_STEP * plan.step
    };
    let mut strategy = Cmaes::new(box_of_one, &from, &[step], &parameters);
    let (mut generations, mut idle, mut threshold) = (0, 0, f64::INFINITY);
    let end = loop {
        if best == 0.0 {
            break SearchEnd::Reached;
        }
        if problem.evaluations() + plan.population as u64 > until {
            break SearchEnd::Budget;
        }
        if idle >= plan.patience {
            break SearchEnd::NoImprovement;
        }
        let points = strategy.ask();
        let outcomes = problem.evaluate(&points, &|outcome| of(outcome) > threshold)?;
        generations += 1;
        let mut values: Vec<f64> = outcomes.iter().map(of).collect();
        let degenerate = strategy.tell(&values) != 0;
        known.extend(points.into_iter().zip(outcomes));
        values.sort_by(f64::total_cmp);
        threshold = values[(values.len() - 1) / 2];
        idle += 1;
        if values[0] < best - IMPROVEMENT * best {
            idle = 0;
        }
        best = best.min(values[0]);
        if degenerate && best > 0.0 {
            break SearchEnd::Degenerate;
        }
    };
    Ok(Searched {
        weights: Vec::new(),
        generations,
        evaluations: problem.evaluations(),
        end,
    })
}
