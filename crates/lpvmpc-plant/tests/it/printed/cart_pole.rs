//! `cart-pole`: printed by `lpvmpc-plant` from its file; not to be edited.
//!
//! | | name | unit |
//! |---|---|---|
//! | x\[0\] | `position` | `m` |
//! | x\[1\] | `tilt` | `rad` |
//! | x\[2\] | `speed` | `m/s` |
//! | x\[3\] | `rate` | `rad/s` |
//! | u\[0\] | `force` | `N` |
//! | y\[0\] | `tip_position` | `m` |
//! | y\[1\] | `tip_height` | `m` |

#[allow(unused_imports, reason = "which of them are needed depends on the plant")]
use lpvmpc::{Bivariate, Embedding, Elementary, Number};
#[allow(unused_imports, reason = "which of them are needed depends on the plant")]
use nalgebra::{SMatrix, SVector};

/// The plant `cart-pole`, with the values of its parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CartPole {
    /// `cart_mass`, `kg`
    pub cart_mass: f64,
    /// `pole_mass`, `kg`
    pub pole_mass: f64,
    /// `half_length`, `m`
    pub half_length: f64,
    /// `friction`, `N s/m`
    pub friction: f64,
    /// `gravity`, `m/s^2`
    pub gravity: f64,
}

impl Default for CartPole {
    fn default() -> Self {
        Self {
            cart_mass: 1.0,
            pole_mass: 0.3,
            half_length: 0.5,
            friction: 0.1,
            gravity: 9.81,
        }
    }
}

#[allow(
    clippy::all,
    dead_code,
    unused_variables,
    reason = "printed from a straight-line program"
)]
impl Embedding<4, 1, 2> for CartPole {
    fn scheduling<N: Number>(&self, x: &SVector<N, 4>, u: &SVector<N, 1>) -> SVector<N, 2> {
        let g0 = x[3];
        let g1 = x[1];
        SVector::<N, 2>::from([g1, g0])
    }

    fn matrices<N: Number>(&self, scheduling: &SVector<N, 2>) -> (SMatrix<N, 4, 4>, SMatrix<N, 4, 1>) {
        let g0 = N::constant(1.3333333333333333);
        let g1 = N::constant(0.0);
        let g2 = N::constant(1.0);
        let g3 = N::constant(self.friction);
        let g4 = N::constant(self.pole_mass);
        let g5 = N::constant(self.half_length);
        let g6 = N::constant(self.gravity);
        let g7 = N::constant(self.cart_mass);
        let g8 = scheduling[0];
        let g9 = scheduling[1];
        let v0 = g4 * g5;
        let v1 = g7 + g4;
        let v2 = g0 * v1;
        let (v3, w3) = g8.sin_cos();
        let v4 = g4 * w3;
        let v5 = g8.elementary(Elementary::Sinc);
        let v6 = g6 * v5;
        let v7 = w3 * w3;
        let v8 = g4 * v7;
        let v9 = v2 - v8;
        let v10 = v6 / v9;
        let v11 = v4 * v10;
        let v12 = -v11;
        let v13 = g0 / v9;
        let v14 = g3 * v13;
        let v15 = -v14;
        let v16 = v0 * g9;
        let v17 = v16 * v3;
        let v18 = v17 * v13;
        let v19 = v1 / g5;
        let v20 = v19 * v10;
        let v21 = g5 * v9;
        let v22 = w3 / v21;
        let v23 = g3 * v22;
        let v24 = v17 * v22;
        let v25 = -v24;
        let v26 = -v22;
        (
            SMatrix::<N, 4, 4>::from_iterator([g1, g1, g1, g1, g1, g1, v12, v20, g2, g1, v15, v23, g1, g2, v18, v25]),
            SMatrix::<N, 4, 1>::from_iterator([g1, g1, v13, v26]),
        )
    }

    fn f<N: Number>(&self, x: &SVector<N, 4>, u: &SVector<N, 1>) -> SVector<N, 4> {
        let g0 = N::constant(1.3333333333333333);
        let g1 = N::constant(self.friction);
        let g2 = N::constant(self.pole_mass);
        let g3 = N::constant(self.half_length);
        let g4 = N::constant(self.gravity);
        let g5 = N::constant(self.cart_mass);
        let g6 = x[2];
        let g7 = x[3];
        let g8 = x[1];
        let g9 = u[0];
        let v0 = g1 * g6;
        let v1 = g9 - v0;
        let v2 = g2 * g3;
        let v3 = g7 * g7;
        let v4 = v2 * v3;
        let (v5, w5) = g8.sin_cos();
        let v6 = v4 * v5;
        let v7 = v1 + v6;
        let v8 = g0 * v7;
        let v9 = g2 * g4;
        let v10 = v9 * v5;
        let v11 = v10 * w5;
        let v12 = v8 - v11;
        let v13 = g5 + g2;
        let v14 = g0 * v13;
        let v15 = w5 * w5;
        let v16 = g2 * v15;
        let v17 = v14 - v16;
        let v18 = v12 / v17;
        let v19 = v13 * g4;
        let v20 = v19 * v5;
        let v21 = w5 * v7;
        let v22 = v20 - v21;
        let v23 = g3 * v17;
        let v24 = v22 / v23;
        SVector::<N, 4>::from([g6, g7, v18, v24])
    }
}

#[allow(
    clippy::all,
    dead_code,
    unused_variables,
    reason = "printed from a straight-line program"
)]
impl CartPole {
    /// y = g(x, u), in the units of the outputs.
    pub fn output<N: Number>(&self, x: &SVector<N, 4>, u: &SVector<N, 1>) -> SVector<N, 2> {
        let g0 = N::constant(self.half_length);
        let g1 = x[1];
        let g2 = x[0];
        let (v0, w0) = g1.sin_cos();
        let v1 = g0 + g0;
        let v2 = v1 * v0;
        let v3 = g2 + v2;
        let v4 = v1 * w0;
        SVector::<N, 2>::from([v3, v4])
    }
}
