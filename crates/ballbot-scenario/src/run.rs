//! The run itself: horizons are known at run time, the method's sizes at compile time.

use crate::error::ScenarioError;
use crate::excitation::Excited;
use crate::feedback::longest_step;
use crate::output_feedback::{Belief, Core, OutputFeedback};
use crate::prepare::{Plane, Prepared};
use crate::three_motors::{MotorSample, SharingPlane};
use crate::world::{PlaneWorld, Robot};
use lpvmpc::{
    Controller, DelayLine, Estimator, GuardedController, GuardedSettings, GuardedWorkspace,
    RampedInput, Workspace,
};
use lpvmpc_sim::{
    ClosedLoop, Course, GuardedFeedback, Recording, Regulator, StateFeedback, Trajectory, World,
};
use nalgebra::{Vector1, Vector3, Vector4};
use std::time::Duration;

/// The longest horizon that is compiled in, samples.
pub const LONGEST_HORIZON: usize = 200;

/// The horizons that are compiled in for the guarded controller, samples.
#[cfg(not(target_family = "wasm"))]
pub const GUARDED_HORIZONS: &[usize] = &[10, 20, 30];
/// The horizon that is compiled in for the guarded controller, samples: in a browser every size
/// is code that has to be loaded.
#[cfg(target_family = "wasm")]
pub const GUARDED_HORIZONS: &[usize] = &[20];

/// Bounds that the guarded controller's quadratic program may have active at once; soft bounds
/// can be many.
pub const GUARDED_ACTIVE: usize = 200;

/// What the run reads and reports besides its results.
pub struct Surroundings<'a> {
    /// A monotonic clock, for the time per step.
    pub clock: &'a dyn Fn() -> Duration,
    /// Called with the number of samples done, over all planes.
    pub progress: &'a dyn Fn(usize),
}

/// A recorded run.
#[derive(Clone, Debug, PartialEq)]
pub struct Record {
    /// What happened in each plane.
    pub planes: Vec<Recording<4, 1, 4>>,
    /// The motors at every sample of the control, where the planes share them.
    pub motors: Option<Vec<MotorSample>>,
}

