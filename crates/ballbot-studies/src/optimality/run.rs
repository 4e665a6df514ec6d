//! The LPV controller with its defaults in the closed loops of the cases.

use super::Case;
use crate::StudyError;
use ballbot_scenario::{
    CertifiedTable, PointTable, Prepared, ReferenceTable, RunHooks, Scenario, ScenarioError,
    TerminalTable,
};
use lpvmpc::{Bounds, Controller, Iterations, Reference};
use nalgebra::Vector4;
use rayon::prelude::*;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

/// What a closed loop amounts to.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// Closed-loop cost; infinite where the robot fell.
    pub cost: f64,
    /// Quadratic programs per sample, mean.
    pub mean_programs: f64,
    /// Most of them in one sample.
    pub most_programs: usize,
    /// Samples without a plan.
    pub without_plan: usize,
    /// Largest part by which a state bound was exceeded at a sample.
    pub excess: f64,
    /// Where the ball is to be, rad.
    pub goal: f64,
    /// The bounds of the problem on the state.
    pub x: Bounds<f64, 4>,
    /// And on the torque, N m.
    pub u: Bounds<f64, 1>,
    /// States at the samples.
    pub states: Vec<Vector4<f64>>,
    /// Torques, N m.
    pub torques: Vec<f64>,
}

/// The scenario of a case.
fn scenario(case: &Case) -> Result<Scenario, ScenarioError> {
    let mut scenario = Scenario::load("single-setpoint")?;
    scenario.controller.predictor = None;
    scenario.controller.terminal = TerminalTable::default();
    scenario.controller.horizon = case.horizon;
    scenario.controller.t_s = case.t_s;
    scenario.duration_s = case.duration;
    if let Some([theta, phi_dot, theta_dot, torque]) = case.bounds {
        let within = |limit: f64| [-limit, limit];
        let bounds = &mut scenario.bounds;
        bounds.theta_rad = within(theta);
        bounds.phi_dot_rad_s = within(phi_dot);
        bounds.theta_dot_rad_s = within(theta_dot);
        bounds.torque_nm = within(torque);
    }
    let robot = scenario.prepare(Path::new("."))?.ballbot;
    let phi_rad = robot.geometry.ball_angle(case.distance);
    scenario.reference = ReferenceTable::SetPoints {
        points: vec![PointTable {
            time_s: 0.0,
            phi_rad,
        }],
    };
    Ok(scenario)
}

/// Runs all of them with `iterations`, on all cores; scenarios have [`Iterations::default`].
/// `progress` is told how many are done.
///
/// # Errors
/// A scenario is not valid.
pub fn run_all(
    cases: &[Case],
    iterations: Iterations<f64>,
    progress: &(dyn Fn(usize) + Sync),
) -> Result<Vec<Outcome>, StudyError> {
    let done = AtomicUsize::new(0);
    let outcome = |case| {
        let outcome = run(case, iterations);
        progress(done.fetch_add(1, Ordering::Relaxed) + 1);
        outcome
    };
    cases.par_iter().map(outcome).collect()
}

/// Runs one.
///
/// # Errors
/// The scenario is not valid.
pub fn run(case: &Case, iterations: Iterations<f64>) -> Result<Outcome, StudyError> {
    let prepared = scenario(case)?.prepare(Path::new("."))?;
    let Prepared {
        ballbot,
        mut settings,
        samples,
        tolerances,
        ..
    } = prepared;
    settings.iterations = iterations;
    // As in the reference's problem.
    settings.raise_prices = case.raised;
    let controller = Controller::allocate(ballbot, settings);
    let mut controller = controller.map_err(ScenarioError::from)?;
    let mut workspace = controller.workspace();
    let goal = prepared.planes[0].state_reference(0.0);
    let reference = Reference::constant(goal);
    let limits = settings.x.upper;
    let mut x = case.start;
    let mut outcome = Outcome {
        cost: 0.0,
        mean_programs: 0.0,
        most_programs: 0,
        without_plan: 0,
        excess: 0.0,
        goal: goal[0],
        x: settings.x,
        u: settings.u,
        states: vec![x],
        torques: Vec::with_capacity(samples),
    };
    for _ in 0..samples {
        let plan = controller.step(&x, &reference, &mut workspace);
        let (u, solved) = (plan.u[0], plan.status.is_solved());
        let error = x - goal;
        outcome.cost += (settings.weights.q * error).dot(&error);
        outcome.cost += (settings.weights.r * u).dot(&u);
        outcome.without_plan += usize::from(!solved);
        outcome.mean_programs += controller.problems() as f64 / samples as f64;
        outcome.most_programs = outcome.most_programs.max(controller.problems());
        outcome.torques.push(u[0]);
        match lpvmpc_sim::advance(&ballbot, &x, &u, settings.t_s, tolerances) {
            Ok(next) if next[1].abs() < std::f64::consts::FRAC_PI_2 => x = next,
            _ => {
                outcome.cost = f64::INFINITY;
                break;
            }
        }
        outcome.states.push(x);
        for (value, limit) in x.iter().zip(limits.iter()) {
            outcome.excess = outcome.excess.max(value.abs() / limit - 1.0);
        }
    }
    Ok(outcome)
}

/// Closed-loop cost of the guaranteed loop with one program per sample.
///
/// # Errors
/// The scenario is not valid.
pub fn guaranteed_cost(case: &Case) -> Result<f64, StudyError> {
    let mut scenario = scenario(case)?;
    scenario.controller.terminal = TerminalTable::Certified(CertifiedTable::default());
    let prepared = scenario.prepare(Path::new("."))?;
    let trajectories = prepared.run(&RunHooks::NONE)?;
    let weights = &prepared.settings.weights;
    let samples = trajectories.iter().flat_map(|run| &run.samples);
    Ok(samples
        .map(|sample| {
            let error = sample.x - sample.x_ref;
            (weights.q * error).dot(&error) + (weights.r * sample.u).dot(&sample.u)
        })
        .sum())
}
