//! The regulator of one plane whose kind is chosen at run time, in `f64` and on the heap.

use crate::parameters::Ballbot;
use crate::regulator::{
    AnyPlanner, Belief, Controller, ControllerSettings, Estimator, EstimatorSettings, Guaranteed,
    GuaranteedController, GuaranteedSettings, Held, OutputFeedback, Ramped, RampedSettings,
};
use crate::regulator_error::RegulatorError;
use lpvmpc::{
    BoundId, Bounds, Command, DelayLine, FeedbackMemory, FeedbackSettings, Measurement,
    Observation, Planner, RampedInput, Regulator, Standalone,
};
use nalgebra::{Vector1, Vector4};

/// Instants that the filter remembers: enough for readings that are 0.1 s late at 1 kHz, with a
/// change of the torque in between.
const INSTANTS: usize = 256;

/// How a plane's torque is planned.
#[derive(Clone, Debug, PartialEq)]
pub enum PlanePlanner {
    /// Held over a sample.
    Held(ControllerSettings<f64>),
    /// In ramps: settings of the plant with the torque as fifth state.
    Ramped(RampedSettings<f64>),
    /// Held, with a guarantee for the measured state itself.
    Guaranteed(GuaranteedSettings<f64>),
}

/// What stands around a plane's planner.
#[derive(Clone, Debug, PartialEq)]
pub struct PlaneFeedback {
    /// The estimator; without one the readings are the state.
    pub estimator: Option<EstimatorSettings<f64>>,
    /// Time from a measurement to the torque that answers it, s.
    pub delay: f64,
    /// Longest Runge-Kutta step with which the motion during the delay is predicted, s.
    pub longest_step: f64,
    /// Whether the controller sees the reference before its time.
    pub preview: bool,
}

/// The planner.
///
/// # Errors
/// The controller refuses its settings.
fn planner(
    ballbot: &Ballbot<f64>,
    settings: &PlanePlanner,
) -> Result<AnyPlanner<f64>, RegulatorError> {
    Ok(match settings {
        PlanePlanner::Held(settings) => {
            let controller = Controller::allocate(*ballbot, *settings)?;
            let workspace = controller.workspace();
            AnyPlanner::Held(Held::new(controller), workspace)
        }
        PlanePlanner::Ramped(settings) => {
            let controller = lpvmpc::Controller::allocate(RampedInput(*ballbot), *settings)?;
            let workspace = controller.workspace();
            AnyPlanner::Ramped(Ramped::allocate(controller), workspace)
        }
        PlanePlanner::Guaranteed(settings) => {
            let controller = GuaranteedController::allocate(*ballbot, *settings)?;
            let workspace = controller.workspace();
            AnyPlanner::Guaranteed(Guaranteed::allocate(controller), workspace)
        }
    })
}

/// The feedback of one plane around a planner of any kind. `torque` are the bounds of the commanded
/// torque (N m), `period` is that of the sensors, s.
///
/// # Errors
/// Estimator or controller refuses its settings.
pub fn plane_feedback(
    ballbot: &Ballbot<f64>,
    settings: &PlanePlanner,
    feedback: &PlaneFeedback,
    torque: &Bounds<f64, 1>,
    period: f64,
) -> Result<OutputFeedback<f64, AnyPlanner<f64>>, RegulatorError> {
    let planner = planner(ballbot, settings)?;
    let belief = match feedback.estimator {
        Some(settings) => {
            let start = Vector4::zeros();
            Belief::Estimated(Estimator::allocate(*ballbot, settings, start, INSTANTS)?)
        }
        None => Belief::measured(*ballbot, feedback.longest_step),
    };
    let interval = match &planner {
        AnyPlanner::Ramped(..) => period,
        AnyPlanner::Held(..) | AnyPlanner::Guaranteed(..) => planner.t_s(),
    };
    let places = DelayLine::<f64, 1>::places(feedback.delay, interval);
    let memory = FeedbackMemory::allocate(places, planner.horizon());
    let settings = FeedbackSettings {
        delay: feedback.delay,
        period,
        preview: feedback.preview,
        u: *torque,
    };
    Ok(OutputFeedback::new(belief, planner, settings, memory))
}

/// The regulator of one plane, on readings of (phi, theta, phi_dot, theta_dot).
///
/// It is one concrete type, so that its steps become machine code in this crate, once, and with this
/// crate's optimisation: the browser page compiles it for speed, and the rest for size.
#[derive(Clone, Debug)]
pub struct PlaneRegulator(Standalone<OutputFeedback<f64, AnyPlanner<f64>>, ()>);

impl PlaneRegulator {
    /// See [`plane_feedback`].
    ///
    /// # Errors
    /// Estimator or controller refuses its settings.
    pub fn new(
        ballbot: &Ballbot<f64>,
        settings: &PlanePlanner,
        feedback: &PlaneFeedback,
        torque: &Bounds<f64, 1>,
        period: f64,
    ) -> Result<Self, RegulatorError> {
        Ok(Self(Standalone {
            feedback: plane_feedback(ballbot, settings, feedback, torque, period)?,
            workspace: (),
        }))
    }
}

impl Regulator<f64, 4, 1, 4> for PlaneRegulator {
    fn t_s(&self) -> f64 {
        self.0.t_s()
    }

    fn observe(&mut self, measurement: &Measurement<f64, 4>) -> Observation<4> {
        self.0.observe(measurement)
    }

    fn decide(&mut self, reference: &dyn Fn(f64) -> Vector4<f64>) -> Command<f64, 4, 1> {
        self.0.decide(reference)
    }

    fn between(&mut self) -> Option<Vector1<f64>> {
        self.0.between()
    }

    fn take_over(&mut self, previous: &Self) {
        self.0.take_over(&previous.0);
    }

    fn cost(&self) -> f64 {
        self.0.cost()
    }

    fn predicted(&self, i: usize) -> Option<Vector4<f64>> {
        self.0.predicted(i)
    }

    fn active_bound(&self, i: usize) -> Option<BoundId> {
        self.0.active_bound(i)
    }
}
