//! `ballbot optimality`.

use super::CommandError;
use crate::json;
use crate::optimality_figure::{CostOverDistance, cost_over_distance, long_horizon};
use crate::progress::Progress;
use crate::results::ResultFolder;
use crate::table::Table;
use ballbot_studies::StudyError;
use ballbot_studies::optimality::{
    Case, Outcome, Summary, distances, guaranteed_cost, narrow_bounds, quantile, random_starts,
    rising_prices, run_all,
};
use clap::Args;
use lpvmpc::Iterations;
use rayon::prelude::*;
use serde_json::json;
use std::path::PathBuf;

/// Arguments of `ballbot optimality`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  ballbot optimality                 every case
  ballbot optimality --programs 4    with at most four quadratic programs per sample

The LPV controller with its defaults, from rest and from random starts, with set points from 0.2 m to
10 m away that are given at t = 0, horizons of 10 to 80 samples and sampling times of 10 to 50 ms, and
from rest within narrower bounds. Its closed-loop costs are divided by those of nonlinear MPC on the same
problem, which another program (testdata/nonlinear-mpc, IPOPT) has solved to convergence at every sample.
In the first two sets the prices of state bounds are the same everywhere; in the others, the random
starts once more and the narrower bounds, they rise with the way, as in scenarios. Writes a row per
case and figures.")]
pub struct OptimalityArguments {
    /// Most quadratic programs per sample [default: that of scenarios]
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub programs: Option<u32>,
    /// Folder for the results
    #[arg(short, long, value_name = "DIR", default_value = "out/optimality")]
    pub out: PathBuf,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

const RESULTS: [&str; 5] = [
    "optimality.csv",
    "cost-over-distance.svg",
    "cost-over-distance.png",
    "long-horizon.svg",
    "long-horizon.png",
];

/// Runs the cases and writes the results.
///
/// # Errors
/// A file cannot be written.
pub fn run(arguments: &OptimalityArguments) -> Result<String, CommandError> {
    let results = ResultFolder::open(crate::PROGRAM, &arguments.out, &RESULTS)?;
    let iterations = arguments.programs.map_or_else(Iterations::default, |most| {
        Iterations::descent(Iterations::<f64>::TOLERANCE, most as usize)
    });
    let sets = [
        ("from rest", distances()?),
        ("random starts", random_starts()?),
        ("rising prices", rising_prices()?),
        ("narrow bounds", narrow_bounds()?),
    ];
    let mut table = Table::new([
        "cost / cost of nonlinear MPC",
        "runs",
        "median",
        "95 %",
        "99 %",
        "worst",
        "linear MPC, median",
        "worst against linear",
        "programs per sample",
        "most",
        "without plan",
    ]);
    let mut rows = CSV_HEADER.to_owned();
    let mut documents = Vec::new();
    let mut files = Vec::new();
    for (name, cases) in &sets {
        let outcomes = {
            let progress = Progress::new("running", cases.len());
            run_all(cases, iterations, &|done| progress.set(done))?
        };
        let summary = Summary::of(cases, &outcomes);
        table.row(cells(name, &summary));
        documents.push(document(name, &summary));
        for (case, outcome) in cases.iter().zip(&outcomes) {
            rows += &csv_row(name, case, outcome);
        }
        if *name == "from rest" {
            files.extend(figures(cases, &outcomes)?);
        }
    }
    files.push(("optimality.csv".to_owned(), rows.into_bytes()));
    results.write(&files, &RESULTS)?;
    if arguments.json {
        return Ok(json::text(&json!({ "sets": documents })));
    }
    let durations = || {
        sets.iter()
            .flat_map(|(_, cases)| cases)
            .map(|case| case.duration)
    };
    Ok(format!(
        "{table}costs over each whole run, {} s to {} s\nwritten to {}\n",
        durations().fold(f64::INFINITY, f64::min),
        durations().fold(0.0, f64::max),
        arguments.out.display()
    ))
}

/// Figures of the cases from rest.
fn figures(cases: &[Case], outcomes: &[Outcome]) -> Result<Vec<(String, Vec<u8>)>, CommandError> {
    let shown = |case: &&(&Case, &Outcome)| case.0.horizon == 20 && case.0.t_s == 0.05;
    let pairs: Vec<_> = cases.iter().zip(outcomes).collect();
    let shown: Vec<_> = pairs.iter().filter(shown).collect();
    let over = |cost: fn(&Case, &Outcome) -> f64| -> Vec<f64> {
        let ratio = |(case, outcome): &&(&Case, &Outcome)| cost(case, outcome) / case.nonlinear;
        shown.iter().map(ratio).collect()
    };
    let guaranteed = shown
        .par_iter()
        .map(|(case, _)| Ok(guaranteed_cost(case)? / case.nonlinear))
        .collect::<Result<Vec<_>, StudyError>>()?;
    let costs = cost_over_distance(&CostOverDistance {
        distance: shown.iter().map(|(case, _)| case.distance).collect(),
        linear: over(|case, _| case.linear),
        lpv: over(|_, outcome| outcome.cost),
        guaranteed,
    });
    let mut files = costs.files("cost-over-distance")?.to_vec();
    let long = pairs
        .iter()
        .find(|(case, _)| case.horizon == 60 && case.distance == 2.5 && case.t_s == 0.05);
    if let Some((case, outcome)) = long {
        files.extend(long_horizon(case, outcome).files("long-horizon")?);
    }
    Ok(files)
}

fn cells(name: &str, summary: &Summary) -> Vec<String> {
    let ratio = |value: f64| format!("{value:.4}");
    let at = |share| ratio(quantile(&summary.ratios, share));
    vec![
        name.to_owned(),
        summary.ratios.len().to_string(),
        at(0.5),
        at(0.95),
        at(0.99),
        at(1.0),
        ratio(quantile(&summary.linear, 0.5)),
        ratio(quantile(&summary.against_linear, 1.0)),
        format!("{:.2}", summary.mean_programs),
        summary.most_programs.to_string(),
        summary.without_plan.to_string(),
    ]
}

fn document(name: &str, summary: &Summary) -> serde_json::Value {
    let at = |share| quantile(&summary.ratios, share);
    json!({
        "set": name,
        "runs": summary.ratios.len(),
        "cost_over_nonlinear": { "median": at(0.5), "p95": at(0.95), "p99": at(0.99), "worst": at(1.0) },
        "linear_over_nonlinear_median": quantile(&summary.linear, 0.5),
        "cost_over_linear_worst": quantile(&summary.against_linear, 1.0),
        "programs_per_sample_mean": summary.mean_programs,
        "programs_per_sample_most": summary.most_programs,
        "samples_without_plan": summary.without_plan,
    })
}

const CSV_HEADER: &str = "set,horizon,t_s_s,distance_m,theta0_rad,phi_dot0_rad_s,theta_dot0_rad_s,\
                          theta_bound_rad,phi_dot_bound_rad_s,theta_dot_bound_rad_s,torque_bound_nm,\
                          cost,cost_nonlinear,cost_linear,programs_mean,programs_most,\
                          without_plan,largest_excess,largest_excess_nonlinear\n";

fn csv_row(set: &str, case: &Case, run: &Outcome) -> String {
    let [_, theta, phi_dot, theta_dot] = case.start.into();
    let [_, theta_bound, phi_dot_bound, theta_dot_bound] = run.x.upper.into();
    let torque_bound = run.u.upper[0];
    format!(
        "{set},{},{},{},{theta},{phi_dot},{theta_dot},\
         {theta_bound},{phi_dot_bound},{theta_dot_bound},{torque_bound},{},{},{},{:.4},{},{},{},{}\n",
        case.horizon,
        case.t_s,
        case.distance,
        run.cost,
        case.nonlinear,
        case.linear,
        run.mean_programs,
        run.most_programs,
        run.without_plan,
        run.excess,
        case.nonlinear_excess,
    )
}
