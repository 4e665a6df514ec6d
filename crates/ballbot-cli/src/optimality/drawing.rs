//! Figures of costs over distance, and of a run with a long horizon.

use super::{Case, Outcome};
use crate::figures::{Band, Dash, Figure, Panel, Role, Series, Style};
use std::f64::consts::{FRAC_PI_3, PI};

/// Closed-loop costs over those of nonlinear MPC, by distance.
pub struct CostOverDistance {
    /// Distances, m.
    pub distance: Vec<f64>,
    /// Linear MPC.
    pub linear: Vec<f64>,
    /// LPV MPC.
    pub lpv: Vec<f64>,
    /// The guaranteed loop.
    pub guaranteed: Vec<f64>,
}

/// Linear, LPV and guaranteed MPC beside nonlinear MPC, which is at 1.
pub fn cost_over_distance(costs: &CostOverDistance) -> Figure {
    let CostOverDistance {
        distance,
        linear,
        lpv,
        guaranteed,
    } = costs;
    let series = |label, values: &[f64], dash, role| {
        Series::new(label, distance, values, Style::Line(dash), role)
    };
    let one = vec![1.0; distance.len()];
    let all = vec![
        series("linear MPC", linear, Dash::Dashed, Role::Linear),
        series(
            "guaranteed LPV MPC",
            guaranteed,
            Dash::Solid,
            Role::RungeKutta,
        ),
        series("LPV MPC", lpv, Dash::Solid, Role::Lpv),
        series("nonlinear MPC (IPOPT)", &one, Dash::Dotted, Role::Nonlinear),
    ];
    let panel = Panel::new(
        "distance of the set point [m]",
        "cost / cost of nonlinear MPC",
        all,
    );
    Figure {
        title: "Closed-loop cost by distance, N = 20".to_owned(),
        panels: vec![panel],
        columns: 1,
        width: 900.0,
        height: 460.0,
    }
}

/// What is shown of a run, s: the rest of it is rest.
const SHOWN: f64 = 4.0;

/// States and torque of a closed loop.
pub fn long_horizon(case: &Case, outcome: &Outcome) -> Figure {
    let time: Vec<f64> = (0..outcome.states.len())
        .map(|k| k as f64 * case.t_s)
        .collect();
    let state = |i: usize| -> Vec<f64> { outcome.states.iter().map(|x| x[i]).collect() };
    let band = |limit: f64| {
        Some(Band {
            lower: -limit,
            upper: limit,
        })
    };
    let panel = |label, values: &[f64], style, band| {
        let length = time.len().min(values.len());
        let series = Series::new("LPV MPC", &time[..length], values, style, Role::Lpv);
        let mut panel = Panel::new("time [s]", label, vec![series]);
        panel.band = band;
        panel.x_range = Some((0.0, SHOWN));
        panel
    };
    let line = Style::Line(Dash::Solid);
    Figure {
        title: format!(
            "{} m with a horizon of {} samples",
            case.distance, case.horizon
        ),
        panels: vec![
            panel("ball angle φ [rad]", &state(0), line, None),
            panel("tilt θ [rad]", &state(1), line, band(FRAC_PI_3)),
            panel("dφ/dt [rad/s]", &state(2), line, band(10.0 * PI)),
            panel(
                "torque [N m]",
                &outcome.torques,
                Style::Steps(Dash::Solid),
                band(1.5),
            ),
        ],
        columns: 2,
        width: 1000.0,
        height: 640.0,
    }
}
