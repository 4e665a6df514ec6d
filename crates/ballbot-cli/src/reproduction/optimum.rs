//! What linear MPC, LPV MPC and nonlinear MPC cost on the same problem, by the distance of the set
//! point.
//!
//! The LPV loops are run here. Those of linear and of nonlinear MPC come from
//! `testdata/nonlinear-mpc`, whose program shares no code with the crates.

use super::tables::Sheet;
use crate::commands::CommandError;
use crate::html::Drawing;
use crate::optimality::{Case, Outcome, distances, run_all};
use lpvmpc::Iterations;
use lpvmpc_figures::{Dash, Figure, Panel, Role, Scale, Series, Style};

/// Sampling time of the loops that are shown, s.
pub const SAMPLING_TIME: f64 = 0.05;
/// Their horizons, samples.
const HORIZONS: [usize; 2] = [20, 60];

/// The loops, one of each kind per case.
#[derive(Debug)]
pub struct Optimum {
    /// Distances and horizons, with the costs of linear and of nonlinear MPC.
    pub cases: Vec<Case>,
    /// LPV MPC with its defaults, a descent.
    pub descent: Vec<Outcome>,
    /// LPV MPC with one program per sample, taken as it is.
    pub one_program: Vec<Outcome>,
}

impl Optimum {
    /// Runs the LPV loops.
    ///
    /// # Errors
    /// None should occur, as there is no input.
    pub fn compute() -> Result<Self, CommandError> {
        let mut cases = distances()?;
        cases.retain(|case| case.t_s == SAMPLING_TIME && HORIZONS.contains(&case.horizon));
        Ok(Self {
            descent: run_all(&cases, Iterations::default())?,
            one_program: run_all(&cases, Iterations::Fixed(1))?,
            cases,
        })
    }

    /// Duration of the loops, s.
    pub fn duration(&self) -> f64 {
        let durations = self.cases.iter().map(|case| case.duration);
        durations.fold(0.0, f64::max)
    }

    /// Samples at which IPOPT did not converge.
    pub fn not_converged(&self) -> usize {
        self.cases.iter().map(|case| case.not_converged).sum()
    }

    /// Largest cost of LPV MPC over that of nonlinear MPC.
    pub fn worst(&self) -> f64 {
        let pairs = self.cases.iter().zip(&self.descent);
        let ratios = pairs.map(|(case, run)| run.cost / case.nonlinear);
        ratios.fold(0.0, f64::max)
    }

    /// Largest cost of linear MPC over that of nonlinear MPC.
    pub fn worst_linear(&self) -> f64 {
        let ratios = self.cases.iter().map(|case| case.linear / case.nonlinear);
        ratios.fold(0.0, f64::max)
    }

    /// Costs over that of nonlinear MPC, a row per loop.
    pub fn sheet(&self) -> Sheet {
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
        let runs = self.descent.iter().zip(&self.one_program);
        for (case, (descent, one_program)) in self.cases.iter().zip(runs) {
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
    pub fn drawing(&self) -> Drawing {
        Drawing {
            name: "cost-by-distance",
            caption: format!(
                "Closed-loop cost beyond that of nonlinear MPC (IPOPT, converged at every sample), by \
                 the distance of a set point that is given at t = 0, for horizons of {} and {} \
                 samples. A loop that falls has no point; the axis is logarithmic.",
                HORIZONS[0], HORIZONS[1]
            ),
            figure: Figure {
                title: "What linear and LPV MPC cost beyond nonlinear MPC".to_owned(),
                panels: HORIZONS.map(|horizon| self.panel(horizon)).into(),
                columns: 2,
                width: 900.0,
                height: 420.0,
            },
        }
    }

    fn panel(&self, horizon: usize) -> Panel {
        let rows: Vec<usize> = (0..self.cases.len())
            .filter(|row| self.cases[*row].horizon == horizon)
            .collect();
        let distance: Vec<f64> = rows.iter().map(|row| self.cases[*row].distance).collect();
        let series = |label, cost: &dyn Fn(usize) -> f64, dash, role| {
            let excess = |row: &usize| 100.0 * (cost(*row) / self.cases[*row].nonlinear - 1.0);
            let values: Vec<f64> = rows.iter().map(excess).collect();
            Series::new(label, &distance, &values, Style::MarkedLine(dash), role)
        };
        let lines = vec![
            series(
                "one program, taken as it is",
                &|row| self.one_program[row].cost,
                Dash::Dotted,
                Role::RungeKutta,
            ),
            series(
                "linear MPC",
                &|row| self.cases[row].linear,
                Dash::Dashed,
                Role::Linear,
            ),
            series(
                "LPV MPC",
                &|row| self.descent[row].cost,
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
}

fn ratio(cost: f64, case: &Case) -> String {
    match cost.is_finite() {
        true => format!("{:.4}", cost / case.nonlinear),
        false => "falls".to_owned(),
    }
}
