//! The run itself: horizons are known at run time, the method's sizes at compile time.

use crate::error::ScenarioError;
use crate::prepare::{Plane, Prepared};
use lpvmpc::{Controller, Workspace};
use lpvmpc_sim::{Experiment, Trajectory};
use nalgebra::Vector3;
use std::time::Duration;

/// The longest horizon that is compiled in, samples.
pub const LONGEST_HORIZON: usize = 200;

/// What the run reads and reports besides its results.
pub struct Surroundings<'a> {
    /// A monotonic clock, for the time per step.
    pub clock: &'a dyn Fn() -> Duration,
    /// Called with the number of samples done, over all planes.
    pub progress: &'a dyn Fn(usize),
}

impl Prepared {
    /// Samples over all planes.
    pub fn total_samples(&self) -> usize {
        self.samples * self.planes.len()
    }

    /// Runs the closed loop of every plane.
    ///
    /// # Errors
    /// [`ScenarioError::Controller`] if the controller refuses its settings. An infeasible
    /// problem is not an error: see [`Trajectory::ending`].
    pub fn run(
        &self,
        surroundings: &Surroundings<'_>,
    ) -> Result<Vec<Trajectory<4, 1>>, ScenarioError> {
        let mut done = 0;
        let mut trajectories = Vec::with_capacity(self.planes.len());
        for plane in &self.planes {
            let progress = |samples: usize| (surroundings.progress)(done + samples);
            // Up to 4 rows of a terminal equality come on top of one row per input.
            let trajectory = match self.settings.horizon {
                ..=20 => self.run_plane::<20, 24>(plane, surroundings.clock, &progress),
                21..=50 => self.run_plane::<50, 54>(plane, surroundings.clock, &progress),
                51..=100 => self.run_plane::<100, 104>(plane, surroundings.clock, &progress),
                _ => self.run_plane::<LONGEST_HORIZON, { LONGEST_HORIZON + 4 }>(
                    plane,
                    surroundings.clock,
                    &progress,
                ),
            }?;
            done += self.samples;
            trajectories.push(trajectory);
        }
        Ok(trajectories)
    }

    fn run_plane<const N: usize, const M: usize>(
        &self,
        plane: &Plane,
        clock: &dyn Fn() -> Duration,
        progress: &dyn Fn(usize),
    ) -> Result<Trajectory<4, 1>, ScenarioError> {
        let mut workspace = Box::new(Workspace::<f64, 4, 1, N, M>::new());
        let mut controller = Box::new(Controller::<_, f64, 4, 1, 2, N, M>::new(
            self.ballbot,
            self.settings,
        )?);
        let experiment = Experiment {
            initial_state: plane.initial_state,
            samples: self.samples,
            reference: &|t| plane.state_reference(t),
            tolerances: self.tolerances,
            clock,
            progress,
        };
        Ok(lpvmpc_sim::run(
            &mut controller,
            &self.ballbot,
            &experiment,
            &mut workspace,
        ))
    }

    /// The motors' torques (tau_1, tau_2, tau_3) in N m at every sample that both planes have,
    /// without yaw torque. The torque of the x plane is tau_x of eq. (6), that of the y plane
    /// tau_y.
    pub fn motor_torques(&self, trajectories: &[Trajectory<4, 1>]) -> Vec<Vector3<f64>> {
        match trajectories {
            [x, y] => {
                let samples = x.samples.iter().zip(&y.samples);
                let torques = samples.map(|(x, y)| Vector3::new(x.u[0], y.u[0], 0.0));
                torques
                    .map(|torques| self.wheels.motors(&torques))
                    .collect()
            }
            _ => Vec::new(),
        }
    }
}
