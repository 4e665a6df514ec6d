//! `ballbot campaign`.

use super::CommandError;
use super::robot::ScenarioOptions;
use crate::campaign_figure::figure;
use crate::commands::simulate::PNG_SCALE;
use crate::json;
use crate::progress::Progress;
use crate::results::ResultFolder;
use crate::run_figures::limits;
use crate::table::Table;
use ballbot_studies::{Campaign, Outcome, Record, Scenarios};
use clap::Args;
use lpvmpc::Decision;
use serde_json::json;
use std::path::PathBuf;

/// Arguments of `ballbot campaign`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  ballbot campaign                             10 000 closed loops, and 500 of each variant
  ballbot campaign --runs 200 --samples 60     a quick look
  ballbot campaign my.toml                     a loop of your own, certified by `ballbot certify`
  ballbot campaign --json                      for other programs

Each loop starts at random in the certified set and gets random set points, up to 100 rad away, at
random times. On the nominal plant, integrated to 1e-12, the first columns must count nothing,
whatever the set points and the horizon; the exit code is 1 if they do. The other variants show where
the guarantee ends: pushes, wrong parameters, torque noise, delay; the paper's scheme is the negative
control. The same seed gives the same numbers on any number of
threads. Writes campaign.csv (one row per run) and a figure.")]
pub struct CampaignArguments {
    /// A built-in scenario or a TOML file with a certified terminal set
    #[arg(default_value = "far-setpoints")]
    pub scenario: String,
    /// What it is changed by.
    #[command(flatten)]
    pub options: ScenarioOptions,
    /// Closed loops of the nominal plant; every other variant has a twentieth of them
    #[arg(long, default_value = "10000", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub runs: u32,
    /// Samples of each closed loop
    #[arg(long, default_value = "100", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub samples: u32,
    /// Seed of everything random
    #[arg(long, default_value = "1")]
    pub seed: u64,
    /// Threads [default: one per core]; the numbers do not depend on them
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Folder for the results
    #[arg(short, long, value_name = "DIR", default_value = "out/campaign")]
    pub out: PathBuf,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

const RESULTS: [&str; 3] = ["campaign.csv", "campaign.svg", "campaign.png"];

/// Runs the campaign and writes its results.
///
/// # Errors
/// The scenario has no guarantee, a file cannot be written, or something happened on the nominal plant
/// that is guaranteed not to.
pub fn run(arguments: &CampaignArguments) -> Result<String, CommandError> {
    let campaign = Campaign {
        runs: arguments.runs as usize,
        other_runs: (arguments.runs as usize).div_ceil(20),
        samples: arguments.samples as usize,
        seed: arguments.seed,
        // Zero is one per core.
        threads: usize::from(arguments.threads.unwrap_or(0)),
    };
    let scenarios = Scenarios::of(arguments.options.prepare(&arguments.scenario)?)?;
    let results = ResultFolder::open(&arguments.out, &RESULTS)?;
    let progress = Progress::new("running", campaign.total_runs());
    let outcomes = campaign.run(&scenarios, &|done| progress.set(done))?;
    drop(progress);
    let settings = &scenarios.guaranteed.settings;
    let figure = figure(&outcomes, limits(&settings.x, &settings.u).states[1]);
    let contents = [
        csv(&outcomes).into_bytes(),
        figure.svg()?.into_bytes(),
        figure.png(PNG_SCALE)?,
    ];
    let names = RESULTS.map(str::to_owned);
    let files: Vec<_> = names.into_iter().zip(contents).collect();
    results.write(&files, &[])?;
    let nominal = outcomes
        .iter()
        .filter(|outcome| outcome.variant.is_nominal());
    let broken: usize = nominal.map(|outcome| outcome.tally.broken_promises()).sum();
    if broken > 0 {
        return Err(CommandError::GuaranteeViolated {
            broken,
            table: table(&outcomes).to_string(),
        });
    }
    if arguments.json {
        return Ok(json::text(&document(&campaign, &outcomes)));
    }
    Ok(format!(
        "{} samples of {} s per run, seed {}\n{}written to {}\n",
        campaign.samples,
        scenarios.guaranteed.settings.t_s,
        campaign.seed,
        table(&outcomes),
        arguments.out.display()
    ))
}

const DECISIONS: [Decision; 5] = [
    Decision::NewPlan,
    Decision::Candidate,
    Decision::TerminalLaw,
    Decision::SoftBounds,
    Decision::SaturatedLqr,
];

/// One row per variant.
fn table(outcomes: &[Outcome]) -> Table {
    let mut table = Table::new([
        "",
        "runs",
        "samples",
        "infeasible",
        "violated",
        "between",
        "cost grew",
        "kept runs",
        "fell",
        "tilt [rad]",
        "new plan",
        "candidate",
        "term. law",
        "soft",
        "sat. LQR",
    ]);
    for Outcome { variant, tally, .. } in outcomes {
        let total = &tally.total;
        let counts = [
            tally.runs,
            total.samples,
            total.infeasible,
            total.violations,
            total.violations_between,
            total.cost_growths,
            tally.runs_within_bounds,
            tally.runs_fallen,
        ];
        let cells = std::iter::once(variant.to_string())
            .chain(counts.iter().map(usize::to_string))
            .chain([format!("{:.3}", total.largest_tilt_rad)])
            .chain(DECISIONS.map(|decision| total.count(decision).to_string()));
        table.row(cells);
    }
    table
}

fn document(campaign: &Campaign, outcomes: &[Outcome]) -> serde_json::Value {
    let variants = outcomes
        .iter()
        .map(|outcome| json!({ "variant": outcome.variant.to_string(), "tally": outcome.tally }));
    json!({
        "samples": campaign.samples,
        "seed": campaign.seed,
        "decisions": DECISIONS.map(|decision| decision.to_string()),
        "variants": variants.collect::<Vec<_>>(),
    })
}

fn csv(outcomes: &[Outcome]) -> String {
    let mut text =
        "variant,run,samples,infeasible,violations,violations_between,cost_growths,largest_growth,\
                    largest_tilt_rad,largest_gap,cost,fell,new_plan,candidate,terminal_law,\
                    soft_bounds,saturated_lqr\n"
            .to_owned();
    for outcome in outcomes {
        // Commas would be columns.
        let name = outcome.variant.to_string().replace(',', ";");
        for (number, record) in outcome.records.iter().enumerate() {
            let Record {
                samples,
                infeasible,
                violations,
                violations_between,
                cost_growths,
                largest_growth,
                largest_tilt_rad,
                largest_gap,
                cost,
                fell,
                decisions: [new, candidate, law, soft, saturated],
            } = record;
            text += &format!(
                "{name},{number},{samples},{infeasible},{violations},\
                 {violations_between},{cost_growths},\
                 {largest_growth:?},{largest_tilt_rad:?},{largest_gap:?},{cost:?},{fell},{new},{candidate},\
                 {law},{soft},{saturated}\n"
            );
        }
    }
    text
}
