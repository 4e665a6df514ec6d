//! The guaranteed loop.

use crate::boxed::boxed;
use crate::plane_regulator::PlaneRegulator;
use crate::regulators::{LONGEST_HORIZON, ROWS, STAGES, too_long};
use ballbot::Ballbot;
use lpvmpc::{GuardedController, GuardedError, GuardedSettings, GuardedWorkspace};
use lpvmpc_sim::{GuardedFeedback, MeasuredState};
use nalgebra::Vector1;

/// Rows that a guarded controller of up to 20 samples may have active: its soft bounds can be many.
pub const GUARDED_ACTIVE: usize = 200;

/// The guarded controller on the measured state itself, with `preview` of the reference or without.
///
/// # Errors
/// The controller refuses its `settings`, or their horizon is longer than [`LONGEST_HORIZON`].
pub fn guarded_feedback(
    ballbot: &Ballbot<f64>,
    settings: &GuardedSettings<f64, 4, 1>,
    preview: bool,
) -> Result<Box<dyn PlaneRegulator>, GuardedError> {
    match settings.horizon {
        #[cfg(not(target_family = "wasm"))]
        ..=20 => sized::<20, 22, GUARDED_ACTIVE>(ballbot, settings, preview),
        ..=LONGEST_HORIZON => sized::<LONGEST_HORIZON, STAGES, ROWS>(ballbot, settings, preview),
        given => Err(too_long(given).into()),
    }
}

// Not inlined: each size builds its controller on the stack before it is boxed.
#[inline(never)]
fn sized<const N: usize, const NP: usize, const M: usize>(
    ballbot: &Ballbot<f64>,
    settings: &GuardedSettings<f64, 4, 1>,
    preview: bool,
) -> Result<Box<dyn PlaneRegulator>, GuardedError> {
    let controller = GuardedController::<_, f64, 4, 1, 3, N, 5, NP>::new(*ballbot, *settings)?;
    Ok(Box::new(GuardedFeedback {
        controller,
        workspace: boxed(GuardedWorkspace::<f64, 1, 5, NP, M>::new),
        measured: MeasuredState::new(),
        input: Vector1::zeros(),
        preview,
    }))
}
