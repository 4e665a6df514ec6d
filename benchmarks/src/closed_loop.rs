//! The problems of a closed loop of the ballbot, recorded sample by sample.

use crate::BenchmarkError;
use crate::comparison::Contender;
use ballbot::Ballbot;
use ballbot_scenario::{Prepared, Scenario, ScenarioError};
use lpvmpc::{Controller, Ocp, Reference, Workspace};
use lpvmpc_sim::advance;
use nalgebra::{SVector, Vector4};
use std::path::Path;

/// The horizon of those scenarios.
pub const N: usize = 20;
/// A torque bound per stage, and the four rows of a terminal equality.
pub const M: usize = N + 4;

type Control = Controller<Ballbot<f64>, f64, 4, 1, 3, N, M>;

/// A closed loop, sample by sample.
pub struct Recording {
    /// The quadratic programs.
    pub problems: Vec<Ocp<f64, 4, 1, N>>,
    /// Initial state and reference of each sample.
    samples: Vec<(Vector4<f64>, Reference<f64, 4, N>)>,
    controller: Control,
}

impl Recording {
    /// Runs the built-in scenario `name`.
    ///
    /// # Errors
    /// The scenario does not load, the controller refuses it, or the plant cannot be integrated.
    pub fn new(name: &str) -> Result<Self, BenchmarkError> {
        let prepared = Scenario::load(name)?.prepare(Path::new("."))?;
        let Prepared {
            ballbot, settings, ..
        } = prepared;
        let plane = prepared.planes.first();
        let plane = plane.ok_or_else(|| BenchmarkError::NoPlane(name.to_owned()))?;
        let mut workspace = Box::new(Workspace::new());
        let mut recording = Self {
            problems: Vec::with_capacity(prepared.samples),
            samples: Vec::with_capacity(prepared.samples),
            controller: Control::new(ballbot, settings).map_err(ScenarioError::from)?,
        };
        let mut x = plane.initial_state;
        for k in 0..prepared.samples {
            let at = |i: usize| plane.state_reference((k + i) as f64 * settings.t_s);
            let reference = Reference {
                stages: std::array::from_fn(at),
                terminal: at(N),
            };
            let controller = &mut recording.controller;
            let u = controller.step(&x, &reference, &mut workspace).u[0];
            recording.problems.push(workspace.ocp().clone());
            recording.samples.push((x, reference));
            x = advance(&ballbot, &x, &u, settings.t_s, prepared.tolerances)?;
        }
        Ok(recording)
    }

    /// The controller, to go through the same samples again.
    pub fn replay(&self) -> Replay<'_> {
        Replay {
            samples: &self.samples,
            controller: self.controller.clone(),
            workspace: Box::new(Workspace::new()),
        }
    }
}

/// Whole steps of the controller: scheduling, predictor, quadratic program, rollout.
pub struct Replay<'a> {
    samples: &'a [(Vector4<f64>, Reference<f64, 4, N>)],
    controller: Control,
    workspace: Box<Workspace<f64, 4, 1, N, M>>,
}

impl Contender<1> for Replay<'_> {
    fn solve(&mut self, problem: usize) -> Result<SVector<f64, 1>, BenchmarkError> {
        if problem == 0 {
            self.controller.reset();
        }
        let (x, reference) = &self.samples[problem];
        let solution = self.controller.step(x, reference, &mut self.workspace);
        Ok(solution.u[0])
    }
}
