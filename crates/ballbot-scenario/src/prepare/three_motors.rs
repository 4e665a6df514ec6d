//! The three motors that two planes share.

use crate::prepare::heading::Turning;
use ballbot::MotorLimits;

/// What the three motors have, and what they turn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThreeMotors {
    /// What they have.
    pub limits: MotorLimits<f64>,
    /// How the robot turns.
    pub turning: Turning,
}
