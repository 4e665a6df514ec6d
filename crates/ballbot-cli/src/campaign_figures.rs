//! The figures of a campaign of one's own: where it fails, by which input, and how its runs go.

use crate::parallel_figure::{self, Coordinate, Kind};
use ballbot_campaign::{Campaign, CampaignError, Cell, RowFile, Summary, share};
use ballbot_scenario::Files;
use ballbot_studies::recorded::Columns;
use lpvmpc_figures::{Dash, Figure, Panel, Role, Series, Style};
use rayon::prelude::*;
use std::time::Duration;

/// A figure with the name of its files.
pub struct Drawing {
    /// The name, without an ending.
    pub name: &'static str,
    /// The figure.
    pub figure: Figure,
}

/// An input with the values of the runs that could be run.
struct Input {
    name: String,
    values: Vec<f64>,
}

/// As many runs are looked at.
const RUNS: usize = 100_000;
/// Inputs with a panel or an axis of their own: the most important ones.
const INPUTS: usize = 6;
/// Runs of the figure of bands.
const DRAWN: u64 = 200;
/// Runs of each kind in the parallel scatter; more cover each other.
const LINES: usize = 60;

/// All figures that the results give. Those of failures need some, and runs that do not fail.
///
/// # Errors
/// The results cannot be read, or a run cannot be repeated.
pub fn all<F: Files + Copy + Sync>(
    campaign: &Campaign<'_, F>,
    results: &RowFile,
    summary: &Summary,
) -> Result<Vec<Drawing>, CampaignError> {
    let success = results.first_cells("success", RUNS)?;
    let ran = |cells: Vec<Cell>| {
        let ran = cells.into_iter().zip(&success);
        ran.filter(|(_, success)| **success != Cell::Missing)
            .map(|(cell, _)| cell)
    };
    let failed: Vec<bool> = ran(success.clone())
        .map(|success| success == Cell::Flag(false))
        .collect();
    let mut inputs = Vec::new();
    for found in &summary.sensitivities {
        let values = ran(results.first_cells(&found.input, RUNS)?);
        // What is infinite has no place on an axis.
        let place = |cell: Cell| cell.number().filter(|number| number.is_finite());
        let values: Option<Vec<f64>> = values.map(place).collect();
        inputs.extend(values.map(|values| Input {
            name: found.input.clone(),
            values,
        }));
    }
    inputs.truncate(INPUTS);
    let title = &summary.title;
    let mut drawings = Vec::new();
    if let [first, second, ..] = inputs.as_slice() {
        let figure = map(title, first, second, &failed);
        drawings.push(Drawing {
            name: "map",
            figure,
        });
        let figure = parallel(title, &inputs, &failed);
        drawings.push(Drawing {
            name: "parallel",
            figure,
        });
    }
    if !inputs.is_empty() {
        let figure = marginals(title, &inputs, &failed, summary.confidence);
        drawings.push(Drawing {
            name: "inputs",
            figure,
        });
    }
    drawings.extend(bands(campaign, results)?.map(|figure| Drawing {
        name: "bands",
        figure,
    }));
    Ok(drawings)
}

/// Classes of an axis of the map.
struct Classes {
    lower: f64,
    width: f64,
    count: u32,
}

/// Beyond so many different values they are put into classes.
const MOST_TILES: usize = 40;

impl Classes {
    /// One class for each value of a grid with equal steps; as many as have some runs each otherwise.
    fn of(values: &[f64]) -> Self {
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        let (lower, upper) = (sorted[0], sorted[sorted.len() - 1]);
        sorted.dedup();
        let steps = sorted.len() - 1;
        let step = (upper - lower) / steps as f64;
        let equal = sorted
            .iter()
            .enumerate()
            .all(|(i, value)| (value - lower - i as f64 * step).abs() < 1e-6 * (upper - lower));
        if steps < MOST_TILES && equal {
            let count = sorted.len() as u32;
            return Self {
                lower: lower - step / 2.0,
                width: step,
                count,
            };
        }
        let count = ((values.len() as f64 / 12.0).sqrt() as u32).clamp(3, 25);
        Self {
            lower,
            width: (upper - lower) / f64::from(count),
            count,
        }
    }

    fn index(&self, value: f64) -> u32 {
        (((value - self.lower) / self.width) as u32).min(self.count - 1)
    }

    fn middle(&self, index: u32) -> f64 {
        self.lower + (f64::from(index) + 0.5) * self.width
    }

    fn range(&self) -> (f64, f64) {
        (self.lower, self.lower + f64::from(self.count) * self.width)
    }
}

