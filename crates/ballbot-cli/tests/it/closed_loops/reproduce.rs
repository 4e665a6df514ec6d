//! `ballbot reproduce`: one folder with everything, every number agreeing.

use super::files;
use super::recorded::{self, assert_figure};
use crate::{assert_says, succeed};
use ballbot_scenario::{IterationsTable, PredictorTable, RunHooks, Scenario};
use ballbot_studies::recorded::Metrics;
use ballbot_studies::reproduction::Guarantee;
use serde_json::Value;
use std::collections::HashSet;
use std::path::Path;
use std::time::Duration;

const FIGURES: [&str; 9] = [
    "convergence",
    "cost-by-distance",
    "far-setpoints",
    "lissajous-motors",
    "lissajous-path",
    "lissajous-planes",
    "models",
    "single-setpoint",
    "two-setpoints",
];

/// File and samples.
const TRAJECTORIES: [(&str, usize); 6] = [
    ("lissajous-x", 1400),
    ("lissajous-y", 1400),
    ("single-setpoint", 80),
    ("single-setpoint-terminal", 80),
    ("two-setpoints", 80),
    ("two-setpoints-linear", 80),
];

const TABLES: [&str; 9] = [
    "constraints",
    "cost-by-distance",
    "elements",
    "gap",
    "linear-parameters",
    "price",
    "published-and-computed",
    "refinement",
    "times",
];

fn read(folder: &Path, name: &str) -> String {
    std::fs::read_to_string(folder.join(name)).unwrap()
}

#[test]
fn the_paper_is_reproduced() {
    let folder = tempfile::tempdir().unwrap();
    let printed = succeed(folder.path(), &["reproduce", "--out", "paper"]);
    let results = folder.path().join("paper");
    let summary: Value = serde_json::from_str(&read(&results, "summary.json")).unwrap();
    let claims = summary["claims"].as_array().unwrap();
    // What the paper prints is counted apart from what is ours.
    let of_source = |source: &str| claims.iter().filter(|c| c["source"] == source).count();
    let [printed_there, derived, own] = ["printed", "derived", "own"].map(of_source);
    assert_eq!(printed_there + derived + own, claims.len());
    assert_says(
        &printed,
        &[
            &format!("{printed_there} of {printed_there} numbers that the paper prints agree"),
            &format!("{derived} of {derived} statements derived"),
            &format!("{own} of {own} checks of our own"),
        ],
    );
    assert_says(&printed, &["report.html"]);

    assert_files(&results);
    assert_claims(claims);
    assert_report(&results, claims.len());
    for (name, samples) in TRAJECTORIES {
        let path = results
            .join("trajectories")
            .join(name)
            .with_extension("csv");
        recorded::complete(&path, samples, 0.05);
    }
    for figure in FIGURES {
        assert_figure(&results.join("figures"), figure);
    }
    for table in TABLES {
        assert_table(&read(&results, &format!("tables/{table}.csv")), table);
    }
    // The least-squares residual, and the verdict on b*.
    assert!((summary["residual"].as_f64().unwrap() - 0.432_969).abs() < 5e-7);
    assert_eq!(summary["physical"], false);

    // Once more into the same folder.
    succeed(folder.path(), &["reproduce", "--out", "paper"]);
    assert_files(&results);
}

/// These files, no others, and none half-written.
fn assert_files(results: &Path) {
    let mut expected = vec!["report.html".to_owned(), "summary.json".to_owned()];
    for figure in FIGURES {
        expected.push(format!("figures/{figure}.svg"));
        expected.push(format!("figures/{figure}.png"));
    }
    expected.extend(TABLES.map(|table| format!("tables/{table}.csv")));
    expected.extend(TRAJECTORIES.map(|(name, _)| format!("trajectories/{name}.csv")));
    expected.sort();
    assert_eq!(files(results), expected);
}

/// Every claim agrees: what it says of itself, and by its own numbers.
fn assert_claims(claims: &[Value]) {
    assert!(claims.len() >= 20, "{}", claims.len());
    for claim in claims {
        let computed = claim["computed"].as_f64().unwrap();
        let published = &claim["published"];
        let within = match published.as_object().unwrap().iter().next().unwrap() {
            (kind, number) if kind == "value" => {
                let value = number["value"].as_f64().unwrap();
                let tolerance = number["tolerance"].as_f64().unwrap();
                // A tolerance as large as the number would say nothing; zero has no size.
                assert!(value == 0.0 || tolerance < value.abs(), "{claim}");
                (computed - value).abs() <= tolerance
            }
            (kind, number) if kind == "at_most" => computed <= number.as_f64().unwrap(),
            (kind, number) if kind == "at_least" => computed >= number.as_f64().unwrap(),
            (kind, _) => panic!("`{kind}` in {claim}"),
        };
        assert!(within, "{claim}");
        assert_eq!(claim["agrees"], true, "{claim}");
    }
}

