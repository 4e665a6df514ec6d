//! A sample whose matrices are given: of a plant that changes along the horizon, or of a scheduling from outside.

use lpvmpc::{LpvModel, Tangent};
use nalgebra::{SMatrix, SVector};

/// x_dot = A x + B u + c, or with a period x+.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LinearModel<const NX: usize, const NU: usize> {
    pub a: SMatrix<f64, NX, NX>,
    pub b: SMatrix<f64, NX, NU>,
    pub c: SVector<f64, NX>,
    /// In discrete time, s.
    pub period: Option<f64>,
}

impl<const NX: usize, const NU: usize> LinearModel<NX, NU> {
    /// What a constant `rate`, in state units per second, adds over a sample of `t_s` seconds after which the state is that
    /// of these matrices: the mean of what it adds at the sample's end and of what becomes of it from its beginning on. Between
    /// the samples nothing is known of the model; of a double integrator it is exact.
    pub fn of_rate(&self, rate: &SVector<f64, NX>, t_s: f64) -> SVector<f64, NX> {
        (rate + self.a * rate) * (t_s / 2.0)
    }
}

impl<const NX: usize, const NU: usize, const NS: usize> LpvModel<f64, NX, NU, NS>
    for LinearModel<NX, NU>
{
    fn period(&self) -> Option<f64> {
        self.period
    }

    fn scheduling(&self, _: &SVector<f64, NX>, _: &SVector<f64, NU>) -> SVector<f64, NS> {
        SVector::zeros()
    }

    fn matrices(&self, _: &SVector<f64, NS>) -> (SMatrix<f64, NX, NX>, SMatrix<f64, NX, NU>) {
        (self.a, self.b)
    }

    fn offset(&self, _: &SVector<f64, NS>) -> Option<SVector<f64, NX>> {
        Some(self.c)
    }

    fn jacobian(
        &self,
        _: &SVector<f64, NX>,
        _: &SVector<f64, NU>,
    ) -> (SMatrix<f64, NX, NX>, SMatrix<f64, NX, NU>) {
        (self.a, self.b)
    }

    fn tangent(&self, x: &SVector<f64, NX>, u: &SVector<f64, NU>) -> Tangent<f64, NX, NU> {
        (self.a * x + self.b * u + self.c, self.a, self.b)
    }
}
