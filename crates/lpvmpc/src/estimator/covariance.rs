//! The covariance of state and disturbance, corrected in Joseph's form.

use crate::model::Scalar;
use nalgebra::{SMatrix, SVector, convert};

/// The covariance of (z, d) in blocks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Covariance<T, const NX: usize, const ND: usize> {
    /// Of z, `NX` x `NX`, symmetric positive semidefinite.
    pub zz: SMatrix<T, NX, NX>,
    /// Of z with d, `NX` x `ND`.
    pub zd: SMatrix<T, NX, ND>,
    /// Of d, `ND` x `ND`, symmetric positive semidefinite.
    pub dd: SMatrix<T, ND, ND>,
}

impl<T: Scalar, const NX: usize, const ND: usize> Covariance<T, NX, ND> {
    /// The variance of c_z'z + c_d'd.
    pub(super) fn of(&self, c_z: &SVector<T, NX>, c_d: &SVector<T, ND>) -> T {
        let (p_z, p_d) = self.times(c_z, c_d);
        c_z.dot(&p_z) + c_d.dot(&p_d)
    }

    /// P (c_z, c_d).
    pub(super) fn times(
        &self,
        c_z: &SVector<T, NX>,
        c_d: &SVector<T, ND>,
    ) -> (SVector<T, NX>, SVector<T, ND>) {
        (
            self.zz * c_z + self.zd * c_d,
            self.zd.transpose() * c_z + self.dd * c_d,
        )
    }

    /// Raises the variances of the `chosen` components of z by as much as explains the `error` of
    /// `c`'z; what is added hangs together with nothing.
    pub(super) fn open(&mut self, chosen: &[bool; NX], c: &SVector<T, NX>, error: T) {
        let known = c.dot(&(self.zz * c));
        if !(known > T::zero()) {
            return;
        }
        let factor = T::one() + error * error / known;
        for (i, chosen) in chosen.iter().enumerate() {
            if let (true, Some(variance)) = (*chosen, self.zz.get_mut((i, i))) {
                *variance *= factor;
            }
        }
    }

    /// Takes in a measurement of c_z'z + c_d'd with the variance `noise`, and returns the gain:
    /// P <- (I - K c')P(I - K c')' + K noise K', which stays positive semidefinite whatever the
    /// rounding of K.
    pub(super) fn correct(
        &mut self,
        c_z: &SVector<T, NX>,
        c_d: &SVector<T, ND>,
        noise: T,
    ) -> (SVector<T, NX>, SVector<T, ND>) {
        let (p_z, p_d) = self.times(c_z, c_d);
        let variance = c_z.dot(&p_z) + c_d.dot(&p_d) + noise;
        let (k_z, k_d) = (p_z / variance, p_d / variance);
        // M = (I - K c') P, and then M (I - K c')' + K noise K' = M + (K noise - M c) K'.
        let m_zz = self.zz - k_z * p_z.transpose();
        let m_zd = self.zd - k_z * p_d.transpose();
        let m_dz = self.zd.transpose() - k_d * p_z.transpose();
        let m_dd = self.dd - k_d * p_d.transpose();
        let rest_z = k_z * noise - m_zz * c_z - m_zd * c_d;
        let rest_d = k_d * noise - m_dz * c_z - m_dd * c_d;
        self.zz = symmetric(&(m_zz + rest_z * k_z.transpose()));
        self.zd = m_zd + rest_z * k_d.transpose();
        self.dd = symmetric(&(m_dd + rest_d * k_d.transpose()));
        (k_z, k_d)
    }
}

fn symmetric<T: Scalar, const K: usize>(matrix: &SMatrix<T, K, K>) -> SMatrix<T, K, K> {
    (matrix + matrix.transpose()) * convert::<f64, T>(0.5)
}
