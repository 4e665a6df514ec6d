//! The figures of the paper.

use crate::html::CaptionedFigure;
use crate::run_figures::{self, Shown};
use ballbot_studies::recorded::Columns;
use ballbot_studies::reproduction::Reproduction;
use lpvmpc_figures::{ModelRuns, Role, convergence, models};

/// All figures, in the order of the paper.
pub fn figures(reproduction: &Reproduction) -> Vec<CaptionedFigure> {
    let mut figures = vec![refinement_figure(reproduction), model_figure(reproduction)];
    figures.push(two_setpoints_figure(reproduction));
    figures.extend(lissajous_figures(reproduction));
    figures.push(single_setpoint_figure(reproduction));
    figures
}

fn refinement_figure(reproduction: &Reproduction) -> CaptionedFigure {
    let fit = &reproduction.refinement.gauss_newton;
    let norms: Vec<f64> = fit.history.iter().map(|step| step.residual_norm).collect();
    CaptionedFigure {
        name: "convergence",
        caption: format!(
            "Refinement of b from p: the norm of the residual over the steps of the undamped \
             Gauss-Newton iteration. It ends at {:.6}.",
            fit.residual_norm
        ),
        figure: convergence(
            "Refinement of b",
            &norms,
            reproduction.refinement.damped.residual_norm,
        ),
    }
}

fn model_figure(reproduction: &Reproduction) -> CaptionedFigure {
    let runs = &reproduction.models;
    let torque_time = &runs.sampled_time;
    let [phi, theta, ..] = runs.one_step_difference;
    let [fine_phi, fine_theta, ..] = runs.four_step_difference;
    CaptionedFigure {
        name: "models",
        caption: format!(
            "Four models under a multi-harmonic torque, each stabilised by the same sampled \
             regulator. The LPV model differs from the nonlinear one by {:.1e} at most. One \
             Runge-Kutta step per sample of 0.05 s differs from the adaptive integrator by \
             {phi:.2e} rad in phi and {theta:.2e} rad in theta, four steps by \
             {fine_phi:.1e} and {fine_theta:.1e} rad.",
            runs.lpv_difference
        ),
        figure: models(
            "Linearised, nonlinear, LPV and Runge-Kutta model",
            &ModelRuns {
                time: &runs.time,
                linearised: &runs.linearised,
                nonlinear: &runs.nonlinear,
                lpv: &runs.lpv,
                sampled_time: &runs.sampled_time,
                runge_kutta: &runs.runge_kutta,
                torque_time,
                torque: &runs.torque,
                torque_held: true,
            },
        ),
    }
}

fn two_setpoints_figure(reproduction: &Reproduction) -> CaptionedFigure {
    let (lpv, linear) = (
        &reproduction.runs.two_setpoints,
        &reproduction.runs.two_setpoints_linear,
    );
    let costs = [lpv, linear].map(|run| run.metrics[0].closed_loop_cost);
    CaptionedFigure {
        name: "two-setpoints",
        caption: format!(
            "Scenario 1: once around and back, LPV MPC against linear MPC. Shaded: outside the \
             bounds. Closed-loop cost {:.1} and {:.1} (+{:.0} %).",
            costs[0],
            costs[1],
            100.0 * (costs[1] / costs[0] - 1.0)
        ),
        figure: run_figures::one_plane(
            "Scenario 1: two set points",
            &lpv.prepared,
            &[
                Shown {
                    label: "LPV MPC",
                    role: Role::Lpv,
                    columns: &lpv.columns[0],
                },
                Shown {
                    label: "linear MPC",
                    role: Role::Linear,
                    columns: &linear.columns[0],
                },
            ],
        ),
    }
}

fn lissajous_figures(reproduction: &Reproduction) -> [CaptionedFigure; 3] {
    let run = &reproduction.runs.lissajous;
    let [x, y] = [&run.columns[0], &run.columns[1]];
    let plane = |columns| Shown {
        label: "LPV MPC",
        role: Role::Lpv,
        columns,
    };
    let torques = run.prepared.motor_torques(&run.trajectories);
    [
        CaptionedFigure {
            name: "lissajous-path",
            caption: "Scenario 2: the path on the floor in 70 s, from the origin.".to_owned(),
            figure: run_figures::path("Scenario 2: Lissajous curve", &run.prepared, [x, y]),
        },
        CaptionedFigure {
            name: "lissajous-planes",
            caption: "Scenario 2: states and torques of both planes, in the beginning and over 70 s. The robot \
                      starts at rest, where the curve begins at its full speed."
                .to_owned(),
            figure: run_figures::both_planes(
                "Scenario 2: both planes",
                &run.prepared,
                [plane(x), plane(y)],
            ),
        },
        CaptionedFigure {
            name: "lissajous-motors",
            caption: "Scenario 2: the torques of the three motors (eq. (6), zenith angle 45°, \
                      no yaw torque)."
                .to_owned(),
            figure: run_figures::motors("Scenario 2: motor torques", &run.prepared, x, &torques),
        },
    ]
}

fn single_setpoint_figure(reproduction: &Reproduction) -> CaptionedFigure {
    let (equality, cost) = (
        &reproduction.runs.terminal_equality,
        &reproduction.runs.terminal_cost,
    );
    let lowest = |columns: &Columns| {
        columns
            .states
            .iter()
            .map(|x| x[0])
            .fold(f64::INFINITY, f64::min)
    };
    CaptionedFigure {
        name: "single-setpoint",
        caption: format!(
            "Scenario 3: half a turn with the terminal equality and with the terminal cost. \
             phi first moves the other way, to {:.3} and {:.3} rad.",
            lowest(&equality.columns[0]),
            lowest(&cost.columns[0])
        ),
        figure: run_figures::one_plane(
            "Scenario 3: single set point",
            &cost.prepared,
            &[
                Shown {
                    label: "terminal equality",
                    role: Role::Lpv,
                    columns: &equality.columns[0],
                },
                Shown {
                    label: "terminal cost",
                    role: Role::Linear,
                    columns: &cost.columns[0],
                },
            ],
        ),
    }
}
