//! Regulators from their settings.

use crate::feedback::Feedback;
use crate::handover::Commands;
use crate::output_feedback::{Belief, OutputFeedback};
use crate::plane_regulator::PlaneRegulator;
use crate::planner::{Held, Planner};
use ballbot::{Ballbot, ControllerSettings};
use lpvmpc::{Bounds, Controller, ControllerError, Estimator, EstimatorError};
use lpvmpc_sim::{MeasuredState, StateFeedback};
use nalgebra::Vector4;

/// A regulator refuses its settings.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum RegulatorError {
    /// The estimator does.
    #[error("estimator: {0}")]
    Estimator(#[from] EstimatorError),
    /// The controller does.
    #[error("controller: {0}")]
    Controller(#[from] ControllerError),
}

/// The controller on the measured state itself.
///
/// # Errors
/// The controller refuses its `settings`.
pub fn state_feedback(
    ballbot: &Ballbot<f64>,
    settings: &ControllerSettings<f64>,
) -> Result<Box<dyn PlaneRegulator>, ControllerError> {
    let controller = Controller::allocate(*ballbot, *settings)?;
    Ok(Box::new(StateFeedback::new(Box::new(controller))))
}

/// The controller with what stands around it; `period` is that of the sensors, s.
///
/// # Errors
/// Estimator or controller refuses its settings.
pub fn output_feedback(
    ballbot: &Ballbot<f64>,
    settings: &ControllerSettings<f64>,
    feedback: &Feedback,
    period: f64,
) -> Result<Box<dyn PlaneRegulator>, RegulatorError> {
    let controller = Controller::allocate(*ballbot, *settings)?;
    let planner = Held {
        workspace: controller.workspace(),
        controller,
    };
    with_planner(Box::new(planner), ballbot, &settings.u, feedback, period)
}

/// Output feedback around any planner; `torque` are the bounds of the commanded torque, N m.
///
/// # Errors
/// The estimator refuses its settings.
pub(crate) fn with_planner(
    planner: Box<dyn Planner>,
    ballbot: &Ballbot<f64>,
    torque: &Bounds<f64, 1>,
    feedback: &Feedback,
    period: f64,
) -> Result<Box<dyn PlaneRegulator>, RegulatorError> {
    let belief = match feedback.estimator {
        Some(settings) => {
            let estimator = Estimator::new(*ballbot, settings, Vector4::zeros())?;
            Belief::Estimated(Box::new(estimator))
        }
        None => Belief::Measured {
            model: *ballbot,
            longest_step: feedback.longest_step,
            measured: MeasuredState::new(),
        },
    };
    Ok(Box::new(OutputFeedback {
        belief,
        planner,
        delay: feedback.delay,
        period,
        preview: feedback.preview,
        torque: *torque,
        share: f64::INFINITY,
        commands: Commands::default(),
        commanded: 0.0,
    }))
}
