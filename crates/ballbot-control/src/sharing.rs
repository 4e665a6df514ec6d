//! Regulators of planes that share their motors.

use lpvmpc_sim::{GuardedFeedback, Regulator};

/// A regulator of one plane that shares the motors with that of another. The sensors are those of
/// (phi, theta, phi_dot, theta_dot).
pub trait SharingPlane: Regulator<4, 1, 4> {
    /// The largest torque of the last plan, N m; infinite for one that keeps to an equal share.
    fn largest_torque(&self) -> f64 {
        f64::INFINITY
    }

    /// Plans within this torque from now on, N m.
    fn set_share(&mut self, _torque: f64) {}
}

/// The guarantee is for bounds that stay: it keeps to an equal share.
impl<C, const NS: usize, const N: usize, const NA: usize, const NP: usize, const M: usize>
    SharingPlane for GuardedFeedback<C, 4, 1, NS, N, NA, NP, M>
where
    C: lpvmpc::LpvModel<f64, 4, 1, NS>,
{
}
