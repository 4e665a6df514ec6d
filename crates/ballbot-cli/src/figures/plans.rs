//! Panels about the plans of a run: their gap to the rollout, and what backs them.

use super::closed_loop::{REFERENCE_LABEL, TIME_LABEL};
use super::figure::{Dash, Panel, Role, Scale, Series, Style};

/// Names and colours of the components of a gap, with their units.
const GAP_SERIES: [(&str, Role); 4] = [
    ("φ [rad]", Role::Lpv),
    ("θ [rad]", Role::Linear),
    ("φ\u{307} [rad/s]", Role::RungeKutta),
    ("θ\u{307} [rad/s]", Role::Member(0)),
];

/// Sizes of the difference of rolled-out and predicted state at the end of the horizon. A gap
/// below the accuracy of the numbers is drawn at that.
pub fn gap_panel(time: &[f64], gap: &[[f64; 4]]) -> Panel {
    let series = GAP_SERIES.iter().enumerate().map(|(i, (label, role))| {
        let sizes: Vec<f64> = gap
            .iter()
            .map(|gap| gap[i].abs().max(f64::EPSILON))
            .collect();
        Series::new(label, time, &sizes, Style::Line(Dash::Solid), *role)
    });
    let mut panel = Panel::new(
        TIME_LABEL,
        "|rollout – prediction| at the end",
        series.collect(),
    );
    panel.y_scale = Scale::Log;
    panel
}

/// The artificial set point with the wanted one, rad, and the decision of each sample, 1 to 5.
pub fn guard_panels(
    time: &[f64],
    set_points: &[f64],
    wanted: &[f64],
    decisions: &[f64],
) -> [Panel; 2] {
    let steps = |label: &str, values: &[f64], dash: Dash, role: Role| {
        Series::new(label, time, values, Style::Steps(dash), role)
    };
    let aims = Panel::new(
        TIME_LABEL,
        "set point [rad]",
        vec![
            steps("artificial", set_points, Dash::Solid, Role::Lpv),
            steps(REFERENCE_LABEL, wanted, Dash::Dashed, Role::Reference),
        ],
    );
    let label = "1 new plan, 2 candidate, 3 terminal law, 4 soft bounds, 5 saturated LQR";
    let mut backed = Panel::new(
        TIME_LABEL,
        "backed by",
        vec![Series::new(
            label,
            time,
            decisions,
            Style::Markers,
            Role::Nonlinear,
        )],
    );
    backed.y_range = Some((0.5, 5.5));
    [aims, backed]
}
