//! What linear, LPV and nonlinear MPC cost by the distance of the set point, in a table and a figure.

use super::tables::Sheet;
use crate::html::CaptionedFigure;
use ballbot_studies::optimality::Case;
use ballbot_studies::reproduction::{HORIZONS, Optimum};
use lpvmpc_figures::{Dash, Figure, Panel, Role, Scale, Series, Style};

/// Costs over that of nonlinear MPC, a row per loop.
pub fn sheet(optimum: &Optimum) -> Sheet {
    let headers = [
        "N",
        "distance [m]",
        "cost of nonlinear MPC",
        "linear MPC / nonlinear",
        "one program / nonlinear",
        "LPV MPC / nonlinear",
        "programs per sample, mean",
        "bounds exceeded, nonlinear [%]",
        "linear [%]",
        "LPV [%]",
    ];
    let title = "Closed-loop cost by distance, over that of nonlinear MPC, and the largest part \
                 by which a state bound was exceeded at a sample";
    let mut sheet = Sheet::new("cost-by-distance", title, &headers);
    let per_cent = |part: f64| format!("{:.2}", 100.0 * part);
    let runs = optimum.descent.iter().zip(&optimum.one_program);
    for (case, (descent, one_program)) in optimum.cases.iter().zip(runs) {
        let cells = [
            case.distance.to_string(),
            format!("{:.6e}", case.nonlinear),
            ratio(case.linear, case),
            ratio(one_program.cost, case),
            ratio(descent.cost, case),
            format!("{:.2}", descent.mean_programs),
            per_cent(case.nonlinear_excess),
            per_cent(case.linear_excess),
            per_cent(descent.excess),
        ];
        sheet.row(&case.horizon.to_string(), cells);
    }
    sheet
}

/// The cost beyond that of nonlinear MPC by distance, a panel per horizon.
pub fn figure(optimum: &Optimum) -> CaptionedFigure {
    CaptionedFigure {
        name: "cost-by-distance",
        caption: format!(
            "Closed-loop cost beyond that of nonlinear MPC (IPOPT, converged at every sample), by \
             the distance of a set point that is given at t = 0, for horizons of {} and {} \
             samples. A loop that falls has no point; the axis is logarithmic.",
            HORIZONS[0], HORIZONS[1]
        ),
        figure: Figure {
            title: "What linear and LPV MPC cost beyond nonlinear MPC".to_owned(),
            panels: HORIZONS.map(|horizon| panel(optimum, horizon)).into(),
            columns: 2,
            width: 900.0,
            height: 420.0,
        },
    }
}

fn panel(optimum: &Optimum, horizon: usize) -> Panel {
    let rows: Vec<usize> = (0..optimum.cases.len())
        .filter(|row| optimum.cases[*row].horizon == horizon)
        .collect();
    let distance: Vec<f64> = rows
        .iter()
        .map(|row| optimum.cases[*row].distance)
        .collect();
    let series = |label, cost: &dyn Fn(usize) -> f64, dash, role| {
        let excess = |row: &usize| 100.0 * (cost(*row) / optimum.cases[*row].nonlinear - 1.0);
        let values: Vec<f64> = rows.iter().map(excess).collect();
        Series::new(label, &distance, &values, Style::MarkedLine(dash), role)
    };
    let lines = vec![
        series(
            "one program, taken as it is",
            &|row| optimum.one_program[row].cost,
            Dash::Dotted,
            Role::RungeKutta,
        ),
        series(
            "linear MPC",
            &|row| optimum.cases[row].linear,
            Dash::Dashed,
            Role::Linear,
        ),
        series(
            "LPV MPC",
            &|row| optimum.descent[row].cost,
            Dash::Solid,
            Role::Lpv,
        ),
    ];
    let mut panel = Panel::new("distance of the set point [m]", "excess cost [%]", lines);
    panel.title = format!("N = {horizon}");
    panel.y_scale = Scale::Log;
    panel.y_range = Some((1e-5, 1e4));
    panel
}

fn ratio(cost: f64, case: &Case) -> String {
    match cost.is_finite() {
        true => format!("{:.4}", cost / case.nonlinear),
        false => "falls".to_owned(),
    }
}
