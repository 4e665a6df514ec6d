//! What a campaign leaves: rows, summary, figures.

use super::Own;
use super::whole::{CSV, PARQUET, RowFiles, counted};
use crate::campaign_figures::{self, Drawing};
use crate::commands::CommandError;
use crate::json;
use crate::progress::Progress;
use crate::results::ResultFolder;
use crate::table::Table;
use ballbot_campaign::{Interval, RareEstimate, RareTable, RowFile, Summary};
use ballbot_scenario::number;
use rayon::ThreadPool;
use serde_json::json;
use std::path::Path;
use std::time::Instant;

/// All files that a campaign can leave in its folder.
pub(super) const RESULTS: [&str; 13] = [
    PARQUET,
    CSV,
    SUMMARY,
    "map.svg",
    "map.png",
    "inputs.svg",
    "inputs.png",
    "parallel.svg",
    "parallel.png",
    "bands.svg",
    "bands.png",
    LEVELS,
    FAILURES,
];
const SUMMARY: &str = "summary.json";
const LEVELS: &str = "levels.csv";
const FAILURES: &str = "failures.csv";

/// Writes everything that follows from the rows, and puts these into their places. `known` says
/// whether the failures' share is known as well as asked.
pub(super) fn all(
    campaign: &Own<'_>,
    rows: RowFiles,
    results: &ResultFolder,
    (known, as_json): (bool, bool),
) -> Result<String, CommandError> {
    let file = RowFile::open(rows.parquet.temporary())?;
    let summary = Summary::of(campaign, &file)?;
    if summary.refused == summary.runs {
        return Err(CommandError::Impossible(
            "all runs were refused by the scenario: `refused = \"stop\"` says why".to_owned(),
        ));
    }
    let mut document = json!(summary);
    document["known_as_asked"] = json!(known);
    document["folder"] = json::path(results.path());
    let mut files = vec![(SUMMARY.to_owned(), json::text(&document).into_bytes())];
    for Drawing { name, figure } in campaign_figures::all(campaign, &file, &summary)? {
        files.extend(figure.files(name)?);
    }
    drop(file);
    let drafts = vec![(PARQUET, rows.parquet), (CSV, rows.csv)];
    results.write_with(drafts, &files, &RESULTS)?;
    match as_json {
        true => Ok(json::text(&document)),
        false => Ok(text(campaign, &summary, known) + &written(results)),
    }
}

fn written(results: &ResultFolder) -> String {
    format!("written to {}\n", results.path().display())
}

/// A time that does not come.
const NEVER: &str = "never";

/// A number with its interval.
fn with_interval(interval: &Interval, decimals: usize) -> String {
    let Interval {
        value,
        lower,
        upper,
    } = interval;
    let [value, lower, upper] = [value, lower, upper].map(|number| match number.is_finite() {
        true => format!("{number:.decimals$}"),
        false => NEVER.to_owned(),
    });
    format!("{value} [{lower}, {upper}]")
}

fn text(campaign: &Own<'_>, summary: &Summary, known: bool) -> String {
    let percent = |interval: Interval| Interval {
        value: 100.0 * interval.value,
        lower: 100.0 * interval.lower,
        upper: 100.0 * interval.upper,
    };
    let mut said = format!(
        "{}: {} runs, {} complete, {} fell, {} without a plan\n{} failed: {} % (Wilson, {} %)\n",
        summary.title,
        summary.runs,
        summary.complete,
        summary.fell,
        summary.no_plan,
        summary.failures,
        with_interval(&percent(summary.failure_share), 3),
        100.0 * summary.confidence,
    );
    if summary.refused > 0 {
        said += &format!(
            "{} more draws make no scenario and are left out: shares are of the others\n",
            summary.refused
        );
    }
    if !known {
        said += &format!(
            "the share of failures is not known to ±{} yet: more runs are needed\n",
            campaign
                .source()
                .file()
                .stop
                .map_or(0.0, |stop| stop.failure_share_within)
        );
    }
    if !summary.measures.is_empty() {
        let interval = format!("median [bootstrap, {} %]", 100.0 * summary.confidence);
        let mut table = Table::new(["complete runs", &interval, "5 %", "95 %", "largest"]);
        for row in &summary.measures {
            let numbers = [row.quantile_5, row.quantile_95, row.largest];
            let [low, high, most] = numbers.map(|number| match number.is_finite() {
                true => number::text(number),
                false => NEVER.to_owned(),
            });
            table.row([
                row.measure.to_owned(),
                with_interval(&row.median, 4),
                low,
                high,
                most,
            ]);
        }
        said += &format!("\n{table}");
    }
    if !summary.sensitivities.is_empty() {
        let mut table = Table::new([
            "what explains failures",
            "first-order index",
            "by chance below",
            "rank correlation",
        ]);
        for row in &summary.sensitivities {
            let rank = row
                .rank_correlation
                .map_or("-".to_owned(), |rank| format!("{rank:+.3}"));
            let index = format!("{:.3}", row.first_order);
            table.row([row.input.clone(), index, format!("{:.3}", row.noise), rank]);
        }
        said += &format!("\n{table}");
    }
    said
}

