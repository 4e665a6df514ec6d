//! A second plant: a pendulum, upright, with a torque at its joint.

use lpvmpc::LpvModel;
use lpvmpc_certificate::{AnalyticModel, Arithmetic};
use nalgebra::{Matrix2, Vector1, Vector2};
use serde::{Deserialize, Serialize};

/// 1 kg at the end of a rod of 1 m: x = (angle from upright [rad], rate [rad/s]).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pendulum;

const GRAVITY: f64 = 9.81;

impl LpvModel<f64, 2, 1, 1> for Pendulum {
    fn scheduling(&self, x: &Vector2<f64>) -> Vector1<f64> {
        Vector1::new(x[0])
    }

    fn matrices(&self, scheduling: &Vector1<f64>) -> (Matrix2<f64>, Vector2<f64>) {
        let angle = scheduling[0];
        let sinc = if angle == 0.0 {
            1.0
        } else {
            angle.sin() / angle
        };
        (
            Matrix2::new(0.0, 1.0, GRAVITY * sinc, 0.0),
            Vector2::new(0.0, 1.0),
        )
    }
}

impl AnalyticModel<2, 1, 1> for Pendulum {
    fn scheduling<T: Arithmetic>(&self, x: &[T; 2]) -> [T; 1] {
        [x[0]]
    }

    fn matrices<T: Arithmetic>(&self, scheduling: &[T; 1]) -> ([[T; 2]; 2], [[T; 1]; 2]) {
        let (zero, one) = (T::constant(0.0), T::constant(1.0));
        let gravity = T::constant(GRAVITY) * scheduling[0].sinc();
        ([[zero, one], [gravity, zero]], [[zero], [one]])
    }
}
