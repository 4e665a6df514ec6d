//! The figures of the paper.

use super::Reproduction;
use crate::html::Drawing;
use crate::pictures::{self, Shown};
use lpvmpc_figures::{ModelRuns, Role, convergence, models};

impl Reproduction {
    /// All figures, in the order of the paper.
    pub fn drawings(&self) -> Vec<Drawing> {
        let mut drawings = vec![self.refinement_drawing(), self.model_drawing()];
        drawings.push(self.two_setpoints_drawing());
        drawings.extend(self.lissajous_drawings());
        drawings.push(self.single_setpoint_drawing());
        drawings
    }

    fn refinement_drawing(&self) -> Drawing {
        let fit = &self.refinement.gauss_newton;
        let norms: Vec<f64> = fit.history.iter().map(|step| step.residual_norm).collect();
        Drawing {
            name: "convergence",
            caption: format!(
                "Refinement of b from p: the norm of the residual over the steps of the undamped \
                 Gauss-Newton iteration. It ends at {:.6}.",
                fit.residual_norm
            ),
            figure: convergence(
                "Refinement of b",
                &norms,
                self.refinement.damped.residual_norm,
            ),
        }
    }

    fn model_drawing(&self) -> Drawing {
        let runs = &self.models;
        let torque_time = &runs.sampled_time;
        let [phi, theta, ..] = runs.one_step_difference;
        let [fine_phi, fine_theta, ..] = runs.four_step_difference;
        Drawing {
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

    fn two_setpoints_drawing(&self) -> Drawing {
        let (lpv, linear) = (&self.runs.two_setpoints, &self.runs.two_setpoints_linear);
        let costs = [lpv, linear].map(|run| run.metrics[0].closed_loop_cost);
        Drawing {
            name: "two-setpoints",
            caption: format!(
                "Scenario 1: once around and back, LPV MPC against linear MPC. Shaded: outside the \
                 bounds. Closed-loop cost {:.1} and {:.1} (+{:.0} %).",
                costs[0],
                costs[1],
                100.0 * (costs[1] / costs[0] - 1.0)
            ),
            figure: pictures::one_plane(
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

    fn lissajous_drawings(&self) -> [Drawing; 3] {
        let run = &self.runs.lissajous;
        let [x, y] = [&run.columns[0], &run.columns[1]];
        let plane = |columns| Shown {
            label: "LPV MPC",
            role: Role::Lpv,
            columns,
        };
        let torques = run.prepared.motor_torques(&run.trajectories);
        [
            Drawing {
                name: "lissajous-path",
                caption: "Scenario 2: the path on the floor in 70 s, from the origin.".to_owned(),
                figure: pictures::path("Scenario 2: Lissajous curve", &run.prepared, [x, y]),
            },
            Drawing {
                name: "lissajous-planes",
                caption: "Scenario 2: states and torques of both planes, in the beginning and over 70 s. The robot \
                          starts at rest, where the curve begins at its full speed."
                    .to_owned(),
                figure: pictures::both_planes(
                    "Scenario 2: both planes",
                    &run.prepared,
                    [plane(x), plane(y)],
                ),
            },
            Drawing {
                name: "lissajous-motors",
                caption: "Scenario 2: the torques of the three motors (eq. (6), zenith angle 45°, \
                          no yaw torque)."
                    .to_owned(),
                figure: pictures::motors("Scenario 2: motor torques", &run.prepared, x, &torques),
            },
        ]
    }

    fn single_setpoint_drawing(&self) -> Drawing {
        let (equality, cost) = (&self.runs.terminal_equality, &self.runs.terminal_cost);
        let lowest = |columns: &crate::recording::Columns| {
            columns
                .states
                .iter()
                .map(|x| x[0])
                .fold(f64::INFINITY, f64::min)
        };
        Drawing {
            name: "single-setpoint",
            caption: format!(
                "Scenario 3: half a turn with the terminal equality and with the terminal cost. \
                 phi first moves the other way, to {:.3} and {:.3} rad.",
                lowest(&equality.columns[0]),
                lowest(&cost.columns[0])
            ),
            figure: pictures::one_plane(
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
}
