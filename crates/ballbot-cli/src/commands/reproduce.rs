//! `ballbot reproduce`: the paper, in one command.

use super::CommandError;
use crate::html::CaptionedFigure;
use crate::progress::Progress;
use crate::reproduction::tables::{self, Sheet};
use crate::reproduction::{claims, figures, guarantee, optimum, report};
use crate::results::ResultFolder;
use ballbot_studies::reproduction::{Claim, Reproduction};
use ballbot_studies::{StudyError, recorded};
use clap::Args;
use serde_json::json;
use std::path::PathBuf;
use std::time::Instant;

/// Arguments of `ballbot reproduce`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  ballbot reproduce
  ballbot reproduce --out results

Writes report.html (one self-contained file), every figure as SVG and PNG, every table and
trajectory as CSV, and summary.json. Exits with 0 only if every number to be met agrees
with the computed one within its stated tolerance; the column `source` says whether the paper prints
it, says it in words (the number is then ours), or it is a check of our own.")]
pub struct ReproduceArguments {
    /// Folder for the results
    #[arg(short, long, value_name = "DIR", default_value = "out/reproduction")]
    pub out: PathBuf,
}

/// Computes, writes, and compares.
///
/// # Errors
/// A file cannot be written, or a published number does not agree.
pub fn run(arguments: &ReproduceArguments) -> Result<String, CommandError> {
    let results = ResultFolder::open(
        crate::PROGRAM,
        &arguments.out,
        &["report.html", "summary.json"],
    )?;
    let reproduction = compute()?;
    let claims = reproduction.claims();
    let sheets = tables::sheets(&reproduction, &claims);
    let figures = figures::figures(&reproduction);
    write(&results, &reproduction, &claims, &sheets, &figures)?;

    let table = claims::table(&claims);
    let differing = claims.iter().filter(|claim| !claim.agrees()).count();
    let place = arguments.out.join("report.html");
    if differing == 0 {
        Ok(format!(
            "{table}\n{}; see {}\n",
            claims::counts(&claims),
            place.display()
        ))
    } else {
        Err(CommandError::Disagreement {
            table,
            differing,
            report: place,
        })
    }
}

fn compute() -> Result<Reproduction, StudyError> {
    let progress = Progress::new("reproducing", Reproduction::PARTS);
    let start = Instant::now();
    Reproduction::compute(&|| start.elapsed(), &|done| progress.set(done))
}

fn write(
    results: &ResultFolder,
    reproduction: &Reproduction,
    claims: &[Claim],
    sheets: &[Sheet],
    figures: &[CaptionedFigure],
) -> Result<(), CommandError> {
    let machine = machine();
    let mut files: Vec<(String, Vec<u8>)> = Vec::new();
    let beyond = [
        guarantee::figure(&reproduction.guarantee),
        optimum::figure(&reproduction.optimum),
    ];
    for figure in figures.iter().chain(&beyond) {
        files.extend(figure.figure.files(&format!("figures/{}", figure.name))?);
    }
    let beyond = guarantee::sheets(&reproduction.guarantee)
        .into_iter()
        .chain([optimum::sheet(&reproduction.optimum)]);
    for sheet in sheets.iter().cloned().chain(beyond) {
        let name = format!("tables/{}.csv", sheet.name);
        files.push((name, sheet.csv().into_bytes()));
    }
    for run in reproduction.runs.all() {
        let planes: &[&str] = if run.trajectories.len() == 1 {
            &[""]
        } else {
            &["-x", "-y"]
        };
        for (plane, trajectory) in planes.iter().zip(&run.trajectories) {
            let name = format!("trajectories/{}{plane}.csv", run.name);
            let text = recorded::trajectory_csv(trajectory);
            files.push((name, text.into_bytes()));
        }
    }
    let summary = summary(reproduction, claims, &machine);
    let summary = format!("{summary:#}\n");
    files.push(("summary.json".to_owned(), summary.into_bytes()));
    let report = report::html(reproduction, claims, sheets, figures, &machine)?;
    files.push(("report.html".to_owned(), report.into_bytes()));
    Ok(results.write(&files, &[])?)
}

fn summary(reproduction: &Reproduction, claims: &[Claim], machine: &str) -> serde_json::Value {
    let b = &reproduction.refinement.ballbot;
    let claims: Vec<serde_json::Value> = claims
        .iter()
        .map(|claim| {
            json!({
                "place": claim.place,
                "quantity": claim.quantity,
                "source": claim.source,
                "published": claim.published,
                "computed": claim.computed,
                "difference": claim.difference(),
                "agrees": claim.agrees(),
            })
        })
        .collect();
    let runs: serde_json::Map<String, serde_json::Value> = reproduction
        .runs
        .all()
        .into_iter()
        .map(|run| (run.name.to_owned(), json!(run.metrics)))
        .collect();
    json!({
        "version": env!("CARGO_PKG_VERSION"),
        "machine": machine,
        "claims": claims,
        "b": { "b1_m2": b.b1, "b2_m2": b.b2, "b3_m2": b.b3, "b4_m2_s": b.b4 },
        "residual": reproduction.refinement.damped.residual_norm,
        "physical": reproduction.refinement.consistency.is_physical(),
        "physical_verdict": reproduction.refinement.consistency.to_string(),
        "runs": runs,
    })
}

/// The processor's name where the system tells it, else the architecture.
fn machine() -> String {
    let information = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = information
        .lines()
        .find_map(|line| line.strip_prefix("model name"));
    let name = model
        .and_then(|line| line.split_once(':'))
        .map(|(_, name)| name.trim());
    let system = format!("{} {}", std::env::consts::OS, std::env::consts::ARCH);
    match name {
        Some(name) if !name.is_empty() => format!("{name} ({system})"),
        _ => system,
    }
}