/// The closed loop of one plane, whatever the horizon. The sensors are those of (phi, theta,
/// phi_dot, theta_dot), the load that of [`ballbot::Disturbed::f`].
pub type PlaneLoop = ClosedLoop<Box<dyn Regulator<4, 1, 4>>, Robot, 4, 1, 4, 2>;

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
        let planes = self.record(surroundings)?.planes.into_iter();
        Ok(planes.map(|recording| recording.trajectory).collect())
    }

    /// [`run`](Self::run), with what the robot's sensors delivered, and its motors did.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    pub fn record(&self, surroundings: &Surroundings<'_>) -> Result<Record, ScenarioError> {
        if let (Some(motors), [x, y]) = (&self.motors, self.planes.as_slice()) {
            return self.record_whole(motors, [x, y], surroundings);
        }
        let mut planes = Vec::with_capacity(self.planes.len());
        for (done, plane) in self.planes.iter().enumerate() {
            let course = Course {
                samples: self.samples,
                reference: &|t| plane.state_reference(t),
                clock: surroundings.clock,
                progress: &|samples| (surroundings.progress)(done * self.samples + samples),
            };
            let mut closed_loop = self.closed_loop(plane)?;
            planes.push(lpvmpc_sim::record(&mut closed_loop, &course));
        }
        Ok(Record {
            planes,
            motors: None,
        })
    }

    /// The closed loop of one plane at time zero, to be stepped sample by sample.
    ///
    /// # Errors
    /// [`ScenarioError::Controller`] if the controller refuses its settings;
    /// [`ScenarioError::Value`] if the planes share their motors, and so make one loop.
    pub fn closed_loop(&self, plane: &Plane) -> Result<PlaneLoop, ScenarioError> {
        if self.motors.is_some() {
            return Err(ScenarioError::value(
                "controller.motors",
                "(given)",
                "two planes on shared motors are run as a whole only; leave it out to run them \
                 sample by sample",
            ));
        }
        let regulator: Box<dyn Regulator<4, 1, 4>> = match &self.guarded {
            None if self.feedback.is_plain() => self.plain_feedback()?,
            _ => self.sharing_plane(plane.world.settings.period)?,
        };
        let PlaneWorld {
            robot,
            settings,
            without_plan,
            range,
            excitation,
        } = plane.world.clone();
        let regulator = match excitation {
            Some(excitation) => Box::new(Excited {
                regulator,
                excitation,
                command: Vector1::zeros(),
                time: 0.0,
            }),
            None => regulator,
        };
        let world = World::new(robot, plane.initial_state, settings)?;
        let mut closed_loop = ClosedLoop::new(regulator, world)?;
        closed_loop.without_plan = without_plan;
        closed_loop.range = range;
        Ok(closed_loop)
    }

    // Neither this nor what follows is inlined: each size builds its memory on the stack before it
    // is boxed, and one frame for all sizes overflows the 2 MB of a thread.
    #[inline(never)]
    fn plain_feedback(&self) -> Result<Box<dyn Regulator<4, 1, 4>>, ScenarioError> {
        // Up to 4 rows of a terminal equality come on top of one row per input.
        // In a browser the longest horizon must do for all: the time per step follows the horizon
        // that is used, and every size is code that has to be loaded.
        match self.settings.horizon {
            #[cfg(not(target_family = "wasm"))]
            ..=20 => self.state_feedback::<20, 24>(),
            #[cfg(not(target_family = "wasm"))]
            21..=50 => self.state_feedback::<50, 54>(),
            #[cfg(not(target_family = "wasm"))]
            51..=100 => self.state_feedback::<100, 104>(),
            #[cfg(not(target_family = "wasm"))]
            _ => self.state_feedback::<LONGEST_HORIZON, { LONGEST_HORIZON + 4 }>(),
            // As many rows as with the torque's own bounds below: one solver for both.
            #[cfg(target_family = "wasm")]
            _ => self.state_feedback::<LONGEST_HORIZON, { 2 * LONGEST_HORIZON + 4 }>(),
        }
    }

    /// The regulator of a plane that may share its motors with another; `period` is that of the
    /// sensors, s.
    #[inline(never)]
    pub(crate) fn sharing_plane(
        &self,
        period: f64,
    ) -> Result<Box<dyn SharingPlane>, ScenarioError> {
        if let Some(settings) = &self.guarded {
            return self.guarded_feedback(settings);
        }
        // The torque's own bounds come on top where its rate is the input.
        match self.settings.horizon {
            #[cfg(not(target_family = "wasm"))]
            ..=20 => self.output_feedback::<20, 44>(period),
            #[cfg(not(target_family = "wasm"))]
            21..=50 => self.output_feedback::<50, 104>(period),
            #[cfg(not(target_family = "wasm"))]
            51..=100 => self.output_feedback::<100, 204>(period),
            _ => self.output_feedback::<LONGEST_HORIZON, { 2 * LONGEST_HORIZON + 4 }>(period),
        }
    }

    #[inline(never)]
    fn guarded_feedback(
        &self,
        settings: &GuardedSettings<f64, 4, 1>,
    ) -> Result<Box<dyn SharingPlane>, ScenarioError> {
        // As many as GUARDED_HORIZONS; N + 2 stages each.
        match self.settings.horizon {
            #[cfg(not(target_family = "wasm"))]
            ..=10 => self.guarded_sized::<10, 12>(settings),
            #[cfg(not(target_family = "wasm"))]
            21.. => self.guarded_sized::<30, 32>(settings),
            _ => self.guarded_sized::<20, 22>(settings),
        }
    }

    #[inline(never)]
    fn guarded_sized<const N: usize, const NP: usize>(
        &self,
        settings: &GuardedSettings<f64, 4, 1>,
    ) -> Result<Box<dyn SharingPlane>, ScenarioError> {
        Ok(Box::new(GuardedFeedback::<
            _,
            4,
            1,
            3,
            N,
            5,
            NP,
            GUARDED_ACTIVE,
        > {
            controller: GuardedController::new(self.ballbot, *settings)?,
            workspace: Box::new(GuardedWorkspace::new()),
            x: Vector4::zeros(),
        }))
    }

    #[inline(never)]
    fn state_feedback<const N: usize, const M: usize>(
        &self,
    ) -> Result<Box<dyn Regulator<4, 1, 4>>, ScenarioError> {
        let workspace = boxed_workspace::<4, N, M>();
        let controller = Box::new(Controller::<_, f64, 4, 1, 3, N, M>::new(
            self.ballbot,
            self.settings,
        )?);
        Ok(Box::new(StateFeedback::new(controller, workspace)))
    }

    #[inline(never)]
    fn output_feedback<const N: usize, const M: usize>(
        &self,
        period: f64,
    ) -> Result<Box<dyn SharingPlane>, ScenarioError> {
        let x = Vector4::zeros();
        let belief = match self.feedback.estimator {
            Some(settings) => {
                let estimator = Estimator::new(self.ballbot, settings, x)?;
                Belief::Estimated(Box::new(estimator))
            }
            None => Belief::Measured {
                model: self.ballbot,
                longest_step: longest_step(&self.ballbot)?,
                x,
            },
        };
        let core = match self.feedback.ramp {
            Some(settings) => Core::Ramped {
                controller: Box::new(Controller::new(RampedInput(self.ballbot), settings)?),
                workspace: boxed_workspace(),
                torque: 0.0,
                rate: 0.0,
            },
            None => Core::Held {
                controller: Box::new(Controller::new(self.ballbot, self.settings)?),
                workspace: boxed_workspace(),
            },
        };
        Ok(Box::new(OutputFeedback::<N, M> {
            belief,
            core,
            delay: self.feedback.delay,
            period,
            preview: self.feedback.preview,
            torque: self.settings.u,
            share: f64::INFINITY,
            line: DelayLine::default(),
            time: 0.0,
        }))
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
}

/// Not inlined, so that the largest thing there is has the stack for itself until it is boxed.
#[inline(never)]
fn boxed_workspace<const NX: usize, const N: usize, const M: usize>()
-> Box<Workspace<f64, NX, 1, N, M>> {
    Box::new(Workspace::new())
}
