//! Nonlinear MPC, solved to convergence: the measure for what one quadratic program per sample
//! along the LPV model costs.
//!
//! The problem is that of the LPV controller with the Runge-Kutta rollout as its model. It is
//! solved by sequential quadratic programming with the rollout's true Jacobians (Bock and Plitt
//! 1984; Rawlings, Mayne and Diehl, Model Predictive Control, ch. 8): as the cost is quadratic,
//! a step that is zero is a stationary point of the nonlinear problem.
//!
//! It is no copy of the library's descent but a check of it: of the library it takes the solver of
//! quadratic programs and the rollout, and has Jacobians (central differences), line search and end
//! of the iteration of its own. A test has both end at the same closed loop.

use crate::StudyError;
use ballbot::{Ballbot, ControllerSettings};
use ballbot_scenario::Prepared;
use lpvmpc::{Common, Ocp, Rk4, Solution, Solver, SolverSettings, TerminalIngredient, WarmStart};
use nalgebra::{Matrix4, Vector1, Vector4};

/// Nonlinear MPC for one plane.
struct NonlinearMpc<'a> {
    ballbot: &'a Ballbot<f64>,
    settings: &'a ControllerSettings<f64>,
    p: Matrix4<f64>,
    ocp: Ocp<f64, 4, 1>,
    solver: Solver<f64, 4, 1>,
    solution: Solution<f64, 4, 1>,
}

/// Closed-loop cost and effort of nonlinear MPC.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NonlinearRun {
    /// The sum of ||x - x_ref||_Q^2 + ||u||_R^2 over the run.
    pub closed_loop_cost: f64,
    /// Quadratic programs per sample, mean.
    pub mean_programs: f64,
    /// Largest relative change of the inputs in the last program of a sample.
    pub largest_last_step: f64,
}

/// Runs nonlinear MPC on the first plane of `prepared`, whose terminal ingredient must be a cost.
///
/// # Errors
/// The plant cannot be integrated, or the problem is another one.
pub fn run(prepared: &Prepared) -> Result<NonlinearRun, StudyError> {
    let settings = &prepared.settings;
    let TerminalIngredient::Cost(p) = settings.terminal else {
        return Err(StudyError::Unsuitable(
            "the nonlinear MPC takes a terminal cost",
        ));
    };
    let capacity = settings.capacity();
    let mut mpc = NonlinearMpc {
        ballbot: &prepared.ballbot,
        settings,
        p,
        ocp: Ocp::allocate(settings.horizon),
        solver: Solver::allocate(capacity),
        solution: Solution::allocate(capacity),
    };
    let plane = &prepared.planes[0];
    let mut x = plane.initial_state;
    let mut u = vec![Vector1::zeros(); settings.horizon];
    let mut run = NonlinearRun {
        closed_loop_cost: 0.0,
        mean_programs: 0.0,
        largest_last_step: 0.0,
    };
    for k in 0..prepared.samples {
        let t = k as f64 * settings.t_s;
        let at = |i: usize| plane.state_reference(t + i as f64 * settings.t_s);
        let references: Vec<Vector4<f64>> = (0..=settings.horizon).map(at).collect();
        let (programs, last_step) = mpc.solve(&x, &references, &mut u);
        run.mean_programs += programs as f64 / prepared.samples as f64;
        run.largest_last_step = run.largest_last_step.max(last_step);
        run.closed_loop_cost += mpc.stage_cost(&x, &references[0], &u[0]);
        x = lpvmpc_sim::advance(
            &prepared.ballbot,
            &x,
            &u[0],
            settings.t_s,
            prepared.tolerances,
        )?;
        u.rotate_left(1);
    }
    Ok(run)
}

