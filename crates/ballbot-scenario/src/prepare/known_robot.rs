//! A robot that is known.

use crate::prepare::uncertainty::RobotDistribution;
use ballbot::{Ballbot, Wheels};

/// A robot whose parameters have been read and checked.
#[derive(Debug)]
pub struct KnownRobot {
    /// The plant.
    pub ballbot: Ballbot<f64>,
    /// The torque map to the motors.
    pub wheels: Wheels<f64>,
    /// How far the parameters may be off, where the file says so.
    pub uncertainty: Option<Box<dyn RobotDistribution>>,
}
