//! Campaigns of one's own.

use super::values::{column, plain, toml_text};
use crate::errors::study;
use crate::work::{Report, Watch, work};
use ballbot_campaign::{
    Campaign, CampaignError, Cell, Column, Kind, RareTable, RowFile, Source, Summary,
};
use ballbot_scenario::proofs::ProvedFiles;
use numpy::PyArray1;
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use rayon::ThreadPoolBuilder;
use serde_json::{Value as Json, json};
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

/// A commented campaign.
#[pyfunction]
pub fn campaign_example() -> &'static str {
    include_str!("../../../docs/examples/campaigns/delay-and-slope.toml")
}

/// What was found: a summary, and rows, column by column.
struct Found {
    summary: Json,
    columns: Vec<(Column, Vec<Cell>)>,
}

/// Runs a campaign, whose text is a dictionary or that of a file and counts as if it stood at `path`;
/// `rows` is where its rows are put while it runs.
#[pyfunction]
pub fn run_campaign<'py>(
    py: Python<'py>,
    campaign: Bound<'py, PyAny>,
    path: PathBuf,
    threads: usize,
    rows: PathBuf,
    report: Report<'py>,
) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyDict>)> {
    let text = toml_text("campaign", &campaign)?;
    let found = work(py, &report, |watch| {
        let source = Source::parse(text, &path)?;
        let pool = ThreadPoolBuilder::new().num_threads(threads).build()?;
        pool.install(|| find(&source, &rows, watch))
    })?;
    let Found { summary, columns } = found.map_err(study)?;
    let arrays = PyDict::new(py);
    for (Column { name, kind }, cells) in columns {
        arrays.set_item(name, array(py, kind, &cells)?)?;
    }
    Ok((plain(py, &summary)?, arrays))
}

type Own<'a> = Campaign<'a, ProvedFiles<'a>>;

fn find(source: &Source, rows: &Path, watch: &Watch) -> Result<Found, CampaignError> {
    let files = ProvedFiles {
        folder: source.folder(),
        progress: &|done| watch.set_part("proving the certificate", done),
    };
    let program = concat!("lpvmpc for Python ", env!("CARGO_PKG_VERSION"));
    let campaign = Campaign::new(source, files, program)?;
    match source.file().rare {
        Some(rare) => find_rare(&campaign, &rare, watch),
        None => find_rows(&campaign, rows, watch),
    }
}

fn find_rows(campaign: &Own<'_>, path: &Path, watch: &Watch) -> Result<Found, CampaignError> {
    let unwritable = |error: &dyn std::fmt::Display| CampaignError::Results {
        path: path.to_owned(),
        problem: format!("it cannot be written: {error}"),
    };
    let file = File::create(path).map_err(|error| unwritable(&error))?;
    let mut writer = campaign.writer(BufWriter::new(file), path)?;
    watch.begin("running", campaign.runs() as usize);
    let clock = watch.clock();
    let (_, known) = campaign.run_all(&clock, &|| watch.step(), |row| {
        writer.push(row).map_err(|error| unwritable(&error))
    })?;
    writer.finish().map_err(|error| unwritable(&error))?;
    let rows = RowFile::open(path)?;
    let mut summary = json!(Summary::of(campaign, &rows)?);
    summary["known_as_asked"] = json!(known);
    let columns = rows.columns().iter().map(|column| {
        let cells = rows.first_cells(&column.name, usize::MAX)?;
        Ok((column.clone(), cells))
    });
    Ok(Found {
        summary,
        columns: columns.collect::<Result<_, CampaignError>>()?,
    })
}

/// The rows are the points that lead to the failure.
fn find_rare(campaign: &Own<'_>, rare: &RareTable, watch: &Watch) -> Result<Found, CampaignError> {
    // As many levels as there are tenths until the least probability.
    let levels = (-rare.least.log10()).ceil() as usize;
    watch.begin("rare failure", levels * rare.level_runs as usize);
    let found = campaign.rare(rare, &watch.clock(), &|| watch.step())?;
    let points = found.failures.iter();
    let points: Vec<Vec<Cell>> = points
        .map(|point| campaign.drawn_cells(&campaign.drawn_at(point)))
        .collect();
    let seed = Column::new("world.seed", Kind::Whole);
    let columns = [seed].into_iter().chain(campaign.input_columns());
    let columns = columns.enumerate().map(|(place, column)| {
        let cells = points.iter().map(|cells| cells[place].clone());
        (column, cells.collect())
    });
    Ok(Found {
        summary: json!({
            "title": campaign.source().file().title,
            "measure": rare.measure.name(),
            "above": rare.above,
            "probability": found.probability,
            "runs": found.runs,
            "levels": found.levels,
        }),
        columns: columns.collect(),
    })
}

/// A column: numbers with NaN where there are none, words, or yes, no and `None`.
fn array<'py>(py: Python<'py>, kind: Kind, cells: &[Cell]) -> PyResult<Bound<'py, PyAny>> {
    let whole = |cell: &Cell| match cell {
        Cell::Whole(number) => Some(*number),
        _ => None,
    };
    let numbers: Option<Vec<i64>> = match kind {
        Kind::Whole => cells.iter().map(whole).collect(),
        _ => None,
    };
    if let Some(numbers) = numbers {
        return PyArray1::from_vec(py, numbers).into_bound_py_any(py);
    }
    if matches!(kind, Kind::Real | Kind::Whole) {
        let numbers = cells.iter().map(|cell| cell.number().unwrap_or(f64::NAN));
        return column(py, numbers).into_bound_py_any(py);
    }
    let list = PyList::empty(py);
    for cell in cells {
        match cell {
            Cell::Text(text) => list.append(text)?,
            Cell::Flag(flag) => list.append(flag)?,
            _ => list.append(py.None())?,
        }
    }
    Ok(list.into_any())
}
