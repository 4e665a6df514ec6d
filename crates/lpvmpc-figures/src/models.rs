//! Figures of the model: its refinement, and its forms beside each other.

use super::axis::share_horizontal_view;
use super::closed_loop::{STATE_LABELS, TIME_LABEL, TORQUE_LABEL};
use super::figure::{Dash, Figure, Panel, Role, Scale, Series, Style};

/// The same experiment through four models; states are (phi, theta, phi_dot, theta_dot) in rad
/// and rad/s.
#[derive(Clone, Copy, Debug)]
pub struct ModelRuns<'a> {
    /// Instants of the continuous-time models, s.
    pub time: &'a [f64],
    /// The linear model at those instants.
    pub linearised: &'a [[f64; 4]],
    /// The nonlinear model at those instants.
    pub nonlinear: &'a [[f64; 4]],
    /// The LPV model at those instants.
    pub lpv: &'a [[f64; 4]],
    /// Instants of the discrete-time model, s.
    pub sampled_time: &'a [f64],
    /// The discrete-time (Runge-Kutta) model at those instants.
    pub runge_kutta: &'a [[f64; 4]],
    /// Instants of the torque, s.
    pub torque_time: &'a [f64],
    /// The torque at those instants, N m.
    pub torque: &'a [f64],
    /// The torque is held between its instants rather than joined.
    pub torque_held: bool,
}

/// Norm of the residual over the steps of the refinement of b, with the norm it should reach.
///
/// `norms` starts with the norm before the first step.
pub fn convergence(title: &str, norms: &[f64], target: f64) -> Figure {
    let steps: Vec<f64> = (0..norms.len()).map(|step| step as f64).collect();
    let ends = [0.0, steps.last().copied().unwrap_or(0.0)];
    let target_label = format!("‖F(b*)‖ = {target:.4}");
    let target = Series::new(
        &target_label,
        &ends,
        &[target; 2],
        Style::Line(Dash::Dashed),
        Role::Reference,
    );
    let style = Style::MarkedLine(Dash::Solid);
    let norms = Series::new("‖F(b)‖", &steps, norms, style, Role::Lpv);
    let mut panel = Panel::new("iteration", "‖F(b)‖", vec![norms, target]);
    panel.y_scale = Scale::Log;
    Figure {
        title: title.to_owned(),
        panels: vec![panel],
        columns: 1,
        width: 640.0,
        height: 420.0,
    }
}

/// Four models under one torque: the four states, the torque, and the distance of the LPV model
/// from the nonlinear one (largest over the states, each in its unit).
pub fn models(title: &str, runs: &ModelRuns<'_>) -> Figure {
    let mut panels: Vec<Panel> = (0..4).map(|index| state_panel(index, runs)).collect();
    let style = match runs.torque_held {
        true => Style::Steps(Dash::Solid),
        false => Style::Line(Dash::Solid),
    };
    let torque = Series::new("", runs.torque_time, runs.torque, style, Role::Nonlinear);
    panels.push(Panel::new(TIME_LABEL, TORQUE_LABEL, vec![torque]));
    let distance: Vec<f64> = runs
        .lpv
        .iter()
        .zip(runs.nonlinear)
        .map(largest_difference)
        .collect();
    let distance = Series::new(
        "",
        runs.time,
        &distance,
        Style::Line(Dash::Solid),
        Role::Lpv,
    );
    let mut panel = Panel::new(TIME_LABEL, "max |LPV − nonlinear|", vec![distance]);
    panel.y_scale = Scale::Log;
    panels.push(panel);
    share_horizontal_view(&mut panels);
    Figure {
        title: title.to_owned(),
        panels,
        columns: 2,
        width: 900.0,
        height: 800.0,
    }
}

/// The lines lie on each other: a solid one at the back, broken ones upon it.
fn state_panel(index: usize, runs: &ModelRuns<'_>) -> Panel {
    let series = |label, time, states: &[[f64; 4]], dash, role| {
        let values: Vec<f64> = states.iter().map(|state| state[index]).collect();
        Series::new(label, time, &values, Style::Line(dash), role)
    };
    let all = vec![
        series(
            "linearised",
            runs.time,
            runs.linearised,
            Dash::Solid,
            Role::Linear,
        ),
        series(
            "nonlinear",
            runs.time,
            runs.nonlinear,
            Dash::Solid,
            Role::Nonlinear,
        ),
        series("LPV", runs.time, runs.lpv, Dash::Dashed, Role::Lpv),
        series(
            "RK4",
            runs.sampled_time,
            runs.runge_kutta,
            Dash::Dotted,
            Role::RungeKutta,
        ),
    ];
    Panel::new(TIME_LABEL, STATE_LABELS[index], all)
}

fn largest_difference((one, other): (&[f64; 4], &[f64; 4])) -> f64 {
    let differences = one.iter().zip(other).map(|(a, b)| (a - b).abs());
    // `f64::max` would pass over NaN; a gap must stay a gap.
    differences.fold(0.0, |largest, value| {
        if value > largest || value.is_nan() {
            value
        } else {
            largest
        }
    })
}
