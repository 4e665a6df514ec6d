//! A linear model of run-time size, as the design tools take it.

use lpvmpc_design::MatrixError;
use nalgebra::{Complex, DMatrix, Matrix4, Vector4};

/// x_dot = A x + B u with x = (phi, theta, phi_dot, theta_dot) in rad and rad/s, u in N m.
#[derive(Clone, Debug, PartialEq)]
pub struct LinearModel {
    /// A, 4 x 4.
    pub a: DMatrix<f64>,
    /// B, 4 x 1.
    pub b: DMatrix<f64>,
}

impl From<(Matrix4<f64>, Vector4<f64>)> for LinearModel {
    fn from((a, b): (Matrix4<f64>, Vector4<f64>)) -> Self {
        Self {
            a: DMatrix::from_column_slice(4, 4, a.as_slice()),
            b: DMatrix::from_column_slice(4, 1, b.as_slice()),
        }
    }
}

impl LinearModel {
    /// The poles, sorted by real part, 1/s.
    ///
    /// # Errors
    /// An entry of A is not finite.
    pub fn poles(&self) -> Result<Vec<Complex<f64>>, MatrixError> {
        lpvmpc_design::poles(&self.a)
    }

    /// The dimension of what the torque can reach; 4 is everything.
    ///
    /// # Errors
    /// An entry of A or B is not finite.
    pub fn controllability_rank(&self) -> Result<usize, MatrixError> {
        lpvmpc_design::controllability_rank(&self.a, &self.b)
    }
}
