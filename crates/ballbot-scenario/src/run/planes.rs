//! The run itself.

use crate::error::ScenarioError;
use crate::prepare::prepared::{Plane, Prepared};
use crate::prepare::world::{PlaneWorld, Robot};
use crate::run::excited::Excited;
use crate::run::motor_sample::MotorSample;
use crate::run::record::{Record, RunHooks};
use ballbot::PlaneRegulator;
use lpvmpc::Regulator;
use lpvmpc_sim::{ClosedLoop, RunConfig, Trajectory, World};
use nalgebra::Vector3;

/// The closed loop of one plane, whatever the horizon. The sensors are those of (phi, theta,
/// phi_dot, theta_dot), the load that of [`ballbot::Disturbed::f`].
pub type PlaneLoop = ClosedLoop<Excited<PlaneRegulator>, Robot, 4, 1, 4, 2>;

type PlaneInWorld = World<Robot, 4, 1, 4, 2>;

impl Prepared {
    /// Samples over all planes.
    pub fn total_samples(&self) -> usize {
        self.samples * self.planes.len()
    }

    /// Runs the closed loop of every plane.
    ///
    /// # Errors
    /// [`ScenarioError::Controller`] if the controller refuses its settings. An infeasible
    /// problem is not an error: see [`Trajectory::termination`].
    pub fn run(&self, hooks: &RunHooks<'_>) -> Result<Vec<Trajectory<4, 1>>, ScenarioError> {
        let planes = self.record(hooks)?.planes.into_iter();
        Ok(planes.map(|recording| recording.trajectory).collect())
    }

    /// [`run`](Self::run), with what the robot's sensors delivered, and its motors did.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    pub fn record(&self, hooks: &RunHooks<'_>) -> Result<Record, ScenarioError> {
        if let (Some(motors), [x, y]) = (&self.motors, self.planes.as_slice()) {
            return self.record_whole(motors, [x, y], hooks);
        }
        let mut planes = Vec::with_capacity(self.planes.len());
        for (done, plane) in self.planes.iter().enumerate() {
            let course = RunConfig {
                samples: self.samples,
                reference: &|t| plane.state_reference(t),
                clock: hooks.clock,
                progress: &|samples| (hooks.progress)(done * self.samples + samples),
            };
            let mut closed_loop = self.closed_loop(plane)?;
            planes.push(lpvmpc_sim::record(&mut closed_loop, &course));
        }
        Ok(Record {
            planes,
            motors: None,
            robot_log: Vec::new(),
        })
    }

    /// The closed loop of one plane at time zero, to be stepped sample by sample.
    ///
    /// # Errors
    /// [`ScenarioError::Controller`] if the controller refuses its settings;
    /// [`ScenarioError::Value`] if the planes share their motors, and so make one loop.
    pub fn closed_loop(&self, plane: &Plane) -> Result<PlaneLoop, ScenarioError> {
        let PlaneWorld {
            robot, settings, ..
        } = plane.world.clone();
        let world = World::new(robot, plane.initial_state, settings)?;
        self.loop_in(plane, world)
    }

    /// The loop of `plane` where `before` stands, which may be one of another scenario: nothing
    /// that is known, planned, commanded or on its way is lost.
    ///
    /// # Errors
    /// As [`closed_loop`](Self::closed_loop).
    pub fn continued_loop(
        &self,
        plane: &Plane,
        before: &PlaneLoop,
    ) -> Result<PlaneLoop, ScenarioError> {
        let PlaneWorld {
            robot, settings, ..
        } = plane.world.clone();
        let world = before.world.continued(robot, settings)?;
        let mut closed_loop = self.loop_in(plane, world)?;
        closed_loop.regulator.take_over(&before.regulator);
        Ok(closed_loop)
    }

    /// The loop of a plane in a world of its own.
    fn loop_in(&self, plane: &Plane, world: PlaneInWorld) -> Result<PlaneLoop, ScenarioError> {
        if self.motors.is_some() {
            return Err(ScenarioError::value(
                "controller.motors",
                "(given)",
                "two planes on shared motors are run as a whole only; leave it out to run them \
                 sample by sample",
            ));
        }
        let PlaneWorld {
            settings,
            without_plan,
            range,
            excitation,
            ..
        } = plane.world.clone();
        let regulator = PlaneRegulator::new(
            &self.ballbot,
            &self.planner(),
            &self.feedback,
            &self.settings.u,
            settings.period,
        )?;
        let regulator = Excited::new(regulator, excitation);
        let mut closed_loop = ClosedLoop::new(regulator, world)?;
        closed_loop.without_plan = without_plan;
        closed_loop.range = range;
        Ok(closed_loop)
    }

    /// The motors' torques (tau_1, tau_2, tau_3) in N m at every sample that both planes have,
    /// for a robot that keeps its heading of zero without yaw torque. The torque of the x plane
    /// is tau_x of eq. (6), that of the y plane tau_y.
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

    /// The motors of two planes that were run one after the other, at a heading of zero; none for
    /// one plane.
    pub fn motors_of_planes(&self, trajectories: &[Trajectory<4, 1>]) -> Vec<MotorSample> {
        let samples = trajectories.iter().take(1).flat_map(|run| &run.samples);
        let torques = self.motor_torques(trajectories);
        let samples = samples.zip(torques).map(|(sample, torques)| MotorSample {
            t: sample.t,
            heading: 0.0,
            target: 0.0,
            torques,
        });
        samples.collect()
    }
}
