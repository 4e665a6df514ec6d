//! How far a reading is from what an estimate expects.

use super::Estimator;
use super::history::Estimate;
use crate::model::{LpvModel, Scalar};
use nalgebra::SVector;

impl<P, T, const NX: usize, const NU: usize, const NS: usize, const NY: usize, const ND: usize>
    Estimator<P, T, NX, NU, NS, NY, ND>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
{
    /// How far the `value` of sensor `i` is from what is expected, and how that depends on z and d.
    pub(super) fn error(
        &self,
        i: usize,
        value: T,
        estimate: &Estimate<T, NX, ND>,
    ) -> (T, SVector<T, NX>, SVector<T, ND>) {
        let state = estimate.z - self.settings.state_offset * estimate.d;
        if let Some((expected, c_z)) = self.model.sensor(i, &state) {
            let c_d = -(self.settings.state_offset.transpose() * c_z);
            return (value - expected, c_z, c_d);
        }
        // Not `row(i)`, which could panic.
        let rows = self.settings.c.row_iter().nth(i);
        let c_z = rows.map_or_else(SVector::zeros, |row| row.transpose());
        let c_d = -(self.settings.state_offset.transpose() * c_z);
        let expected = c_z.dot(&estimate.z) + c_d.dot(&estimate.d);
        (value - expected, c_z, c_d)
    }
}