impl NonlinearMpc<'_> {
    fn rk4(&self) -> Rk4 {
        self.settings.predictor.rk4()
    }

    fn next(&self, x: &Vector4<f64>, u: &Vector1<f64>) -> Vector4<f64> {
        self.rk4().advance(self.ballbot, x, u, self.settings.t_s)
    }

    fn stage_cost(&self, x: &Vector4<f64>, x_ref: &Vector4<f64>, u: &Vector1<f64>) -> f64 {
        let weights = &self.settings.weights;
        let error = x - x_ref;
        error.dot(&(weights.q * error)) + u.dot(&(weights.r * u))
    }

    /// The cost of `u` on the nonlinear model; infinite where a bound is violated.
    fn cost(&self, x0: &Vector4<f64>, references: &[Vector4<f64>], u: &[Vector1<f64>]) -> f64 {
        let mut x = *x0;
        let mut cost = 0.0;
        for (u, x_ref) in u.iter().zip(references) {
            cost += self.stage_cost(&x, x_ref, u);
            x = self.next(&x, u);
            if !self.settings.x.contains(&x, 1e-9) {
                return f64::INFINITY;
            }
        }
        let error = x - references[u.len()];
        cost + error.dot(&(self.p * error))
    }

    /// Improves `u` until it stays as it is; returns the number of programs and the relative
    /// size of the last change, infinite if a program had no solution.
    fn solve(
        &mut self,
        x: &Vector4<f64>,
        references: &[Vector4<f64>],
        u: &mut Vec<Vector1<f64>>,
    ) -> (usize, f64) {
        const MOST: usize = 100;
        const CONVERGED: f64 = 1e-9;
        let mut change = f64::INFINITY;
        for programs in 1..=MOST {
            self.pose(x, references, u);
            let settings = SolverSettings {
                warm_start: WarmStart::Cold,
                ..self.settings.solver
            };
            self.solver.solve(&self.ocp, &settings, &mut self.solution);
            if !self.solution.status.is_solved() {
                return (programs, f64::INFINITY);
            }
            let proposal = self.solution.u.to_vec();
            let before = self.cost(x, references, u);
            // Far from the solution a full step may cost more; the last ones are full.
            let mut part = 1.0;
            while part > 1e-3 && self.cost(x, references, &between(u, &proposal, part)) > before {
                part *= 0.5;
            }
            let largest = proposal
                .iter()
                .fold(1e-12, |most: f64, u| most.max(u.amax()));
            let steps = u.iter().zip(&proposal);
            change = steps.fold(0.0, |most: f64, (u, v)| most.max((v - u).amax())) / largest;
            if change <= CONVERGED {
                return (programs, change);
            }
            *u = between(u, &proposal, part);
        }
        (MOST, change)
    }

    /// The quadratic program along the rollout of `u`: x+ = A x + B u + c with the rollout's
    /// Jacobians.
    fn pose(&mut self, x0: &Vector4<f64>, references: &[Vector4<f64>], u: &[Vector1<f64>]) {
        let weights = self.settings.weights;
        let mut x = *x0;
        for (i, u) in u.iter().enumerate() {
            let next = self.next(&x, u);
            let (a, b) = self.jacobians(&x, u);
            let stage = &mut self.ocp.stages[i];
            (stage.a, stage.b) = (a, b);
            stage.c = next - a * x - b * u;
            stage.linear_x = -(weights.q * references[i]);
            x = next;
        }
        self.ocp.x0 = *x0;
        self.ocp.common = Common {
            q: weights.q,
            r: weights.r,
            x: self.settings.x,
            u: self.settings.u,
            ..Common::default()
        };
        self.ocp.terminal.p = self.p;
        self.ocp.terminal.linear_x = -(self.p * references[u.len()]);
        self.ocp.terminal.x = self.settings.x;
    }

    /// d x+ / d x and d x+ / d u by central differences.
    fn jacobians(&self, x: &Vector4<f64>, u: &Vector1<f64>) -> (Matrix4<f64>, Vector4<f64>) {
        const STEP: f64 = 1e-5;
        let slope = |dx: Vector4<f64>, du: Vector1<f64>| {
            (self.next(&(x + dx), &(u + du)) - self.next(&(x - dx), &(u - du))) / (2.0 * STEP)
        };
        let columns = [0, 1, 2, 3].map(|i| slope(Vector4::ith(i, STEP), Vector1::zeros()));
        let b = slope(Vector4::zeros(), Vector1::new(STEP));
        (Matrix4::from_columns(&columns), b)
    }
}

/// The inputs `part` of the way from `u` to `v`.
fn between(u: &[Vector1<f64>], v: &[Vector1<f64>], part: f64) -> Vec<Vector1<f64>> {
    let steps = u.iter().zip(v);
    steps.map(|(u, v)| u + (v - u) * part).collect()
}
