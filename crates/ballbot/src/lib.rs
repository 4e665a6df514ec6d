//! The ballbot, a robot that balances on one ball: parameters, nonlinear dynamics, LPV
//! embedding, wheel torques, regulators of a plane and of the whole robot, and a check of physical
//! consistency. No std, no heap but with the feature `alloc`.
//!
//! One plane of the robot has the state x = (phi, theta, phi_dot, theta_dot) in rad and rad/s
//! (ball angle, body tilt) and the input u = tau, the virtual wheel's torque in N m. The ball
//! moves by x = r_b phi. Upright, a positive torque accelerates the body towards negative theta. It
//! accelerates the ball of a rigid robot towards positive phi, but towards negative phi with the
//! paper's parameters b*, which belong to no rigid body.
//!
//! ```
//! use ballbot::{Ballbot, DriveFriction, Geometry, Wheels};
//! use lpvmpc::LpvModel;
//! use nalgebra::{Vector1, Vector3, Vector4};
//!
//! // A rigid robot: inertias per body mass in m^2, b4 in m^2/s, lengths in m.
//! let robot = Ballbot {
//!     b1: 0.0294,
//!     b2: 0.01,
//!     b3: 0.1487,
//!     b4: 0.01,
//!     drive: DriveFriction { viscous: 0.0, coulomb: 0.0 },
//!     geometry: Geometry {
//!         centre_of_mass: 0.2978,
//!         ball_radius: 0.12,
//!         wheel_radius: 0.05,
//!         gravity: 9.81,
//!     },
//! };
//! let tilted = Vector4::new(0.0, 0.1, 0.0, 0.0);
//! let motion = robot.derivative(&tilted, &Vector1::new(0.0));
//! println!("tilted by 0.1 rad it falls with {:.2} rad/s^2", motion[3]);
//! assert!(motion[3] > 0.0);
//!
//! let motors = Wheels::<f64>::paper().motors(&Vector3::new(0.5, 0.0, 0.0));
//! println!("0.5 N m along x are {:.3}, {:.3} and {:.3} N m", motors[0], motors[1], motors[2]);
//! ```
#![no_std]
#![allow(
    clippy::neg_cmp_op_on_partial_ord,
    reason = "a comparison with NaN must take the failing branch"
)]

mod consistency;
mod disturbed;
mod dynamics;
mod embedding;
mod friction;
mod heading;
mod linear;
mod parameters;
#[cfg(feature = "alloc")]
mod plane_regulator;
mod regulator;
mod regulator_error;
mod robot_regulator;
mod sensitivity;
mod shares;
mod wheels;

pub use consistency::Consistency;
pub use disturbed::Disturbed;
pub use friction::{CREEP_SPEED, DriveFriction};
pub use heading::Heading;
pub use parameters::{Ballbot, Geometry, LinearParameters, limits};
#[cfg(feature = "alloc")]
pub use plane_regulator::{PlaneFeedback, PlanePlanner, PlaneRegulator, plane_feedback};
pub use regulator::{
    AnyPlanner, Belief, Controller, ControllerSettings, Estimator, EstimatorArrays,
    EstimatorSettings, Guaranteed, GuaranteedController, GuaranteedSettings, GuaranteedWorkspace,
    Held, OutputFeedback, Ramped, RampedSettings, Workspace,
};
pub use regulator_error::RegulatorError;
pub use robot_regulator::{HEADING, MotorLimits, RobotRegulator, RobotState, YawLaw, plane_of};
pub use sensitivity::Sensitivity;
pub use shares::PlaneTorques;
pub use wheels::{AZIMUTHS_OF_PAPER_DEG, BadWheels, Wheel, Wheels};
