//! How the motion changes with the parameters: what identification differentiates by.

use crate::dynamics::Slopes;
use crate::friction::DriveFriction;
use crate::parameters::Ballbot;
use lpvmpc::Number;
use nalgebra::Vector4;

/// The accelerations (phi_ddot, theta_ddot) of [`Ballbot::f`] in rad/s^2 and their derivatives, each
/// per unit of what it is by. Nothing depends on phi.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensitivity<T> {
    /// phi_ddot and theta_ddot.
    pub accelerations: [T; 2],
    /// By theta, phi_dot and theta_dot.
    pub by_state: [[T; 2]; 3],
    /// By the torque, N m.
    pub by_torque: [T; 2],
    /// By b1, b2, b3, b4, and the viscous and the Coulomb friction of the drive.
    pub by_parameters: [[T; 2]; 6],
}

impl<T: Number> Ballbot<T> {
    /// The accelerations at the state `x` = (phi, theta, phi_dot, theta_dot) in rad and rad/s under
    /// `torque` in N m, with all their derivatives; that of Coulomb friction, too, is the true one.
    ///
    /// M dq_ddot/dp = dforce/dp - dM/dp q_ddot.
    #[inline(always)]
    pub fn sensitivity(&self, x: &Vector4<T>, torque: T) -> Sensitivity<T> {
        let zero = T::constant(0.0);
        let speed = x[2] - x[3];
        let Slopes {
            accelerations,
            by_theta,
            by_phi_dot,
            by_theta_dot,
            by_torque,
            inverse,
            coupling,
        } = self.slopes(x, torque, DriveFriction::slope);
        let [phi_ddot, theta_ddot] = accelerations;
        let accelerate = |force_phi, force_theta| {
            self.accelerate_with(inverse, coupling, force_phi, force_theta)
        };
        let against_drive = accelerate(-speed, speed);
        let rounded = DriveFriction::rounded(speed);
        Sensitivity {
            accelerations,
            by_state: [by_theta, by_phi_dot, by_theta_dot],
            by_torque,
            by_parameters: [
                accelerate(-phi_ddot, zero),
                accelerate(theta_ddot, phi_ddot),
                accelerate(zero, -theta_ddot),
                accelerate(-x[2], zero),
                against_drive,
                against_drive.map(|of_viscous| of_viscous / rounded),
            ],
        }
    }
}
