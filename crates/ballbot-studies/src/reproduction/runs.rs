//! The paper's closed loops.

use crate::StudyError;
use crate::recorded::{Columns, Metrics};
use crate::timing::Clock;
use ballbot_scenario::{Prepared, RunHooks, Scenario, ScenarioError};
use lpvmpc::{Controller, Reference};
use lpvmpc_sim::Trajectory;
use std::ops::Range;
use std::path::Path;

/// One built-in scenario, run.
#[derive(Debug)]
pub struct Run {
    /// Its name on the command line.
    pub name: &'static str,
    /// Its settings.
    pub prepared: Prepared,
    /// One trajectory per plane.
    pub trajectories: Vec<Trajectory<4, 1>>,
    /// The same as arrays.
    pub columns: Vec<Columns>,
    /// One per plane.
    pub metrics: Vec<Metrics>,
}

/// The runs of the paper.
#[derive(Debug)]
pub struct Runs {
    /// Scenario 1.
    pub two_setpoints: Run,
    /// Scenario 1 with the linear model.
    pub two_setpoints_linear: Run,
    /// Scenario 2.
    pub lissajous: Run,
    /// Scenario 3 without guarantees.
    pub terminal_cost: Run,
    /// Scenario 3.
    pub terminal_equality: Run,
}

impl Runs {
    /// Runs all of them; `clock` is for the time per step.
    ///
    /// # Errors
    /// A scenario is not valid.
    pub fn compute(clock: Clock<'_>) -> Result<Self, StudyError> {
        Ok(Self {
            two_setpoints: Run::compute("two-setpoints", clock)?,
            two_setpoints_linear: Run::compute("two-setpoints-linear", clock)?,
            lissajous: Run::compute("lissajous", clock)?,
            terminal_cost: Run::compute("single-setpoint", clock)?,
            terminal_equality: Run::compute("single-setpoint-terminal", clock)?,
        })
    }

    /// All runs, in the order of the paper.
    pub fn all(&self) -> [&Run; 5] {
        [
            &self.two_setpoints,
            &self.two_setpoints_linear,
            &self.lissajous,
            &self.terminal_cost,
            &self.terminal_equality,
        ]
    }
}

impl Run {
    pub(super) fn compute(name: &'static str, clock: Clock<'_>) -> Result<Self, StudyError> {
        Self::of(name, &Scenario::load(name)?, clock)
    }

    /// The run of a scenario under a name.
    pub(super) fn of(
        name: &'static str,
        scenario: &Scenario,
        clock: Clock<'_>,
    ) -> Result<Self, StudyError> {
        let prepared = scenario.prepare(Path::new("."))?;
        let hooks = RunHooks {
            clock,
            ..RunHooks::NONE
        };
        let trajectories = prepared.run(&hooks)?;
        let metrics = prepared
            .planes
            .iter()
            .zip(&trajectories)
            .map(|(plane, run)| Metrics::new(&prepared, plane, run))
            .collect();
        Ok(Self {
            name,
            columns: trajectories.iter().map(Columns::from).collect(),
            prepared,
            trajectories,
            metrics,
        })
    }

    /// phi of the first plane at the sample nearest to `t` s, rad.
    pub fn phi_at(&self, t: f64) -> f64 {
        let index = (t / self.prepared.settings.t_s).round() as usize;
        let states = &self.columns[0].states;
        states[index.min(states.len() - 1)][0]
    }

    /// The first time at which phi of the first plane is within `band` of `target`, s.
    pub fn reaches(&self, target: f64, band: f64) -> f64 {
        let Columns { time, states, .. } = &self.columns[0];
        let near = states.iter().position(|x| (x[0] - target).abs() <= band);
        near.map_or(f64::INFINITY, |index| time[index])
    }

    /// The smallest phi of the first plane within these times, s.
    pub fn smallest_phi(&self, times: Range<f64>) -> f64 {
        let Columns { time, states, .. } = &self.columns[0];
        let states = time.iter().zip(states);
        let window = states.filter(|(t, _)| times.contains(*t));
        window.map(|(_, x)| x[0]).fold(f64::INFINITY, f64::min)
    }

    /// The largest phi of the first plane.
    pub fn largest_phi(&self) -> f64 {
        let states = self.columns[0].states.iter();
        states.map(|x| x[0]).fold(f64::NEG_INFINITY, f64::max)
    }

    /// |x_N predicted - x_N reached by the nonlinear model| at the first sample, for
    /// (phi, theta).
    ///
    /// # Errors
    /// The controller refuses its settings.
    pub fn first_terminal_gap(&self) -> Result<(f64, f64), StudyError> {
        let Prepared {
            ballbot,
            settings,
            planes,
            ..
        } = &self.prepared;
        let controller = Controller::allocate(*ballbot, *settings);
        let mut controller = controller.map_err(ScenarioError::from)?;
        let mut workspace = controller.workspace();
        let reference = Reference::constant(planes[0].state_reference(0.0));
        controller.step(&planes[0].initial_state, &reference, &mut workspace);
        let gap = controller.gap().abs();
        Ok((gap[0], gap[1]))
    }
}
