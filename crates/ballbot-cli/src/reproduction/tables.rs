//! The tables of the paper, filled.

use super::claims::{HEADERS, cells};
use ballbot::{Ballbot, LinearParameters, limits};
use ballbot_studies::recorded::{Metrics, mean_and_deviation};
use ballbot_studies::reproduction::{Claim, Reproduction, Run};
use lpvmpc::LpvModel;
use nalgebra::Vector3;

/// A table with its file name and title.
#[derive(Clone, Debug, PartialEq)]
pub struct Sheet {
    /// File name without extension.
    pub name: &'static str,
    /// What it shows.
    pub title: &'static str,
    /// Column headers, with units.
    pub headers: Vec<String>,
    /// Rows of cells.
    pub rows: Vec<Vec<String>>,
}

impl Sheet {
    pub(super) fn new(name: &'static str, title: &'static str, headers: &[&str]) -> Self {
        Self {
            name,
            title,
            headers: headers.iter().map(|header| (*header).to_owned()).collect(),
            rows: Vec::new(),
        }
    }

    pub(super) fn row<const K: usize>(&mut self, name: &str, cells: [String; K]) {
        self.rows
            .push(std::iter::once(name.to_owned()).chain(cells).collect());
    }

    /// As CSV.
    pub fn csv(&self) -> String {
        let line = |cells: &[String]| {
            let cells = cells.iter().map(|cell| {
                if cell.contains([',', '"', '\n']) {
                    format!("\"{}\"", cell.replace('"', "\"\""))
                } else {
                    cell.clone()
                }
            });
            cells.collect::<Vec<_>>().join(",") + "\n"
        };
        let rows = self.rows.iter().map(|row| line(row));
        std::iter::once(line(&self.headers)).chain(rows).collect()
    }
}

