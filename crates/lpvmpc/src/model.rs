//! What a plant must offer: a linear model whose matrices depend on a scheduling vector.

use crate::kernel::product;
use nalgebra::{RealField, SMatrix, SVector};

/// The number type of the method: `f32` on a microcontroller, `f64` on a PC.
pub trait Scalar: RealField + Copy {}
impl<T: RealField + Copy> Scalar for T {}

/// A continuous-time linear parameter-varying (LPV) model
///
/// ```text
/// x_dot = A(scheduling) x + B(scheduling) u,     scheduling = sigma(x)
/// ```
///
/// with `NX` states, `NU` inputs and `NS` scheduling parameters (eq. (3) of Karachalios and
/// Abbas). The embedding is exact: with `scheduling = sigma(x)` the right-hand side *is* the
/// nonlinear plant's f(x, u). All quantities are in SI units.
pub trait LpvModel<T: Scalar, const NX: usize, const NU: usize, const NS: usize> {
    /// sigma(x): the scheduling vector at the state `x`.
    fn scheduling(&self, x: &SVector<T, NX>) -> SVector<T, NS>;

    /// The continuous-time pair A (`NX` x `NX`, per second) and B (`NX` x `NU`) at `scheduling`.
    fn matrices(&self, scheduling: &SVector<T, NS>) -> (SMatrix<T, NX, NX>, SMatrix<T, NX, NU>);

    /// A V, for the A that [`matrices`](Self::matrices) returned and a V of `C` columns.
    ///
    /// A plant in whose A many entries are always zero or one may override this with fewer
    /// products: most of a predictor's work is here. It must return the same matrix.
    #[inline(always)]
    fn a_times<const C: usize>(
        &self,
        a: &SMatrix<T, NX, NX>,
        v: &SMatrix<T, NX, C>,
    ) -> SMatrix<T, NX, C> {
        product(a, v)
    }

    /// x_dot = f(x, u) = A(sigma(x)) x + B(sigma(x)) u, in state units per second.
    ///
    /// A plant with a cheaper direct form may override this; it must return the same vector.
    fn derivative(&self, x: &SVector<T, NX>, u: &SVector<T, NU>) -> SVector<T, NX> {
        let (a, b) = self.matrices(&self.scheduling(x));
        a * x + b * u
    }
}
