//! Figures of costs over distance, and of a run with a long horizon.

use crate::run_figures::limits;
use ballbot_studies::optimality::{Case, Outcome};
use lpvmpc_figures::{Dash, Figure, Panel, PlaneRun, Reference, Role, Series, Style, closed_loop};

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
    let shown = (SHOWN / case.t_s).round() as usize;
    let torque = &outcome.torques[..shown.min(outcome.torques.len())];
    let states: Vec<[f64; 4]> = outcome.states.iter().map(|x| (*x).into()).collect();
    let states = &states[..states.len().min(torque.len() + 1)];
    let time: Vec<f64> = (0..states.len()).map(|k| k as f64 * case.t_s).collect();
    let goal = vec![outcome.goal; time.len()];
    let run = PlaneRun {
        label: "LPV MPC",
        role: Role::Lpv,
        time: &time,
        states,
        torque,
        cost: &[],
    };
    let reference = Reference {
        time: &time,
        phi: &goal,
        held: true,
    };
    let title = format!(
        "{} m with a horizon of {} samples",
        case.distance, case.horizon
    );
    closed_loop(
        &title,
        &[run],
        Some(reference),
        Some(limits(&outcome.x, &outcome.u)),
    )
}
