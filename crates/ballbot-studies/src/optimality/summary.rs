//! A set of closed loops in a few numbers.

use super::{Case, Outcome};

/// A state bound that is exceeded by less than this part of it counts as kept.
const KEPT: f64 = 1e-3;

/// What the runs of a set amount to.
#[derive(Clone, Debug, PartialEq)]
pub struct Summary {
    /// Cost over that of nonlinear MPC, from the smallest on.
    pub ratios: Vec<f64>,
    /// The same of linear MPC, in the order of the cases.
    pub linear: Vec<f64>,
    /// Cost over that of linear MPC where that kept the bounds, from the smallest on.
    pub against_linear: Vec<f64>,
    /// Quadratic programs per sample, mean over the runs.
    pub mean_programs: f64,
    /// Most of them in one sample.
    pub most_programs: usize,
    /// Samples without a plan.
    pub without_plan: usize,
}

impl Summary {
    /// The summary of `outcomes`, one for each of `cases`.
    pub fn of(cases: &[Case], outcomes: &[Outcome]) -> Self {
        let sorted = |mut values: Vec<f64>| {
            values.sort_by(f64::total_cmp);
            values
        };
        let pairs = || cases.iter().zip(outcomes);
        let mean = outcomes
            .iter()
            .map(|outcome| outcome.mean_programs)
            .sum::<f64>();
        Self {
            ratios: sorted(
                pairs()
                    .map(|(case, run)| run.cost / case.nonlinear)
                    .collect(),
            ),
            linear: sorted(
                cases
                    .iter()
                    .map(|case| case.linear / case.nonlinear)
                    .collect(),
            ),
            against_linear: sorted(
                pairs()
                    .filter(|(case, _)| case.linear_excess < KEPT)
                    .map(|(case, run)| run.cost / case.linear)
                    .collect(),
            ),
            mean_programs: mean / outcomes.len() as f64,
            most_programs: outcomes
                .iter()
                .map(|run| run.most_programs)
                .max()
                .unwrap_or(0),
            without_plan: outcomes.iter().map(|run| run.without_plan).sum(),
        }
    }
}
