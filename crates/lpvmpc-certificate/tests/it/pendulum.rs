//! A second plant: a pendulum, upright, with a torque at its joint.

use lpvmpc::{Embedding, Number};
use nalgebra::{Matrix2, Vector1, Vector2};
use serde::{Deserialize, Serialize};

/// 1 kg at the end of a rod of 1 m: x = (angle from upright [rad], rate [rad/s]).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pendulum;

const GRAVITY: f64 = 9.81;

impl Embedding<2, 1, 1> for Pendulum {
    fn scheduling<N: Number>(&self, x: &Vector2<N>, _torque: &Vector1<N>) -> Vector1<N> {
        Vector1::new(x[0])
    }

    fn matrices<N: Number>(&self, angle: &Vector1<N>) -> (Matrix2<N>, Vector2<N>) {
        let (zero, one) = (N::constant(0.0), N::constant(1.0));
        let gravity = N::constant(GRAVITY) * angle[0].sinc();
        (
            Matrix2::new(zero, one, gravity, zero),
            Vector2::new(zero, one),
        )
    }
}