/// As many cells in every line, quoted ones counted as one.
fn assert_table(text: &str, name: &str) {
    let cells = |line: &str| {
        let outside: String = line.split('"').step_by(2).collect();
        outside.matches(',').count() + 1
    };
    let lines: Vec<&str> = text.lines().collect();
    assert!(lines.len() > 1, "{name}");
    for line in &lines {
        assert_eq!(cells(line), cells(lines[0]), "{name}: {line}");
    }
    assert!(
        !text.contains("NaN") && !text.contains("inf"),
        "{name}: {text}"
    );
}

/// One file that loads nothing and runs nothing, with every figure in it.
fn assert_report(results: &Path, claims: usize) {
    let report = read(results, "report.html");
    let lower = report.to_lowercase();
    for load in [
        "<script",
        "<link",
        "<img",
        "<iframe",
        "<object",
        "<embed",
        "src=",
        "@import",
        "url(http",
        "href=\"http",
        "https://",
    ] {
        assert!(!lower.contains(load), "`{load}`");
    }
    // The only address is the name of SVG's namespace, which nobody fetches.
    let namespaces = report
        .matches("xmlns=\"http://www.w3.org/2000/svg\"")
        .count();
    assert_eq!(report.matches("http://").count(), namespaces);
    assert_eq!(report.matches("<svg").count(), FIGURES.len());
    assert_eq!(report.matches("</svg>").count(), FIGURES.len());
    for figure in FIGURES {
        assert_says(&report, &[&format!("<figure id=\"{figure}\">")]);
        assert_says(&report, &[&read(results, &format!("figures/{figure}.svg"))]);
    }
    // Inline pictures share one document: a name given twice would mix up their parts.
    let names: Vec<&str> = report.split(" id=\"").skip(1).collect();
    let names: Vec<&str> = names
        .iter()
        .map(|rest| rest.split('"').next().unwrap())
        .collect();
    let distinct: HashSet<&str> = names.iter().copied().collect();
    assert_eq!(distinct.len(), names.len(), "{names:?}");
    let agreeing = report.matches("<td class=\"agrees\">").count();
    assert_eq!(agreeing, claims);
    assert!(!report.contains("DIFFERS"));
    let sections = [
        "Published and computed",
        "Differences from the paper",
        "Sign of p6",
        "How close to the optimum",
        "IPOPT converged at every sample",
        "What b* means physically",
        "no rigid ballbot has these parameters",
    ];
    assert_says(&report, &sections);
}

/// The paper's gap at the first sample of scenario 3 (note: 0.97 rad and 0.37 rad) closes, one
/// program per sample costs what nonlinear MPC to convergence costs, to 0.1 %, and every sample
/// of far set points is guaranteed.
#[test]
fn the_guarantee_is_kept_and_its_price_is_known() {
    let guarantee = Guarantee::compute(&|| Duration::ZERO).unwrap();
    let first = guarantee.frozen.trajectories[0].samples[0].gap.abs();
    assert!((first[0] - 0.97).abs() < 0.005, "{first}");
    assert!((first[1] - 0.37).abs() < 0.005, "{first}");
    for sample in &guarantee.converged.trajectories[0].samples {
        assert!(sample.gap.amax() < 1e-6, "{} s: {}", sample.t, sample.gap);
    }
    assert_eq!(guarantee.samples_guaranteed(), 1600);
    assert_eq!(guarantee.far.metrics[0].violations, 0);

    let nonlinear = guarantee.nonlinear;
    assert!(nonlinear.largest_last_step <= 1e-9, "{nonlinear:?}");
    let cost = guarantee.fine.metrics[0].closed_loop_cost;
    let excess = cost / nonlinear.closed_loop_cost - 1.0;
    println!("{cost} {nonlinear:?}");
    assert!(excess.abs() < 1e-3, "{cost} against {nonlinear:?}");

    // The library's descent and this program's own sequence of programs end at the same loop.
    let mut scenario = Scenario::load("two-setpoints").unwrap();
    scenario.controller.predictor = Some(PredictorTable::StageConsistent { substeps: Some(2) });
    scenario.controller.iterations = Some(IterationsTable::Descent {
        tolerance: 1e-6,
        most: 100,
        first: None,
    });
    let prepared = scenario.prepare(Path::new(".")).unwrap();
    let run = prepared.run(&RunHooks::NONE).unwrap().remove(0);
    let descent = Metrics::new(&prepared, &prepared.planes[0], &run).closed_loop_cost;
    let apart = descent / nonlinear.closed_loop_cost - 1.0;
    println!("descent {descent}, {apart:e}");
    assert!(apart.abs() < 1e-5, "{descent} against {nonlinear:?}");
}
