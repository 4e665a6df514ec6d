//! Plants of several sizes, in Rust and as data.

use lpvmpc::{Dynamics, Number};
use lpvmpc_any::Limits;
use lpvmpc_plant::{Plant, PlantData, Signal};
use nalgebra::SVector;

/// A cart with a pole on a track: position (m), angle from upright (rad) and their rates; the force
/// on the cart (N).
pub struct CartPole;

impl Dynamics<4, 1> for CartPole {
    fn f<N: Number>(&self, x: &SVector<N, 4>, u: &SVector<N, 1>) -> SVector<N, 4> {
        let number = N::constant;
        let (cart, pole, length, gravity) = (number(1.0), number(0.2), number(0.5), number(9.81));
        let (sin, cos) = x[1].sin_cos();
        let mass = cart + pole * sin * sin;
        let force = u[0] - pole * length * x[3] * x[3] * sin;
        let acceleration = (force + pole * gravity * sin * cos) / mass;
        let turning = (gravity * sin + cos * acceleration) / length;
        SVector::from([x[2], x[3], acceleration, turning])
    }
}

pub fn cart_pole() -> Plant {
    Plant::new(PlantData {
        states: vec![
            Signal::new("position", "m"),
            Signal::new("angle", "rad"),
            Signal::new("speed", "m/s"),
            Signal::new("rate", "rad/s"),
        ],
        inputs: vec![Signal::new("force", "N")],
        ..PlantData::of_dynamics("cart-pole", &CartPole)
    })
    .unwrap()
}

/// A chain of leaking tanks with curved pipes: each input fills one, each tank fills the next.
pub struct Chain;

impl<const NX: usize, const NU: usize> Dynamics<NX, NU> for Chain {
    fn f<N: Number>(&self, x: &SVector<N, NX>, u: &SVector<N, NU>) -> SVector<N, NX> {
        let number = N::constant;
        SVector::from_fn(|i, _| {
            let next = x[(i + 1) % NX];
            let fed = if i % 2 == 0 {
                u[i / 2 % NU]
            } else {
                number(0.0)
            };
            number(0.3) * x[i].sin() + number(1.5) * next.tanh() + fed
        })
    }
}

pub fn chain<const NX: usize, const NU: usize>() -> Plant {
    Plant::new(PlantData::of_dynamics::<_, NX, NU>("chain", &Chain)).unwrap()
}

/// As far to either side.
pub fn limits(half: &[f64]) -> Option<Limits> {
    Some(Limits {
        lower: half.iter().map(|half| -half).collect(),
        upper: half.to_vec(),
    })
}
