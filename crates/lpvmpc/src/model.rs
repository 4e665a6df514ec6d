//! What a plant must offer: a linear model whose matrices depend on a scheduling vector.

use crate::kernel::product;
use crate::steady_state::{self, SteadyState, SteadyStateProblem};
use nalgebra::{RealField, SMatrix, SVector, convert};

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

    /// A V, for an A that [`matrices`](Self::matrices) or [`jacobian`](Self::jacobian) returned and
    /// a V of `C` columns.
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

    /// (df/dx, df/du) at `x` and `u`: `NX` x `NX` per second, and `NX` x `NU`.
    ///
    /// By central differences of [`derivative`](Self::derivative) with respect to x; f is affine in
    /// u, so that df/du is B. A plant with a closed form should override this: it is faster, and in
    /// `f32` more accurate.
    fn jacobian(
        &self,
        x: &SVector<T, NX>,
        u: &SVector<T, NU>,
    ) -> (SMatrix<T, NX, NX>, SMatrix<T, NX, NU>) {
        // The cube root of epsilon balances rounding and the differences' own error.
        let relative = T::default_epsilon().powf(convert(1.0 / 3.0));
        let mut a = SMatrix::<T, NX, NX>::zeros();
        for j in 0..NX {
            let (mut above, mut below) = (*x, *x);
            let step = relative * (T::one() + x[j].abs());
            above[j] += step;
            below[j] -= step;
            let change = self.derivative(&above, u) - self.derivative(&below, u);
            // What was really added: x + step is rounded.
            a.set_column(j, &(change / (above[j] - below[j])));
        }
        let (_, b) = self.matrices(&self.scheduling(x));
        (a, b)
    }

    /// [`derivative`](Self::derivative) and [`jacobian`](Self::jacobian) at `x` and `u`:
    /// (f, df/dx, df/du).
    ///
    /// A plant whose Jacobian needs f anyway may override this; it must return the same numbers, to
    /// rounding.
    #[inline(always)]
    fn tangent(
        &self,
        x: &SVector<T, NX>,
        u: &SVector<T, NU>,
    ) -> (SVector<T, NX>, SMatrix<T, NX, NX>, SMatrix<T, NX, NU>) {
        let (a, b) = self.jacobian(x, u);
        (self.derivative(x, u), a, b)
    }

    /// The steady state, f(x, u) = 0 within bounds, that is nearest to a reference; `None` where
    /// none is found.
    ///
    /// By Newton's method from the reference. A plant that knows its steady states in closed form
    /// may say so.
    fn steady_state(
        &self,
        problem: &SteadyStateProblem<T, NX, NU>,
    ) -> Option<SteadyState<T, NX, NU>> {
        steady_state::nearest(self, problem)
    }
}