/// The share of failures over two inputs.
fn map(title: &str, x: &Input, y: &Input, failed: &[bool]) -> Figure {
    let (columns, rows) = (Classes::of(&x.values), Classes::of(&y.values));
    let mut counts = vec![(0_u32, 0_u32); (columns.count * rows.count) as usize];
    for ((x, y), failed) in x.values.iter().zip(&y.values).zip(failed) {
        let (runs, failures) =
            &mut counts[(rows.index(*y) * columns.count + columns.index(*x)) as usize];
        *runs += 1;
        *failures += u32::from(*failed);
    }
    let style = Style::Tiles {
        columns: columns.count,
        rows: rows.count,
    };
    let mut series = Vec::new();
    for percent in 0..=100_u8 {
        let tiles = counts.iter().enumerate().filter(|(_, (runs, failures))| {
            *runs > 0 && (100.0 * f64::from(*failures) / f64::from(*runs)).round() as u8 == percent
        });
        let places = tiles.map(|(i, _)| (i as u32 % columns.count, i as u32 / columns.count));
        let (mut at_x, mut at_y): (Vec<f64>, Vec<f64>) = places
            .map(|(i, j)| (columns.middle(i), rows.middle(j)))
            .unzip();
        let label = match percent % 25 {
            // In the legend whether there is such a tile or not.
            0 => {
                at_x.push(f64::NAN);
                at_y.push(f64::NAN);
                format!("{percent} % fail")
            }
            _ => String::new(),
        };
        if !at_x.is_empty() {
            series.push(Series::new(
                &label,
                &at_x,
                &at_y,
                style,
                Role::Share(percent),
            ));
        }
    }
    let mut panel = Panel::new(&x.name, &y.name, series);
    panel.x_range = Some(columns.range());
    panel.y_range = Some(rows.range());
    Figure {
        title: title.to_owned(),
        panels: vec![panel],
        columns: 1,
        width: 760.0,
        height: 620.0,
    }
}

/// Points of a marginal.
const POINTS: usize = 10;

/// The share of failures over each input.
fn marginals(title: &str, inputs: &[Input], failed: &[bool], confidence: f64) -> Figure {
    let panel = |input: &Input| {
        let mut order: Vec<usize> = (0..failed.len()).collect();
        order.sort_by(|a, b| input.values[*a].total_cmp(&input.values[*b]));
        let size = order.len().div_ceil(POINTS);
        let (mut x, mut shares) = (Vec::new(), [Vec::new(), Vec::new(), Vec::new()]);
        // Equal values stay together.
        let mut classes: Vec<Vec<usize>> = Vec::new();
        for equal in order.chunk_by(|a, b| input.values[*a] == input.values[*b]) {
            match classes.last_mut() {
                Some(class) if class.len() + equal.len() <= size => class.extend(equal),
                _ => classes.push(equal.to_vec()),
            }
        }
        for class in classes {
            let mean = class.iter().map(|i| input.values[*i]).sum::<f64>() / class.len() as f64;
            let failures = class.iter().filter(|i| failed[**i]).count();
            let found = share(failures as u64, class.len() as u64, confidence);
            x.push(mean);
            for (share, value) in shares
                .iter_mut()
                .zip([found.lower, found.value, found.upper])
            {
                share.push(100.0 * value);
            }
        }
        let [lower, middle, upper] = shares;
        let interval = format!("{} % interval", 100.0 * confidence);
        let dashed = Style::Line(Dash::Dashed);
        let series = vec![
            Series::new(&interval, &x, &lower, dashed, Role::Reference),
            Series::new(&interval, &x, &upper, dashed, Role::Reference),
            Series::new(
                "share of failures",
                &x,
                &middle,
                Style::MarkedLine(Dash::Solid),
                Role::Linear,
            ),
        ];
        let mut panel = Panel::new(&input.name, "failures [%]", series);
        let most = upper.iter().copied().fold(0.0, f64::max);
        panel.y_range = Some((0.0, (1.05 * most).clamp(1.0, 100.0)));
        panel
    };
    let panels: Vec<Panel> = inputs.iter().map(panel).collect();
    let columns = panels.len().min(2);
    let height = 60.0 + 290.0 * panels.len().div_ceil(columns) as f64;
    Figure {
        title: title.to_owned(),
        panels,
        columns,
        width: 900.0,
        height,
    }
}

/// Each run a line over its inputs.
fn parallel(title: &str, inputs: &[Input], failed: &[bool]) -> Figure {
    let coordinates = inputs.iter().map(|input| Coordinate {
        name: input.name.clone(),
        values: input.values.clone(),
        is_logarithmic: false,
    });
    let kind = |label: &str, role, wanted: bool| {
        let cases = (0..failed.len()).filter(|case| failed[*case] == wanted);
        Kind {
            label: label.to_owned(),
            role,
            cases: cases.take(LINES).collect(),
        }
    };
    let kinds = [
        kind("success", Role::Member(2), false),
        kind("failure", Role::Linear, true),
    ];
    let x_label = "input, numbered as in the legend";
    parallel_figure::figure(title, x_label, &coordinates.collect::<Vec<_>>(), &kinds)
}