/// Estimates a rare failure and writes what was found.
pub(super) fn rare(
    campaign: &Own<'_>,
    rare: &RareTable,
    pool: &ThreadPool,
    (out, as_json): (&Path, bool),
) -> Result<String, CommandError> {
    let results = ResultFolder::open(crate::PROGRAM, out, &RESULTS)?;
    // As many levels as there are tenths until the least probability.
    let levels = (-rare.least.log10()).ceil() as usize;
    let progress = Progress::new("rare failure", levels * rare.level_runs as usize);
    let start = Instant::now();
    let found = pool.install(|| campaign.rare(rare, &|| start.elapsed(), &counted(&progress)))?;
    drop(progress);
    let mut document = json!({
        "title": campaign.source().file().title,
        "failure": format!("{} above {}", rare.measure, number::text(rare.above)),
        "probability": found.probability,
        "runs": found.runs,
        "levels": found.levels,
    });
    document["folder"] = json::path(results.path());
    let files = [
        (SUMMARY.to_owned(), json::text(&document).into_bytes()),
        (LEVELS.to_owned(), level_rows(&found, rare).into_bytes()),
        (
            FAILURES.to_owned(),
            failing_points(campaign, &found).into_bytes(),
        ),
    ];
    results.write(&files, &RESULTS)?;
    if as_json {
        return Ok(json::text(&document));
    }
    let Interval {
        value,
        lower,
        upper,
    } = found.probability;
    let said = match value > 0.0 {
        true => format!("probability {value:.3e}, 95 % between {lower:.3e} and {upper:.3e}"),
        false => format!("probability below {upper:.3e} (95 %)"),
    };
    let mut table = Table::new(["level: above", "probability", "variation", "taken"]);
    for level in &found.levels {
        let taken = level
            .acceptance
            .map_or("-".to_owned(), |taken| format!("{taken:.2}"));
        table.row([
            format!("{:.6}", rare.above - level.distance),
            format!("{:.3}", level.probability),
            format!("{:.3}", level.variation),
            taken,
        ]);
    }
    Ok(format!(
        "{}: {} above {}\n{said}, from {} runs\n\n{table}{}",
        campaign.source().file().title,
        rare.measure,
        number::text(rare.above),
        found.runs,
        written(&results)
    ))
}

fn level_rows(found: &RareEstimate, rare: &RareTable) -> String {
    let mut text = format!("{},probability,variation,acceptance\n", rare.measure);
    for level in &found.levels {
        let taken = level
            .acceptance
            .map_or(String::new(), |taken| format!("{taken:?}"));
        let threshold = rare.above - level.distance;
        text += &format!(
            "{threshold:?},{:?},{:?},{taken}\n",
            level.probability, level.variation
        );
    }
    text
}

/// The values that lead to the failure.
fn failing_points(campaign: &Own<'_>, found: &RareEstimate) -> String {
    let names = campaign
        .input_columns()
        .into_iter()
        .map(|column| column.name);
    let names: Vec<String> = ["world.seed".to_owned()].into_iter().chain(names).collect();
    let mut text = names.join(",") + "\n";
    for point in &found.failures {
        let drawn = campaign.drawn_at(point);
        let cells = campaign.drawn_cells(&drawn);
        // Commas would be columns.
        let cells = cells.iter().map(|cell| cell.text().replace(',', ";"));
        text += &(cells.collect::<Vec<_>>().join(",") + "\n");
    }
    text
}
