//! From b to the parameters p of the linear model at the upright equilibrium, and back to
//! state-space matrices.

use crate::parameters::{Ballbot, LinearParameters};
use lpvmpc::Scalar;
use nalgebra::{Matrix4, SMatrix, Vector4, Vector6, convert};

impl<T: Scalar> LinearParameters<T> {
    /// (p1, ..., p6).
    pub fn to_vector(&self) -> Vector6<T> {
        Vector6::new(self.p1, self.p2, self.p3, self.p4, self.p5, self.p6)
    }

    /// The linear model x_dot = A x + B tau, x = (phi, theta, phi_dot, theta_dot).
    pub fn matrices(&self) -> (Matrix4<T>, Vector4<T>) {
        let (zero, one) = (T::zero(), T::one());
        #[rustfmt::skip]
        let a = Matrix4::new(
            zero, zero,    one,     zero,
            zero, zero,    zero,    one,
            zero, self.p1, self.p2, zero,
            zero, self.p4, self.p5, zero,
        );
        (a, Vector4::new(zero, zero, self.p3, self.p6))
    }
}

impl<T: Scalar> Ballbot<T> {
    /// h(b): the linear model of this ballbot at the upright equilibrium (eq. (11)). Its structure
    /// has no place for friction in the drive, which is left out.
    pub fn linear_parameters(&self) -> LinearParameters<T> {
        let Self {
            b1,
            b3,
            b4,
            geometry,
            ..
        } = *self;
        let k = self.coupling(T::one());
        let inverse = T::one() / self.determinant(k);
        let gravity = geometry.gravity * geometry.centre_of_mass * inverse;
        let torque = self.gear() * inverse;
        LinearParameters {
            p1: gravity * k,
            p2: -b3 * b4 * inverse,
            p3: torque * (b3 - k),
            p4: gravity * b1,
            p5: -b4 * k * inverse,
            p6: torque * (k - b1),
        }
    }

    /// dh/db: the derivatives of (p1, ..., p6) with respect to (b1, ..., b4), 6 x 4.
    pub fn linear_parameters_jacobian(&self) -> SMatrix<T, 6, 4> {
        let Self {
            b1,
            b3,
            b4,
            geometry,
            ..
        } = *self;
        let k = self.coupling(T::one());
        let d = self.determinant(k);
        let weight = geometry.gravity * geometry.centre_of_mass;
        let gear = self.gear();
        let zero = T::zero();
        // p = n / d, so dp/db = (dn/db - p dd/db) / d.
        #[rustfmt::skip]
        let numerators = SMatrix::<T, 6, 4>::from_row_slice(&[
            zero,   weight, zero, zero,
            zero,   zero,   -b4,  -b3,
            zero,   -gear,  gear, zero,
            weight, zero,   zero, zero,
            zero,   -b4,    zero, -k,
            -gear,  gear,   zero, zero,
        ]);
        let d_d = Vector4::new(b3, -k * convert(2.0), b1, zero);
        (numerators - self.linear_parameters().to_vector() * d_d.transpose()) / d
    }
}
