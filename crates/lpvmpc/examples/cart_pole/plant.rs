//! A pole hinged on a cart: the plant of Barto, Sutton and Anderson (1983), with viscous friction
//! of the cart, as a linear parameter-varying model.

use lpvmpc::{LpvModel, Scalar};
use nalgebra::{Matrix4, Vector2, Vector4, convert};

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
pub struct CartPole<T> {
    /// Mass of the cart in kg.
    pub cart_mass: T,
    /// Mass of the pole in kg.
    pub pole_mass: T,
    /// Half the length of the pole in m.
    pub half_length: T,
    /// Friction of the cart on the track in N s/m.
    pub friction: T,
    /// Gravity in m/s^2.
    pub gravity: T,
}

impl<T: Scalar> CartPole<T> {
    /// A cart of 1 kg with a pole of 0.3 kg and 1 m.
    pub fn laboratory() -> Self {
        Self {
            cart_mass: convert(1.0),
            pole_mass: convert(0.3),
            half_length: convert(0.5),
            friction: convert(0.1),
            gravity: convert(9.81),
        }
    }
}

impl<T: Scalar> LpvModel<T, 4, 1, 2> for CartPole<T> {
    fn scheduling(&self, x: &Vector4<T>) -> Vector2<T> {
        Vector2::new(x[1], x[3])
    }

    /// The embedding: sin(theta) = sinc(theta) theta, and one theta_dot of its square stays in
    /// the state.
    fn matrices(&self, scheduling: &Vector2<T>) -> (Matrix4<T>, Vector4<T>) {
        let (theta, theta_dot) = (scheduling[0], scheduling[1]);
        let (sin, cos) = theta.sin_cos();
        let sinc = if theta == T::zero() {
            T::one()
        } else {
            sin / theta
        };
        let total = self.cart_mass + self.pole_mass;
        let four_thirds: T = convert(4.0 / 3.0);
        // The determinant of the mass matrix over m l^2.
        let d = four_thirds * total - self.pole_mass * cos * cos;
        // What a force on the cart does to s_dot and theta_dot.
        let b = Vector2::new(four_thirds / d, -cos / (self.half_length * d));
        let damping = b * -self.friction;
        let swing = b * (self.pole_mass * self.half_length * theta_dot * sin);
        let weight = Vector2::new(-self.pole_mass * cos, total / self.half_length)
            * (self.gravity * sinc / d);

        let mut a = Matrix4::zeros();
        a[(0, 2)] = T::one();
        a[(1, 3)] = T::one();
        for (row, j) in [(2, 0), (3, 1)] {
            a[(row, 1)] = weight[j];
            a[(row, 2)] = damping[j];
            a[(row, 3)] = swing[j];
        }
        (a, Vector4::new(T::zero(), T::zero(), b[0], b[1]))
    }
}
