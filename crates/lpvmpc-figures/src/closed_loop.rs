//! Figures of closed loops: states, torque and cost over time, and the motors' torques.

use super::axis::share_horizontal_view;
use super::beginning::with_beginning;
use super::figure::{Band, Dash, Figure, Panel, Role, Series, Style};

/// Labels of the state (phi, theta, phi_dot, theta_dot).
pub(super) const STATE_LABELS: [&str; 4] =
    ["φ [rad]", "θ [rad]", "φ\u{307} [rad/s]", "θ\u{307} [rad/s]"];
pub(super) const TORQUE_LABEL: &str = "τ [N m]";
pub(super) const TIME_LABEL: &str = "t [s]";
pub(super) const REFERENCE_LABEL: &str = "reference";

/// One plane of one run, as sampled by its controller.
#[derive(Clone, Copy, Debug)]
pub struct PlaneRun<'a> {
    /// Name in the legend.
    pub label: &'a str,
    /// Which controller it was, for the colour.
    pub role: Role,
    /// Instants of the states, s; n or n + 1 of them for n inputs.
    pub time: &'a [f64],
    /// (phi, theta, phi_dot, theta_dot) at each instant, rad and rad/s.
    pub states: &'a [[f64; 4]],
    /// Virtual torque held from each instant to the next, N m.
    pub torque: &'a [f64],
    /// Optimal cost J found at each of the first instants; empty where there is none.
    pub cost: &'a [f64],
}

/// The reference of phi.
#[derive(Clone, Copy, Debug)]
pub struct Reference<'a> {
    /// Instants, s.
    pub time: &'a [f64],
    /// phi_ref at each of them, rad.
    pub phi: &'a [f64],
    /// Held between the instants, as set points are, rather than joined.
    pub held: bool,
}

/// Allowed ranges; a side without bound is infinite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Of (phi, theta, phi_dot, theta_dot), rad and rad/s.
    pub states: [Band; 4],
    /// Of the virtual torque, N m.
    pub torque: Band,
}

/// Six panels of one or more runs of one plane: the four states, with the reference in phi, the
/// torque as the steps it is, and the cost. Without any cost the sixth panel is left out.
pub fn closed_loop(
    title: &str,
    runs: &[PlaneRun<'_>],
    reference: Option<Reference<'_>>,
    limits: Option<Limits>,
) -> Figure {
    let mut panels: Vec<Panel> = (0..4)
        .map(|index| state_panel(index, runs, reference, limits))
        .collect();
    panels.push(torque_panel(runs, limits));
    let with_cost = runs.iter().filter(|run| !run.cost.is_empty());
    let costs: Vec<Series> = with_cost
        .map(|run| {
            let time = run.time.get(..run.cost.len()).unwrap_or(run.time);
            Series::new(
                run.label,
                time,
                run.cost,
                Style::Line(Dash::Solid),
                run.role,
            )
        })
        .collect();
    if !costs.is_empty() {
        panels.push(Panel::new(TIME_LABEL, "cost J [–]", costs));
    }
    share_horizontal_view(&mut panels);
    Figure {
        title: title.to_owned(),
        panels,
        columns: 2,
        width: 900.0,
        height: 800.0,
    }
}

/// Torques of the three motors over time, held from each instant to the next.
///
/// `time` in s has as many instants as each of `torques` (N m), or one more; `limit` is the
/// allowed range of each motor, N m.
pub fn motor_torques(
    title: &str,
    time: &[f64],
    torques: [&[f64]; 3],
    limit: Option<Band>,
) -> Figure {
    let series = torques.iter().enumerate().map(|(index, torque)| {
        let label = format!("motor {}", index + 1);
        Series::new(
            &label,
            time,
            torque,
            Style::Steps(Dash::Solid),
            Role::Member(index),
        )
    });
    let mut panel = Panel::new(TIME_LABEL, TORQUE_LABEL, series.collect());
    panel.band = limit;
    let (panels, columns) = with_beginning(vec![panel]);
    Figure {
        title: title.to_owned(),
        panels,
        columns,
        width: 900.0,
        height: 380.0,
    }
}

/// The panel of state `index` (0 to 3, in the order of [`STATE_LABELS`]).
pub(super) fn state_panel(
    index: usize,
    runs: &[PlaneRun<'_>],
    reference: Option<Reference<'_>>,
    limits: Option<Limits>,
) -> Panel {
    let of_run = |run: &PlaneRun<'_>| {
        let values: Vec<f64> = run.states.iter().map(|state| state[index]).collect();
        Series::new(
            run.label,
            run.time,
            &values,
            Style::Line(Dash::Solid),
            run.role,
        )
    };
    // In front, as a good run hides what is behind it.
    let reference = reference
        .filter(|_| index == 0)
        .map(|reference| reference.series());
    let series = runs.iter().map(of_run).chain(reference).collect();
    let mut panel = Panel::new(TIME_LABEL, STATE_LABELS[index], series);
    panel.band = limits.map(|limits| limits.states[index]);
    panel
}

pub(super) fn torque_panel(runs: &[PlaneRun<'_>], limits: Option<Limits>) -> Panel {
    let of_run = |run: &PlaneRun<'_>| {
        // The last torque has no end when the run stops with it.
        let end = run.time.len().min(run.torque.len() + 1);
        Series::new(
            run.label,
            &run.time[..end],
            run.torque,
            Style::Steps(Dash::Solid),
            run.role,
        )
    };
    let mut panel = Panel::new(TIME_LABEL, TORQUE_LABEL, runs.iter().map(of_run).collect());
    panel.band = limits.map(|limits| limits.torque);
    panel
}

impl Reference<'_> {
    pub(super) fn series(self) -> Series {
        let style = if self.held {
            Style::Steps(Dash::Dashed)
        } else {
            Style::Line(Dash::Dashed)
        };
        Series::new(REFERENCE_LABEL, self.time, self.phi, style, Role::Reference)
    }
}
