//! Figures of two planes together: over time, and as a path on the floor.

use super::beginning::with_beginning;
use super::closed_loop::{
    Limits, PlaneRun, REFERENCE_LABEL, Reference, TIME_LABEL, state_panel, torque_panel,
};
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

/// States and torque of the x and the y plane over each other; with references that are curves, the
/// distances from them, too. A beginning that would set the scale of all the rest stands beside.
///
/// `runs` and `references` hold the x plane, then the y plane.
pub fn two_planes(
    title: &str,
    runs: [PlaneRun<'_>; 2],
    references: Option<[Reference<'_>; 2]>,
    limits: Option<Limits>,
) -> Figure {
    let named = |run, label, role| PlaneRun { label, role, ..run };
    let [x, y] = runs;
    let runs = [
        named(x, "x plane", Role::Lpv),
        named(y, "y plane", Role::Member(1)),
    ];
    let mut panels: Vec<Panel> = (0..4)
        .map(|index| state_panel(index, &runs, None, limits))
        .collect();
    if let Some(references) = references {
        panels[0].series.extend(references.map(Reference::series));
        if references.iter().all(|reference| !reference.held) {
            let errors = runs.iter().zip(&references).map(error).collect();
            panels.insert(1, Panel::new(TIME_LABEL, "error of φ [rad]", errors));
        }
    }
    panels.push(torque_panel(&runs, limits));
    let rows = panels.len();
    let (panels, columns) = with_beginning(panels);
    Figure {
        title: title.to_owned(),
        panels,
        columns,
        width: 900.0,
        height: 80.0 + 200.0 * rows as f64,
    }
}

/// How far the ball is from where it is to be.
fn error((run, reference): (&PlaneRun<'_>, &Reference<'_>)) -> Series {
    let pairs = run.states.iter().zip(reference.phi);
    let errors: Vec<f64> = pairs.map(|(state, phi)| state[0] - phi).collect();
    let line = Style::Line(Dash::Solid);
    Series::new(
        run.label,
        &run.time[..errors.len()],
        &errors,
        line,
        run.role,
    )
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
