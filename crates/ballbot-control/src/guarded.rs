//! The guaranteed loop.

use crate::plane_regulator::PlaneRegulator;
use ballbot::{Ballbot, GuardedSettings};
use lpvmpc::{GuardedController, GuardedError};
use lpvmpc_sim::GuardedFeedback;

/// The guarded controller on the measured state itself, with `preview` of the reference or without.
///
/// # Errors
/// The controller refuses its `settings`.
pub fn guarded_feedback(
    ballbot: &Ballbot<f64>,
    settings: &GuardedSettings<f64>,
    preview: bool,
) -> Result<Box<dyn PlaneRegulator>, GuardedError> {
    let controller = GuardedController::allocate(*ballbot, *settings)?;
    Ok(Box::new(GuardedFeedback::<_, 4, 1, 3, 5>::new(
        controller, preview,
    )))
}
