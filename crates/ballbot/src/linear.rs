//! From b to the parameters p of the linear model at the upright equilibrium, and back to
//! state-space matrices.

use crate::embedding::state_matrix;
use crate::friction::DriveFriction;
use crate::parameters::{Ballbot, LinearParameters};
use lpvmpc::{Dual, Number, Scalar};
use nalgebra::{Matrix4, SMatrix, Vector4, Vector6};

impl<T: Scalar> LinearParameters<T> {
    /// (p1, ..., p6).
    pub fn to_vector(&self) -> Vector6<T> {
        Vector6::new(self.p1, self.p2, self.p3, self.p4, self.p5, self.p6)
    }
}

impl<T: Number> LinearParameters<T> {
    /// The linear model x_dot = A x + B tau, x = (phi, theta, phi_dot, theta_dot).
    pub fn matrices(&self) -> (Matrix4<T>, Vector4<T>) {
        let zero = T::constant(0.0);
        let a = state_matrix([self.p1, self.p2, zero], [self.p4, self.p5, zero]);
        (a, Vector4::new(zero, zero, self.p3, self.p6))
    }

    /// The parameters of such a model; what else may be in its matrices is left out.
    pub fn of_matrices(a: &Matrix4<T>, b: &Vector4<T>) -> Self {
        Self {
            p1: a[(2, 1)],
            p2: a[(2, 2)],
            p3: b[2],
            p4: a[(3, 1)],
            p5: a[(3, 2)],
            p6: b[3],
        }
    }
}

impl<T: Number> Ballbot<T> {
    /// h(b): the linear model of this ballbot at the upright equilibrium (eq. (11)). Its structure
    /// has no place for friction in the drive, which is left out.
    pub fn linear_parameters(&self) -> LinearParameters<T> {
        let zero = T::constant(0.0);
        let frictionless = Self {
            drive: DriveFriction::none(),
            ..*self
        };
        let (a, b) = frictionless.matrices_at(zero, zero, zero);
        LinearParameters::of_matrices(&a, &b)
    }
}

impl<T: Scalar + Number> Ballbot<T> {
    /// dh/db: the derivatives of (p1, ..., p6) with respect to (b1, ..., b4), 6 x 4.
    pub fn linear_parameters_jacobian(&self) -> SMatrix<T, 6, 4> {
        let b = Dual::variables(&Vector4::new(self.b1, self.b2, self.b3, self.b4));
        let robot = Ballbot {
            b1: b[0],
            b2: b[1],
            b3: b[2],
            b4: b[3],
            ..self.over::<Dual<T, 4>>()
        };
        let p = robot.linear_parameters();
        let rows = [p.p1, p.p2, p.p3, p.p4, p.p5, p.p6];
        SMatrix::from_fn(|i, j| rows[i].slopes[j])
    }
}
