//! A pendulum about its upright position, and an estimator that sees its angle.

use crate::pendulum::Pendulum;
use lpvmpc::{Estimator, EstimatorSettings, Gate};
use nalgebra::{Matrix1x2, SMatrix, SVector, Vector1, Vector2};

/// 1 kg on a rod of 1 m, with a torque in N m; x = (angle rad, rate rad/s).
pub const PENDULUM: Pendulum<f64> = Pendulum {
    stiffness: 9.81,
    damping: 0.0,
};

/// The angle is measured with a deviation of 1 mrad; an unknown torque acts.
pub fn settings() -> EstimatorSettings<f64, 2, 1, 1, 1> {
    EstimatorSettings {
        longest_step: 0.01,
        c: Matrix1x2::new(1.0, 0.0),
        state_offset: SMatrix::zeros(),
        input_offset: Vector1::new(1.0),
        state_noise: Vector2::new(0.0, 1e-4),
        disturbance_noise: Vector1::new(1e-4),
        measurement_noise: Vector1::new(1e-6),
        initial_state: Vector2::new(1e-2, 1e-1),
        initial_disturbance: SVector::repeat(0.25),
        gate: Gate {
            deviations: 6.0,
            patience: 3,
            oldest: 0.05,
            longest_gap: 0.5,
        },
    }
}

/// An estimator of the pendulum's state and the torque that remembers eight instants.
pub type Observer<P> = Estimator<P, f64, 2, 1, 1, 1, 1>;

/// Instants that it remembers.
pub const INSTANTS: usize = 8;
