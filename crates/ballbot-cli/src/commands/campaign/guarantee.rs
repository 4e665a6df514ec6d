//! The built-in campaign: what is guaranteed, counted, and where the guarantee ends.

use super::CampaignArguments;
use crate::campaign_figure::figure;
use crate::commands::CommandError;
use crate::json;
use crate::progress::Progress;
use crate::results::ResultFolder;
use crate::run_figures::limits;
use crate::table::Table;
use ballbot_studies::{Campaign, Outcome, Record, Scenarios};
use lpvmpc::Decision;
use serde_json::json;
use std::path::Path;

/// What is run when nothing else is said.
const RUNS: u32 = 10_000;
const SAMPLES: u32 = 100;
const SEED: u64 = 1;

const RESULTS: [&str; 3] = ["campaign.csv", "campaign.svg", "campaign.png"];

/// Runs the campaign and writes its results.
///
/// # Errors
/// The scenario has no guarantee, a file cannot be written, or something happened on the nominal plant
/// that is guaranteed not to.
pub fn run(arguments: &CampaignArguments) -> Result<String, CommandError> {
    let runs = arguments.runs.unwrap_or(RUNS) as usize;
    let campaign = Campaign {
        runs,
        other_runs: runs.div_ceil(20),
        samples: arguments.samples.unwrap_or(SAMPLES) as usize,
        seed: arguments.seed.unwrap_or(SEED),
        // Zero is one per core.
        threads: usize::from(arguments.threads.unwrap_or(0)),
    };
    let scenarios = Scenarios::of(arguments.options.prepare(&arguments.file)?)?;
    let out = arguments
        .out
        .as_deref()
        .unwrap_or(Path::new("out/campaign"));
    let results = ResultFolder::open(crate::PROGRAM, out, &RESULTS)?;
    let progress = Progress::new("running", campaign.total_runs());
    let outcomes = campaign.run(&scenarios, &|done| progress.set(done))?;
    drop(progress);
    let settings = &scenarios.guaranteed.settings;
    let figure = figure(&outcomes, limits(&settings.x, &settings.u).states[1]);
    let mut files = vec![(RESULTS[0].to_owned(), csv(&outcomes).into_bytes())];
    files.extend(figure.files("campaign")?);
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
        out.display()
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
