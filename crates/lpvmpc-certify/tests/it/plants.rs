//! Plants of the tests, with bounds and settings that suit them.

use lpvmpc::{Dynamics, Number};
use lpvmpc_certify::{Certificate, CertifySettings, certify};
use lpvmpc_plant::{Equilibrium, Plant, PlantData, Signal};
use nalgebra::{SVector, Vector1, Vector2, Vector4};
use std::sync::LazyLock;

/// A rod on a cart: position (m), angle from upright (rad) and their rates; the force on the cart (N).
struct CartPole;

impl Dynamics<4, 1> for CartPole {
    fn f<N: Number>(&self, x: &Vector4<N>, u: &Vector1<N>) -> Vector4<N> {
        let number = N::constant;
        let (cart, pole, length, gravity) = (number(1.0), number(0.2), number(0.5), number(9.81));
        let (sin, cos) = x[1].sin_cos();
        let mass = cart + pole * sin * sin;
        let force = u[0] - pole * length * x[3] * x[3] * sin;
        let acceleration = (force + pole * gravity * sin * cos) / mass;
        let turning = (gravity * sin + cos * acceleration) / length;
        Vector4::new(x[2], x[3], acceleration, turning)
    }
}

/// A reaction A to B in a stirred tank that is cooled: concentration (mol/l) and temperature (K); that of the jacket (K),
/// time in minutes. Exothermic, and unstable where it is run.
struct Reactor;

impl Dynamics<2, 1> for Reactor {
    fn f<N: Number>(&self, x: &Vector2<N>, u: &Vector1<N>) -> Vector2<N> {
        let number = N::constant;
        let rate = number(7.2e10) * (number(-8750.0) / x[1]).exp() * x[0];
        Vector2::new(
            number(1.0) - x[0] - rate,
            number(350.0) - x[1] + number(209.205) * rate + number(2.092) * (u[0] - x[1]),
        )
    }
}

pub fn signal(name: &str, unit: &str, bounds: Option<(f64, f64)>) -> Signal {
    Signal {
        lower: bounds.map(|(lower, _)| lower),
        upper: bounds.map(|(_, upper)| upper),
        ..Signal::new(name, unit)
    }
}

pub fn cart_pole() -> Plant {
    Plant::new(PlantData {
        states: vec![
            signal("position", "m", Some((-1.0, 1.0))),
            signal("angle", "rad", Some((-0.4, 0.4))),
            signal("speed", "m/s", None),
            signal("rate", "rad/s", None),
        ],
        inputs: vec![signal("force", "N", Some((-10.0, 10.0)))],
        equilibrium: Some(Equilibrium {
            x: vec![0.0; 4],
            u: vec![0.0],
        }),
        ..PlantData::of_dynamics("cart-pole", &CartPole)
    })
    .unwrap()
}

/// Its steady state is known to six digits.
pub fn reactor() -> Plant {
    Plant::new(PlantData {
        states: vec![
            signal("concentration", "mol/l", Some((0.3, 0.7))),
            signal("temperature", "K", Some((335.0, 365.0))),
        ],
        inputs: vec![signal("jacket", "K", Some((280.0, 320.0)))],
        ..PlantData::of_dynamics("reactor", &Reactor)
    })
    .unwrap()
}

pub fn reactor_settings() -> CertifySettings {
    CertifySettings {
        equilibrium: Some((vec![0.5, 350.0], vec![300.0])),
        ..CertifySettings::new(0.03, &[100.0, 0.01], &[0.01])
    }
}

pub fn cart_pole_settings() -> CertifySettings {
    CertifySettings {
        // Quick: the largest set is not what is tested.
        trials: 0,
        ..CertifySettings::new(0.05, &[2.0, 5.0, 0.1, 0.1], &[0.01])
    }
}

pub static CART_POLE: LazyLock<(Plant, Certificate)> = LazyLock::new(|| {
    let plant = cart_pole();
    let certificate = certify(&plant, &cart_pole_settings(), &|_| ()).unwrap();
    (plant, certificate)
});

pub static REACTOR: LazyLock<(Plant, Certificate)> = LazyLock::new(|| {
    let plant = reactor();
    let certificate = certify(&plant, &reactor_settings(), &|_| ()).unwrap();
    (plant, certificate)
});

pub fn random() -> impl FnMut() -> f64 {
    let mut random = fastrand::Rng::with_seed(7);
    move || 2.0 * random.f64() - 1.0
}

/// P as a matrix of the plant's size.
pub fn p<const N: usize>(certificate: &Certificate) -> nalgebra::SMatrix<f64, N, N> {
    nalgebra::SMatrix::from_fn(|i, j| certificate.p[i][j])
}

/// A state on the edge of the set, in a random direction.
pub fn edge<const N: usize>(
    certificate: &Certificate,
    random: &mut dyn FnMut() -> f64,
) -> Vec<f64> {
    let factor = p::<N>(certificate).cholesky().unwrap();
    let direction = SVector::<f64, N>::from_fn(|_, _| random()).normalize();
    let e = factor.l().transpose().try_inverse().unwrap() * direction * certificate.level.sqrt();
    let center = &certificate.equilibrium.x;
    (0..N).map(|i| center[i] + e[i] * (1.0 - 1e-12)).collect()
}
