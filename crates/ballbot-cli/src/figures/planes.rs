//! Figures of two planes together: over time, and as a path on the floor.

use super::axis::share_horizontal_view;
use super::closed_loop::{Limits, PlaneRun, REFERENCE_LABEL, Reference, state_panel, torque_panel};
use super::figure::{Dash, Figure, Panel, Role, Series, Style};

/// One path on the floor.
#[derive(Clone, Copy, Debug)]
pub struct PathRun<'a> {
    /// Name in the legend.
    pub label: &'a str,
    /// Which controller it was, for the colour.
    pub role: Role,
    /// Positions along x, m.
    pub x: &'a [f64],
    /// Positions along y, m, one for each of `x`.
    pub y: &'a [f64],
}

/// States and torque of the x and the y plane side by side.
///
/// `runs` and `references` hold the x plane, then the y plane.
pub fn two_planes(
    title: &str,
    runs: [PlaneRun<'_>; 2],
    references: Option<[Reference<'_>; 2]>,
    limits: Option<Limits>,
) -> Figure {
    let mut panels = Vec::new();
    for index in 0..4 {
        for plane in 0..2 {
            let reference = references.map(|both| both[plane]);
            panels.push(state_panel(index, &runs[plane..=plane], reference, limits));
        }
    }
    panels.extend((0..2).map(|plane| torque_panel(&runs[plane..=plane], limits)));
    share_horizontal_view(&mut panels);
    for (panel, name) in panels.iter_mut().zip(["x plane", "y plane"]) {
        name.clone_into(&mut panel.title);
    }
    Figure {
        title: title.to_owned(),
        panels,
        columns: 2,
        width: 900.0,
        height: 1080.0,
    }
}

/// Paths in the plane of the floor with equal units, their common start marked.
///
/// `reference` holds the x and y positions, m.
pub fn path_in_plane(
    title: &str,
    runs: &[PathRun<'_>],
    reference: Option<(&[f64], &[f64])>,
) -> Figure {
    let line = |label, x, y, dash, role| Series::new(label, x, y, Style::Line(dash), role);
    let mut series: Vec<Series> = runs
        .iter()
        .map(|run| line(run.label, run.x, run.y, Dash::Solid, run.role))
        .collect();
    if let Some((x, y)) = reference {
        series.push(line(REFERENCE_LABEL, x, y, Dash::Dashed, Role::Reference));
    }
    for run in runs {
        if let (Some(x), Some(y)) = (run.x.first(), run.y.first()) {
            series.push(Series::new(
                "start",
                &[*x],
                &[*y],
                Style::Markers,
                Role::Nonlinear,
            ));
        }
    }
    let mut panel = Panel::new("x [m]", "y [m]", series);
    panel.equal_aspect = true;
    Figure {
        title: title.to_owned(),
        panels: vec![panel],
        columns: 1,
        width: 640.0,
        height: 660.0,
    }
}
