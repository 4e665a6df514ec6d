//! A figure about the plans of a run: their gap to the rollout, and what backs them.

use super::axis::share_horizontal_view;
use super::closed_loop::{REFERENCE_LABEL, TIME_LABEL};
use super::figure::{Dash, Figure, Panel, Role, Scale, Series, Style};

/// What is known of the plans at each instant `time`, s.
#[derive(Clone, Copy, Debug)]
pub struct PlansRun<'a> {
    /// Instants, s.
    pub time: &'a [f64],
    /// Rolled-out minus predicted state (phi, theta, phi_dot, theta_dot) at the end of the horizon,
    /// rad and rad/s.
    pub gap: &'a [[f64; 4]],
    /// Of a run with a guarantee.
    pub guarantee: Option<GuaranteeRun<'a>>,
}

/// What a guarantee rests on at each instant.
#[derive(Clone, Copy, Debug)]
pub struct GuaranteeRun<'a> {
    /// Artificial set point, rad.
    pub set_points: &'a [f64],
    /// Wanted set point, rad.
    pub wanted: &'a [f64],
    /// 1 for a new plan, 2 for the candidate, 3 for the terminal law, 4 for soft bounds, 5 for the
    /// saturated LQR.
    pub decisions: &'a [f64],
}

/// A gap that is none: what a descent leaves at its tolerance, rad and rad/s.
const NO_GAP: f64 = 1e-4;

/// One panel of the gap, and for a run with a guarantee one of the set points and one of the
/// decisions. The plans of a descent are rollouts: where there is no gap, there is no panel of it, and
/// `None` where no panel is left.
pub fn plans(title: &str, run: &PlansRun<'_>) -> Option<Figure> {
    let mut gaps = run.gap.iter().flatten();
    // Negated, so that a gap that is NaN is shown, too.
    let differs = gaps.any(|gap| !(gap.abs() <= NO_GAP));
    let mut panels: Vec<Panel> = differs.then(|| gap_panel(run)).into_iter().collect();
    if let Some(guarantee) = &run.guarantee {
        panels.extend(guarantee_panels(run.time, guarantee));
    }
    share_horizontal_view(&mut panels);
    (!panels.is_empty()).then(|| Figure {
        title: title.to_owned(),
        height: 80.0 + 260.0 * panels.len() as f64,
        panels,
        columns: 1,
        width: 900.0,
    })
}

/// Names and colours of the components of a gap, with their units.
const GAP_SERIES: [(&str, Role); 4] = [
    ("φ [rad]", Role::Lpv),
    ("θ [rad]", Role::Linear),
    ("φ\u{307} [rad/s]", Role::RungeKutta),
    ("θ\u{307} [rad/s]", Role::Member(0)),
];

/// The view of a gap reaches at least up to here, so that rounding looks like what it is.
const GAP_IN_VIEW: f64 = 1e-6;

/// Sizes on a logarithmic scale; what is below the accuracy of the numbers is drawn at that.
fn gap_panel(run: &PlansRun<'_>) -> Panel {
    let series = GAP_SERIES.iter().enumerate().map(|(i, (label, role))| {
        let sizes = run.gap.iter().map(|gap| gap[i].abs().max(f64::EPSILON));
        let sizes: Vec<f64> = sizes.collect();
        Series::new(label, run.time, &sizes, Style::Line(Dash::Solid), *role)
    });
    let label = "|rollout – prediction| at the end";
    let mut panel = Panel::new(TIME_LABEL, label, series.collect());
    panel.y_scale = Scale::Log;
    let sizes = run.gap.iter().map(|gap| gap.map(f64::abs));
    let sizes = sizes.flatten().filter(|size| size.is_finite());
    let largest = sizes.fold(GAP_IN_VIEW, f64::max);
    panel.y_range = Some((0.3 * f64::EPSILON, 3.0 * largest));
    panel
}

fn guarantee_panels(time: &[f64], guarantee: &GuaranteeRun<'_>) -> [Panel; 2] {
    let steps = |label: &str, values: &[f64], dash: Dash, role: Role| {
        Series::new(label, time, values, Style::Steps(dash), role)
    };
    let aims = vec![
        steps(
            "artificial",
            guarantee.set_points,
            Dash::Solid,
            Role::Nonlinear,
        ),
        steps(
            REFERENCE_LABEL,
            guarantee.wanted,
            Dash::Dashed,
            Role::Reference,
        ),
    ];
    let label = "1 new plan, 2 candidate, 3 terminal law, 4 soft bounds, 5 saturated LQR";
    let backed = steps(label, guarantee.decisions, Dash::Solid, Role::Member(1));
    let mut backed = Panel::new(TIME_LABEL, "backed by", vec![backed]);
    backed.y_range = Some((0.5, 5.5));
    [Panel::new(TIME_LABEL, "set point [rad]", aims), backed]
}
