//! A pole hinged on a cart: the plant of Barto, Sutton and Anderson (1983), with viscous friction
//! of the cart, as a linear parameter-varying model.

use lpvmpc::{Embedding, Number};
use nalgebra::{Matrix4, Vector1, Vector2, Vector4};

/// A cart on a straight track that carries a uniform pole on a hinge without friction.
///
/// State x = (s, theta, s_dot, theta_dot): position of the cart in m, tilt of the pole from
/// upright in rad (positive towards positive s), and their rates. Input u: the force on the cart
/// in N. Scheduling: (theta, theta_dot). With l half the pole's length, M the cart's and m the
/// pole's mass, the equations of motion are
///
/// ```text
/// (M + m) s_ddot         + m l cos(theta) theta_ddot = u - friction s_dot + m l theta_dot^2 sin(theta)
/// m l cos(theta) s_ddot  + 4/3 m l^2 theta_ddot      = m g l sin(theta)
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CartPole {
    /// Mass of the cart in kg.
    pub cart_mass: f64,
    /// Mass of the pole in kg.
    pub pole_mass: f64,
    /// Half the length of the pole in m.
    pub half_length: f64,
    /// Friction of the cart on the track in N s/m.
    pub friction: f64,
    /// Gravity in m/s^2.
    pub gravity: f64,
}

impl CartPole {
    /// A cart of 1 kg with a pole of 0.3 kg and 1 m.
    pub fn laboratory() -> Self {
        Self {
            cart_mass: 1.0,
            pole_mass: 0.3,
            half_length: 0.5,
            friction: 0.1,
            gravity: 9.81,
        }
    }
}

impl Embedding<4, 1, 2> for CartPole {
    fn scheduling<N: Number>(&self, x: &Vector4<N>, _force: &Vector1<N>) -> Vector2<N> {
        Vector2::new(x[1], x[3])
    }

    /// sin(theta) = sinc(theta) theta, and one theta_dot of its square stays in the state.
    fn matrices<N: Number>(&self, scheduling: &Vector2<N>) -> (Matrix4<N>, Vector4<N>) {
        let (theta, theta_dot) = (scheduling[0], scheduling[1]);
        let (sin, cos, sinc) = theta.sin_cos_sinc();
        let number = N::constant;
        let (m, l) = (number(self.pole_mass), number(self.half_length));
        let total = number(self.cart_mass + self.pole_mass);
        let four_thirds = number(4.0 / 3.0);
        // The determinant of the mass matrix over m l^2.
        let d = four_thirds * total - m * cos * cos;
        // What a force on the cart does to s_dot and theta_dot, by its rows.
        let b = [four_thirds / d, -cos / (l * d)];
        let pull = number(self.gravity) * sinc / d;
        let weight = [-m * cos * pull, total / l * pull];
        let swing = m * l * theta_dot * sin;
        let drag = -number(self.friction);
        let (zero, one) = (number(0.0), number(1.0));
        #[rustfmt::skip]
        let a = Matrix4::new(
            zero, zero,      one,         zero,
            zero, zero,      zero,        one,
            zero, weight[0], drag * b[0], swing * b[0],
            zero, weight[1], drag * b[1], swing * b[1],
        );
        (a, Vector4::new(zero, zero, b[0], b[1]))
    }
}
