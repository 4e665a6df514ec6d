//! Regulators whose horizon is known at run time.

use crate::boxed::boxed;
use crate::feedback::Feedback;
use crate::handover::Commands;
use crate::output_feedback::{Belief, OutputFeedback};
use crate::plane_regulator::PlaneRegulator;
use crate::planner::{Held, Planner};
use ballbot::Ballbot;
use lpvmpc::{
    Bounds, Controller, ControllerError, ControllerSettings, Estimator, EstimatorError, Workspace,
};
use lpvmpc_sim::{MeasuredState, StateFeedback};
use nalgebra::Vector4;

/// The longest horizon that is compiled in, samples.
pub const LONGEST_HORIZON: usize = 200;

/// Stages of the largest quadratic program: that of a guarded controller has two more than samples.
pub(crate) const STAGES: usize = LONGEST_HORIZON + 2;

/// Rows that the largest quadratic program may have active: a bound of the torque, one of its rate
/// where that is the input, and a soft bound of the state that is exceeded per sample, and up to 4
/// rows of a terminal equality.
pub(crate) const ROWS: usize = 3 * LONGEST_HORIZON + 4;

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

/// Calls a generic function with the smallest compiled size for a horizon: stages, and rows that may
/// be active, `$rows` per sample and 4 of a terminal equality.
///
/// In a browser the largest size must do for all controllers: the time per step follows the horizon
/// that is used, and every size is code that has to be loaded.
macro_rules! sized {
    ($horizon:expr, $rows:literal per sample, $function:ident($($argument:expr),*)) => {{
        use $crate::regulators::LONGEST_HORIZON;
        match $horizon {
            #[cfg(not(target_family = "wasm"))]
            ..=20 => $function::<20, { $rows * 20 + 4 }>($($argument),*),
            #[cfg(not(target_family = "wasm"))]
            21..=50 => $function::<50, { $rows * 50 + 4 }>($($argument),*),
            #[cfg(not(target_family = "wasm"))]
            51..=100 => $function::<100, { $rows * 100 + 4 }>($($argument),*),
            #[cfg(not(target_family = "wasm"))]
            101..=LONGEST_HORIZON => {
                $function::<LONGEST_HORIZON, { $rows * LONGEST_HORIZON + 4 }>($($argument),*)
            }
            #[cfg(target_family = "wasm")]
            ..=LONGEST_HORIZON => {
                use $crate::regulators::{ROWS, STAGES};
                $function::<STAGES, ROWS>($($argument),*)
            }
            given => Err(too_long(given).into()),
        }
    }};
}
pub(crate) use sized;

pub(crate) fn too_long(given: usize) -> ControllerError {
    ControllerError::Horizon {
        given,
        largest: LONGEST_HORIZON,
    }
}

/// The controller on the measured state itself.
///
/// # Errors
/// The controller refuses its `settings`, or their horizon is longer than [`LONGEST_HORIZON`].
pub fn state_feedback(
    ballbot: &Ballbot<f64>,
    settings: &ControllerSettings<f64, 4, 1, 3>,
) -> Result<Box<dyn PlaneRegulator>, ControllerError> {
    sized!(settings.horizon, 2 per sample, state_feedback_sized(ballbot, settings))
}

/// The controller with what stands around it; `period` is that of the sensors, s.
///
/// # Errors
/// Estimator or controller refuses its settings, or the horizon is longer than
/// [`LONGEST_HORIZON`].
pub fn output_feedback(
    ballbot: &Ballbot<f64>,
    settings: &ControllerSettings<f64, 4, 1, 3>,
    feedback: &Feedback,
    period: f64,
) -> Result<Box<dyn PlaneRegulator>, RegulatorError> {
    let planner = sized!(settings.horizon, 2 per sample, held(ballbot, settings))?;
    with_planner(planner, ballbot, &settings.u, feedback, period)
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

// Neither this nor what follows is inlined: each size builds its controller on the stack before it
// is boxed, and one frame for all sizes is too large.
#[inline(never)]
fn state_feedback_sized<const N: usize, const M: usize>(
    ballbot: &Ballbot<f64>,
    settings: &ControllerSettings<f64, 4, 1, 3>,
) -> Result<Box<dyn PlaneRegulator>, ControllerError> {
    let controller = Controller::<_, f64, 4, 1, 3, N, M>::new(*ballbot, *settings)?;
    let (controller, workspace) = (Box::new(controller), boxed(Workspace::new));
    Ok(Box::new(StateFeedback::new(controller, workspace)))
}

#[inline(never)]
fn held<const N: usize, const M: usize>(
    ballbot: &Ballbot<f64>,
    settings: &ControllerSettings<f64, 4, 1, 3>,
) -> Result<Box<dyn Planner>, RegulatorError> {
    Ok(Box::new(Held::<N, M> {
        controller: Box::new(Controller::new(*ballbot, *settings)?),
        workspace: boxed(Workspace::new),
    }))
}
