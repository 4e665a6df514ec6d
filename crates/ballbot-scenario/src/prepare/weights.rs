//! The weights Q and R, given or by Bryson's rule.

use crate::error::ScenarioError;
use crate::file::schema::ControllerTable;
use crate::number::positive;
use crate::prepare::problem::dynamic;
use ballbot::Ballbot;
use lpvmpc::{LpvModel, Weights};
use nalgebra::{Matrix1, Matrix4, Vector3, Vector4};
use std::f64::consts::PI;

/// The tilt that is accepted as an error, rad. All others follow from it, so that it only sets a
/// common factor of Q and R, which changes no torque.
const TILT: f64 = PI / 36.0;

/// Accepted errors of (phi, theta, phi_dot, theta_dot), in units of what the robot does by itself
/// while it falls through [`TILT`]. Smaller for the tilt rate, which keeps a robot with delay and
/// errors of its model from swinging, and for the ball's angle; larger for its speed, which a move
/// needs.
const ACCEPTED: [f64; 4] = [0.5, 1.0, 3.0, 1.0 / 3.0];

/// Weights by Bryson's rule, 1 / (largest accepted error)^2 of each state and of the torque (Bryson
/// and Ho, Applied Optimal Control, 1975, sec. 5.2), in the robot's own units: Q's diagonal for
/// (phi, theta, phi_dot, theta_dot) in 1/rad^2 and s^2/rad^2, and R in 1/(N m)^2.
///
/// The unit of time is the time constant tau with which the robot falls from upright, the unit of the
/// tilt 5 degrees; that of the ball's speed is what it gains in tau at that tilt, that of its angle is
/// tau times as much, and that of the torque holds the tilt. So two robots that differ by size or mass
/// alone get the same loop on their own scale.
///
/// # Errors
/// [`ScenarioError::Value`] where the robot does not fall over from upright, or no torque holds it.
pub fn bryson(ballbot: &Ballbot<f64>) -> Result<Weights<f64, 4, 1>, ScenarioError> {
    let (a, b) = ballbot.without_coulomb().matrices(&Vector3::zeros());
    let poles = lpvmpc_design::poles(&dynamic(&a)).unwrap_or_default();
    let fastest = poles.iter().map(|pole| pole.re).fold(0.0, f64::max);
    let acceleration = ballbot.acceleration_at_tilt(TILT).abs();
    let torque = TILT * (a[(3, 1)] / b[3]).abs();
    let units = [
        acceleration / (fastest * fastest),
        TILT,
        acceleration / fastest,
        TILT * fastest,
    ];
    let weight = |error: f64| 1.0 / (error * error);
    let q: [f64; 4] = std::array::from_fn(|i| weight(ACCEPTED[i] * units[i]));
    let r = weight(torque);
    let usable = |weight: &f64| *weight > 0.0 && weight.is_finite();
    if !q.iter().chain([&r]).all(usable) {
        return Err(ScenarioError::value(
            "controller.q, controller.r",
            "(not given)",
            "Bryson's rule has no scale for this robot, which does not fall over from upright or \
             which no torque holds; give both, or check its parameters",
        ));
    }
    Ok(of(q, r))
}

fn of(q: [f64; 4], r: f64) -> Weights<f64, 4, 1> {
    Weights {
        q: Matrix4::from_diagonal(&Vector4::from(q)),
        r: Matrix1::new(r),
    }
}

impl ControllerTable {
    /// Q and R as they are given, or by Bryson's rule where neither is.
    pub(crate) fn weights(
        &self,
        ballbot: &Ballbot<f64>,
    ) -> Result<Weights<f64, 4, 1>, ScenarioError> {
        let (q, r) = match (self.q, self.r) {
            (None, None) => return bryson(ballbot),
            (Some(q), Some(r)) => (q, r),
            (q, _) => {
                let missing = if q.is_none() { "q" } else { "r" };
                return Err(ScenarioError::value(
                    format!("controller.{missing}"),
                    "(not given)",
                    "only the ratio of q and r matters: give both, or leave both out for Bryson's \
                     rule on this robot",
                ));
            }
        };
        for (i, weight) in q.iter().enumerate() {
            if !(*weight >= 0.0 && weight.is_finite()) {
                return Err(ScenarioError::value(
                    format!("controller.q[{i}]"),
                    weight,
                    "a state weight must be zero or positive",
                ));
            }
        }
        Ok(of(q, positive("controller.r", r)?))
    }
}