/// A line of the constraints: its name, the limit, and the metric beside it.
type Line = (&'static str, f64, fn(&Metrics) -> f64);

fn number(value: f64) -> String {
    // The sum turns a negative zero into zero.
    format!("{:.6}", value + 0.0)
}

/// All tables: the claims first, then those of the paper.
pub fn sheets(reproduction: &Reproduction, claims: &[Claim]) -> Vec<Sheet> {
    vec![
        claims_sheet(claims),
        elements_sheet(),
        linear_sheet(reproduction),
        refinement_sheet(reproduction),
        constraints_sheet(reproduction),
        times_sheet(reproduction),
    ]
}

fn linear_sheet(reproduction: &Reproduction) -> Sheet {
    let mut sheet = Sheet::new(
        "linear-parameters",
        "Parameters p of the linear model, and what the refined b makes of them",
        &["", "p", "h(b)", "p - h(b)"],
    );
    for (i, equation) in reproduction.refinement.equations.iter().enumerate() {
        let cells = [equation.identified, equation.refined, equation.difference()];
        sheet.row(&format!("p{}", i + 1), cells.map(number));
    }
    sheet
}

fn refinement_sheet(reproduction: &Reproduction) -> Sheet {
    let mut sheet = Sheet::new(
        "refinement",
        "Refinement of b by Gauss-Newton, step by step",
        &[
            "step",
            "b1 [m^2]",
            "b2 [m^2]",
            "b3 [m^2]",
            "b4 [m^2/s]",
            "||F(b)||",
            "||step||",
        ],
    );
    for (step, iterate) in reproduction
        .refinement
        .gauss_newton
        .history
        .iter()
        .enumerate()
    {
        let b = &iterate.parameters;
        let cells = [b[0], b[1], b[2], b[3]].map(|b| format!("{b:.8}"));
        let [b1, b2, b3, b4] = cells;
        let norms = [iterate.residual_norm, iterate.step_norm].map(|n| format!("{n:.6e}"));
        let [residual, step_norm] = norms;
        sheet.row(&step.to_string(), [b1, b2, b3, b4, residual, step_norm]);
    }
    sheet
}

fn constraints_sheet(reproduction: &Reproduction) -> Sheet {
    let runs = reproduction.runs.all();
    let names = runs.map(|run| format!("{}, largest", run.name));
    let mut headers = vec!["", "lower", "upper"];
    headers.extend(names.iter().map(String::as_str));
    let mut sheet = Sheet::new(
        "constraints",
        "Constraints, and the largest magnitude reached in each run",
        &headers,
    );
    let largest =
        |run: &Run, of: fn(&Metrics) -> f64| number(run.metrics.iter().map(of).fold(0.0, f64::max));
    let rows: [Line; 4] = [
        ("theta [rad]", limits::THETA, |m| m.largest_tilt_rad),
        ("phi_dot [rad/s]", limits::PHI_DOT, |m| {
            m.largest_phi_dot_rad_s
        }),
        ("theta_dot [rad/s]", limits::THETA_DOT, |m| {
            m.largest_theta_dot_rad_s
        }),
        ("torque [N m]", limits::TORQUE, |m| m.largest_torque_nm),
    ];
    for (name, limit, of) in rows {
        let [a, b, c, d, e] = runs.map(|run| largest(run, of));
        sheet.row(name, [number(-limit), number(limit), a, b, c, d, e]);
    }
    sheet
}

fn times_sheet(reproduction: &Reproduction) -> Sheet {
    let mut sheet = Sheet::new(
        "times",
        "Time per sample: the paper's single QP, and this program's whole step (scheduling, \
         predictor, QP, rollout)",
        &[
            "",
            "paper, mean [ms]",
            "paper, std [ms]",
            "computed, mean [ms]",
            "computed, std [ms]",
            "computed, longest [ms]",
        ],
    );
    for (name, run, mean, deviation) in [
        ("scenario 1", &reproduction.runs.two_setpoints, 8.6, 10.4),
        ("scenario 2", &reproduction.runs.lissajous, 8.7, 13.2),
        ("scenario 3", &reproduction.runs.terminal_equality, 5.8, 2.5),
    ] {
        let samples = run.trajectories.iter().flat_map(|run| &run.samples);
        let times: Vec<f64> = samples
            .map(|sample| sample.step_time.as_secs_f64() * 1e3)
            .collect();
        let (computed, spread) = mean_and_deviation(&times);
        let longest = times.into_iter().fold(0.0, f64::max);
        let ours = [computed, spread, longest].map(|time| format!("{time:.4}"));
        let [computed, spread, longest] = ours;
        sheet.row(
            name,
            [
                mean.to_string(),
                deviation.to_string(),
                computed,
                spread,
                longest,
            ],
        );
    }
    sheet
}

fn claims_sheet(claims: &[Claim]) -> Sheet {
    let mut sheet = Sheet::new("published-and-computed", "Published and computed", &HEADERS);
    sheet.rows = claims.iter().map(|claim| cells(claim).to_vec()).collect();
    sheet
}

/// The Table of elements, evaluated: upright, tilted, and at the corner of the scheduling set.
fn elements_sheet() -> Sheet {
    let mut sheet = Sheet::new(
        "elements",
        "Elements of A_c and B_c at three schedulings (theta, theta_dot), and the identified p",
        &["", "(0, 0)", "(pi/6, 1)", "(pi/3, 2 pi)", "p"],
    );
    let plant = Ballbot::<f64>::paper();
    let points = [
        Vector3::zeros(),
        Vector3::new(std::f64::consts::FRAC_PI_6, 1.0, 0.0),
        Vector3::new(limits::THETA, limits::THETA_DOT, 0.0),
    ];
    let matrices = points.map(|point| plant.matrices(&point));
    let p = LinearParameters::<f64>::paper();
    let elements: [(&str, usize, usize, Option<f64>); 8] = [
        ("A32 [1/s^2]", 2, 1, Some(p.p1)),
        ("A33 [1/s]", 2, 2, Some(p.p2)),
        ("A34 [1/s]", 2, 3, None),
        ("A42 [1/s^2]", 3, 1, Some(p.p4)),
        ("A43 [1/s]", 3, 2, Some(p.p5)),
        ("A44 [1/s]", 3, 3, None),
        ("B31 [rad/(s^2 N m)]", 2, 4, Some(p.p3)),
        ("B41 [rad/(s^2 N m)]", 3, 4, Some(p.p6)),
    ];
    for (name, i, j, identified) in elements {
        let [first, second, third] = matrices.map(|(a, b)| {
            // Column 4 stands for B.
            number(if j < 4 { a[(i, j)] } else { b[i] })
        });
        let identified = identified.map_or(String::new(), number);
        sheet.row(name, [first, second, third, identified]);
    }
    sheet
}
