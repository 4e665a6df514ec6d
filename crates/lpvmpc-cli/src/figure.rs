//! The figure of a closed loop: a panel for each state, input and output.

use crate::closed_loop::Run;
use crate::experiment::Experiment;
use lpvmpc_any::Limits;
use lpvmpc_figures::{Band, Dash, Figure, Panel, Role, Series, Style};
use lpvmpc_plant::Signal;

const TIME: &str = "t [s]";

/// The figure of a run.
pub fn figure(experiment: &Experiment, run: &Run) -> Figure {
    let (data, settings) = (experiment.plant.data(), &experiment.settings);
    let time: Vec<f64> = (0..run.x.len()).map(|i| i as f64 * settings.t_s).collect();
    let samples = &time[..run.u.len()];
    let mut panels = Vec::new();
    for (i, signal) in data.states.iter().enumerate() {
        let mut series = vec![line(&time, &column(&run.x, i))];
        if !run.x_ref.is_empty() {
            let steps = Style::Steps(Dash::Dashed);
            let x_ref = column(&run.x_ref, i);
            series.push(Series::new(
                "reference",
                &time,
                &x_ref,
                steps,
                Role::Reference,
            ));
        }
        if !run.estimates.is_empty() {
            let estimate = column(&run.estimates, i);
            let dotted = Style::Line(Dash::Dotted);
            series.push(Series::new(
                "estimate",
                samples,
                &estimate,
                dotted,
                Role::Linear,
            ));
        }
        panels.push(panel(signal, series, band(&settings.x_bounds, signal, i)));
    }
    for (i, signal) in data.inputs.iter().enumerate() {
        let steps = Style::Steps(Dash::Solid);
        let series = Series::new("closed loop", &time, &column(&run.u, i), steps, Role::Lpv);
        panels.push(panel(
            signal,
            vec![series],
            band(&settings.u_bounds, signal, i),
        ));
    }
    for (i, signal) in data.outputs.iter().enumerate() {
        let series = vec![line(samples, &column(&run.y, i))];
        panels.push(panel(signal, series, band(&settings.y_bounds, signal, i)));
    }
    for (i, signal) in experiment.disturbances().iter().enumerate() {
        let found = column(&run.disturbances, i);
        let style = Style::Line(Dash::Solid);
        let series = vec![Series::new(
            "estimate",
            samples,
            &found,
            style,
            Role::Linear,
        )];
        panels.push(panel(signal, series, band(&None, signal, i)));
    }
    let end = time.last().copied().unwrap_or(0.0);
    for panel in &mut panels {
        panel.x_range = Some((0.0, end));
    }
    let rows = panels.len().div_ceil(2);
    Figure {
        title: experiment.name.clone(),
        panels,
        columns: 2,
        width: 900.0,
        height: 80.0 + 220.0 * rows as f64,
    }
}

fn column(rows: &[Vec<f64>], i: usize) -> Vec<f64> {
    rows.iter().filter_map(|row| row.get(i).copied()).collect()
}

fn line(time: &[f64], values: &[f64]) -> Series {
    Series::new(
        "closed loop",
        time,
        values,
        Style::Line(Dash::Solid),
        Role::Lpv,
    )
}

/// Name and unit of a signal.
pub fn label(signal: &Signal) -> String {
    match signal.unit.is_empty() {
        true => signal.name.clone(),
        false => format!("{} [{}]", signal.name, signal.unit),
    }
}

fn panel(signal: &Signal, series: Vec<Series>, band: Band) -> Panel {
    let mut panel = Panel::new(TIME, &label(signal), series);
    panel.band = Some(band);
    panel
}

/// The bounds of a signal: the controller's, else its own.
pub fn band(limits: &Option<Limits>, signal: &Signal, i: usize) -> Band {
    match limits {
        Some(limits) => Band {
            lower: limits.lower[i],
            upper: limits.upper[i],
        },
        None => Band {
            lower: signal.lower.unwrap_or(f64::NEG_INFINITY),
            upper: signal.upper.unwrap_or(f64::INFINITY),
        },
    }
}
