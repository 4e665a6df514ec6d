//! The ballbot of Karachalios and Abbas, written down from the paper for these tests alone.

use lpvmpc::LpvModel;
use lpvmpc_design::ResidualModel;
use nalgebra::{DMatrix, DVector, SMatrix, SVector};

pub const L: f64 = 0.2978;
pub const R_B: f64 = 0.12;
pub const R_W: f64 = 0.05;
pub const G: f64 = 9.81;

/// p1 .. p5 of the table of p; p6 is printed as +251.8476, and -251.8476 is what holds.
pub const P6: f64 = -251.8476;
pub const P: [f64; 6] = [-342.6038, -52.8301, -1425.9, -36.0734, -9.1477, P6];

/// b* as printed.
pub const B_PRINTED: [f64; 4] = [0.002483, 0.059325, 0.143093, -0.07436];

/// The least-squares b with more digits.
pub const B_OPTIMAL: [f64; 4] = [0.00248322, 0.0593257, 0.14309325, -0.07436078];

/// F(b) = p - h(b), eq. (h1) to (h6).
pub struct Refinement {
    pub p6: f64,
}

impl Refinement {
    fn p(&self) -> DVector<f64> {
        let mut p = DVector::from_row_slice(&P);
        p[5] = self.p6;
        p
    }
}

impl ResidualModel for Refinement {
    fn residual(&self, b: &DVector<f64>) -> DVector<f64> {
        let k = b[1] - L * R_B;
        let d = b[0] * b[2] - k * k;
        let h = [
            G * L * k / d,
            -b[2] * b[3] / d,
            R_B * (b[2] - k) / (R_W * d),
            b[0] * G * L / d,
            -b[3] * k / d,
            R_B * (k - b[0]) / (R_W * d),
        ];
        self.p() - DVector::from_row_slice(&h)
    }

    /// h = n(b) / d(b), so dh = (dn - h dd) / d.
    fn jacobian(&self, b: &DVector<f64>) -> DMatrix<f64> {
        let k = b[1] - L * R_B;
        let d = b[0] * b[2] - k * k;
        let ratio = R_B / R_W;
        #[rustfmt::skip]
        let numerator_gradients = DMatrix::from_row_slice(6, 4, &[
            0.0,    G * L,  0.0,   0.0,
            0.0,    0.0,    -b[3], -b[2],
            0.0,    -ratio, ratio, 0.0,
            G * L,  0.0,    0.0,   0.0,
            0.0,    -b[3],  0.0,   -k,
            -ratio, ratio,  0.0,   0.0,
        ]);
        let d_gradient = DMatrix::from_row_slice(1, 4, &[b[2], -2.0 * k, b[0], 0.0]);
        let h = self.p() - self.residual(b);
        -(numerator_gradients - h * d_gradient) / d
    }
}

/// A_c, B_c of the table of elements, scheduling (theta, theta_dot).
pub struct Ballbot {
    pub b: [f64; 4],
}

impl LpvModel<f64, 4, 1, 2> for Ballbot {
    fn scheduling(&self, x: &SVector<f64, 4>, _: &SVector<f64, 1>) -> SVector<f64, 2> {
        SVector::<f64, 2>::new(x[1], x[3])
    }

    fn matrices(&self, s: &SVector<f64, 2>) -> (SMatrix<f64, 4, 4>, SMatrix<f64, 4, 1>) {
        let [b1, b2, b3, b4] = self.b;
        let (sin, cos) = s[0].sin_cos();
        let sinc = if s[0] == 0.0 { 1.0 } else { sin / s[0] };
        let k = b2 - L * R_B * cos;
        let d = b1 * b3 - k * k;
        let c = L * R_B * sin * s[1] / d;
        #[rustfmt::skip]
        let a = SMatrix::<f64, 4, 4>::new(
            0.0, 0.0, 1.0, 0.0,
            0.0, 0.0, 0.0, 1.0,
            0.0, L * G * sinc * k / d, -b3 * b4 / d, b3 * c,
            0.0, b1 * L * G * sinc / d, -b4 * k / d, c * k,
        );
        let ratio = R_B / (R_W * d);
        let b = SMatrix::<f64, 4, 1>::new(0.0, 0.0, ratio * (b3 - k), ratio * (k - b1));
        (a, b)
    }
}

/// The linear model of a ballbot at rest, upright.
pub fn at_rest(b: [f64; 4]) -> (DMatrix<f64>, DMatrix<f64>) {
    let (a, b) = Ballbot { b }.matrices(&SVector::zeros());
    (
        DMatrix::from_column_slice(4, 4, a.as_slice()),
        DMatrix::from_column_slice(4, 1, b.as_slice()),
    )
}

/// The linear model made of p itself.
pub fn from_p() -> (DMatrix<f64>, DMatrix<f64>) {
    #[rustfmt::skip]
    let a = DMatrix::from_row_slice(4, 4, &[
        0.0, 0.0, 1.0, 0.0,
        0.0, 0.0, 0.0, 1.0,
        0.0, P[0], P[1], 0.0,
        0.0, P[3], P[4], 0.0,
    ]);
    (a, DMatrix::from_row_slice(4, 1, &[0.0, 0.0, P[2], P[5]]))
}

/// Q of scenario 1, R.
pub fn cost() -> (DMatrix<f64>, DMatrix<f64>) {
    let q = DVector::from_row_slice(&[200.0, 1.0, 0.1, 0.1]);
    (
        DMatrix::from_diagonal(&q),
        DMatrix::from_element(1, 1, 1000.0),
    )
}
