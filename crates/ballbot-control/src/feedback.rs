//! What stands around the controller on a real robot.

use lpvmpc::EstimatorSettings;

/// What a controller has around it.
#[derive(Clone, Debug, PartialEq)]
pub struct Feedback {
    /// The estimator on (phi, theta, theta_dot), with the disturbances (torque N m, angle of
    /// the tilt rad).
    pub estimator: Option<EstimatorSettings<f64, 4, 1, 3, 2>>,
    /// Time from a measurement to the torque that answers it, s.
    pub delay: f64,
    /// Longest Runge-Kutta step with which the motion during the delay is predicted, s.
    pub longest_step: f64,
    /// Whether the controller sees the reference before its time.
    pub preview: bool,
}

impl Feedback {
    /// Whether the controller stands alone: on the readings, at once, with preview.
    pub fn is_plain(&self) -> bool {
        self.is_direct() && self.preview
    }

    /// Whether the controller decides for the measured state.
    pub fn is_direct(&self) -> bool {
        self.estimator.is_none() && self.delay == 0.0
    }
}