/// Instants of the figure of bands.
const INSTANTS: usize = 400;
/// Its quantiles, in percent.
const QUANTILES: [(f64, &str, Dash); 3] = [
    (0.05, "5 % and 95 % of the runs", Dash::Dotted),
    (0.25, "25 % and 75 %", Dash::Dashed),
    (0.5, "median", Dash::Solid),
];

/// Quantiles of the trajectories of some runs, evenly from all, instant by instant, over those that
/// have not ended. `None` where none of them could be run.
fn bands<F: Files + Copy + Sync>(
    campaign: &Campaign<'_, F>,
    results: &RowFile,
) -> Result<Option<Figure>, CampaignError> {
    let (rows, drawn) = (results.rows(), results.rows().min(DRAWN));
    let runs = (0..drawn).into_par_iter().map(|i| {
        // Run again, since trajectories are not kept.
        match campaign.replay(i * rows / drawn, &|| Duration::ZERO) {
            Ok(replay) => {
                let planes = replay.record.planes.iter();
                Ok(Some(
                    planes
                        .map(|plane| Columns::from(&plane.trajectory))
                        .collect(),
                ))
            }
            Err(CampaignError::Refused { .. }) => Ok(None),
            Err(error) => Err(error),
        }
    });
    let runs = runs.collect::<Result<Vec<Option<Vec<Columns>>>, _>>()?;
    let runs: Vec<Vec<Columns>> = runs.into_iter().flatten().collect();
    let planes = runs.iter().map(Vec::len).max().unwrap_or(0);
    let ends = runs.iter().flatten().filter_map(|run| run.time.last());
    let end = ends.copied().fold(0.0, f64::max);
    if !(end > 0.0) {
        return Ok(None);
    }
    let mut panels = Vec::new();
    let signals: [(&str, Signal); 3] = [
        ("φ [rad]", |run, k| run.states[k][0]),
        ("θ [rad]", |run, k| run.states[k][1]),
        ("torque [N m]", |run, k| {
            run.torque.get(k).copied().unwrap_or(f64::NAN)
        }),
    ];
    for (label, signal) in signals {
        for plane in 0..planes {
            let runs: Vec<&Columns> = runs.iter().filter_map(|run| run.get(plane)).collect();
            let mut panel = Panel::new("t [s]", label, quantiles(&runs, end, signal));
            panel.x_range = Some((0.0, end));
            if planes == 2 && label.starts_with('φ') {
                panel.title = ["x plane", "y plane"][plane.min(1)].to_owned();
            }
            panels.push(panel);
        }
    }
    Ok(Some(Figure {
        title: format!("{} runs of: {}", runs.len(), campaign.source().file().title),
        panels,
        columns: planes,
        width: if planes == 1 { 720.0 } else { 1000.0 },
        height: 780.0,
    }))
}

/// A signal of a run at one of its instants.
type Signal = fn(&Columns, usize) -> f64;

fn quantiles(runs: &[&Columns], end: f64, signal: Signal) -> Vec<Series> {
    let instants = (0..=INSTANTS).map(|i| end * i as f64 / INSTANTS as f64);
    let instants: Vec<f64> = instants.collect();
    let sorted: Vec<Vec<f64>> = instants
        .iter()
        .map(|t| {
            let values = runs
                .iter()
                .filter(|run| run.time.last().is_some_and(|last| last >= t));
            let values = values.map(|run| {
                // As of the last sample; rounding must not lead to the one before.
                let next = run.time.partition_point(|time| *time <= t + 1e-9);
                signal(run, next.saturating_sub(1))
            });
            let mut values: Vec<f64> = values.filter(|value| value.is_finite()).collect();
            values.sort_by(f64::total_cmp);
            values
        })
        .collect();
    let at = |share: f64| {
        let of = |values: &Vec<f64>| {
            let place = (share * values.len() as f64) as usize;
            values
                .get(place.min(values.len().saturating_sub(1)))
                .copied()
                .unwrap_or(f64::NAN)
        };
        sorted.iter().map(of).collect::<Vec<_>>()
    };
    let mut series = Vec::new();
    for (share, label, dash) in QUANTILES {
        let style = Style::Line(dash);
        series.push(Series::new(label, &instants, &at(share), style, Role::Lpv));
        if share < 0.5 {
            series.push(Series::new(
                label,
                &instants,
                &at(1.0 - share),
                style,
                Role::Lpv,
            ));
        }
    }
    series
}
