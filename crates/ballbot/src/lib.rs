//! The ballbot, a robot that balances on one ball: parameters, nonlinear dynamics, LPV
//! embedding, wheel torques and a check of physical consistency. No std, no heap.
//!
//! One plane of the robot has the state x = (phi, theta, phi_dot, theta_dot) in rad and rad/s
//! (ball angle, body tilt) and the input u = tau, the virtual wheel's torque in N m. The ball
//! moves by x = r_b phi. A positive torque accelerates the ball and the body towards negative
//! phi and negative theta.
#![no_std]

mod consistency;
mod dynamics;
mod embedding;
mod linear;
mod parameters;
mod wheels;

pub use consistency::Consistency;
pub use parameters::{Ballbot, Geometry, LinearParameters, limits};
pub use wheels::{BadZenithAngle, Wheels};
