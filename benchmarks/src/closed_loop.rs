//! The problems of a closed loop of the ballbot, recorded sample by sample.

use crate::BenchmarkError;
use crate::comparison::Contender;
use ballbot::Ballbot;
use ballbot_scenario::{Prepared, Scenario, ScenarioError};
use lpvmpc::{Controller, Ocp, Reference, Workspace};
use lpvmpc_sim::advance;
use nalgebra::{SVector, Vector4};
use std::path::Path;

type Control = Controller<Ballbot<f64>, f64, 4, 1, 3>;

/// A closed loop, sample by sample.
pub struct Recording {
    /// The quadratic programs.
    pub problems: Vec<Ocp<f64, 4, 1>>,
    samples: Vec<Sample>,
    controller: Control,
}

/// What a step of the controller is given.
struct Sample {
    x: Vector4<f64>,
    /// The reference at each stage of the horizon.
    stages: Vec<Vector4<f64>>,
    /// The reference at its end.
    terminal: Vector4<f64>,
}

impl Sample {
    fn reference(&self) -> Reference<'_, f64, 4> {
        Reference {
            stages: &self.stages,
            terminal: self.terminal,
        }
    }
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
        let mut controller = Control::allocate(ballbot, settings).map_err(ScenarioError::from)?;
        let mut workspace = controller.workspace();
        let mut problems = Vec::with_capacity(prepared.samples);
        let mut samples = Vec::with_capacity(prepared.samples);
        let mut x = plane.initial_state;
        for k in 0..prepared.samples {
            let at = |i: usize| plane.state_reference((k + i) as f64 * settings.t_s);
            let sample = Sample {
                x,
                stages: (0..settings.horizon).map(at).collect(),
                terminal: at(settings.horizon),
            };
            let plan = controller.step(&x, &sample.reference(), &mut workspace);
            x = advance(
                &ballbot,
                &x,
                &plan.first_input(),
                settings.t_s,
                prepared.tolerances,
            )?;
            problems.push(workspace.ocp().clone());
            samples.push(sample);
        }
        Ok(Self {
            problems,
            samples,
            controller,
        })
    }

    /// The controller, to go through the same samples again.
    pub fn replay(&self) -> Replay<'_> {
        Replay {
            samples: &self.samples,
            controller: self.controller.clone(),
            workspace: self.controller.workspace(),
        }
    }
}

/// Whole steps of the controller: scheduling, predictor, quadratic program, rollout.
pub struct Replay<'a> {
    samples: &'a [Sample],
    controller: Control,
    workspace: Workspace<f64, 4, 1>,
}

impl Contender<1> for Replay<'_> {
    fn solve(&mut self, problem: usize) -> Result<SVector<f64, 1>, BenchmarkError> {
        if problem == 0 {
            self.controller.reset();
        }
        let sample = &self.samples[problem];
        let plan = self
            .controller
            .step(&sample.x, &sample.reference(), &mut self.workspace);
        Ok(plan.first_input())
    }
}
