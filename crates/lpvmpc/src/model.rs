//! What a plant must offer: a linear model whose matrices depend on a scheduling vector.

use crate::embedding::Tangent;
use crate::small_matrix::{add_product, product};
use crate::steady_state::{self, SteadyState, SteadyStateProblem};
use nalgebra::{RealField, SMatrix, SVector, convert};

/// The number type of the method: `f32` on a microcontroller, `f64` on a PC.
pub trait Scalar: RealField + Copy {}
impl<T: RealField + Copy> Scalar for T {}

/// A continuous-time linear parameter-varying (LPV) model
///
/// ```text
/// x_dot = A(s) x + B(s) u + c(s),     s = sigma(x, u)
/// ```
///
/// with `NX` states, `NU` inputs and `NS` scheduling parameters; sigma depends on x alone and c is zero
/// in eq. (3) of Karachalios and Abbas. The embedding is exact: with `s = sigma(x, u)` the right-hand
/// side *is* the nonlinear plant's f(x, u). All quantities are in SI units.
///
/// This is what a controller asks of its plant, in its own number type. Plants whose formulas can be
/// written down are best an [`Embedding`](crate::Embedding) or [`Dynamics`](crate::Dynamics): once for
/// every kind of number, and with this for nothing. Implement it by itself for what is not
/// formulas: tables, other programs.
pub trait LpvModel<T: Scalar, const NX: usize, const NU: usize, const NS: usize> {
    /// The period, s, of a model that is sampled itself; `None`, as a rule, of one in continuous time.
    ///
    /// With a period, wherever this trait speaks of x_dot it is x+ instead, the state one period later:
    /// x+ = F(x, u) = A(s) x + B(s) u + c(s), in state units, with the derivatives of F. The input is held over
    /// whole periods only, and [`Rk4`](crate::Rk4) steps become as many periods as are nearest to their time.
    #[inline(always)]
    fn period(&self) -> Option<T> {
        None
    }

    /// sigma(x, u): the scheduling vector at the state `x` and the input `u`.
    fn scheduling(&self, x: &SVector<T, NX>, u: &SVector<T, NU>) -> SVector<T, NS>;

    /// The continuous-time matrices A (`NX` x `NX`, per second) and B (`NX` x `NU`) at `scheduling`.
    fn matrices(&self, scheduling: &SVector<T, NS>) -> (SMatrix<T, NX, NX>, SMatrix<T, NX, NU>);

    /// The affine term c at `scheduling`, in state units per second; `None` where it is always zero.
    #[inline(always)]
    fn offset(&self, scheduling: &SVector<T, NS>) -> Option<SVector<T, NX>> {
        let _ = scheduling;
        None
    }

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

    /// x_dot = f(x, u) = A(s) x + B(s) u + c(s) with s = sigma(x, u), in state units per second.
    ///
    /// A plant with a cheaper direct form may override this; it must return the same vector.
    fn derivative(&self, x: &SVector<T, NX>, u: &SVector<T, NU>) -> SVector<T, NX> {
        let scheduling = self.scheduling(x, u);
        let (a, b) = self.matrices(&scheduling);
        let rate = a * x + b * u;
        match self.offset(&scheduling) {
            Some(c) => rate + c,
            None => rate,
        }
    }

    /// (df/dx, df/du) at `x` and `u`: `NX` x `NX` per second, and `NX` x `NU`.
    ///
    /// By central differences of [`derivative`](Self::derivative); where the scheduling does not depend
    /// on u, df/du is B. A plant with a closed form should override this: it is faster, and in `f32`
    /// more accurate.
    fn jacobian(
        &self,
        x: &SVector<T, NX>,
        u: &SVector<T, NU>,
    ) -> (SMatrix<T, NX, NX>, SMatrix<T, NX, NU>) {
        let a = differences(x, |x| self.derivative(x, u));
        let scheduling = self.scheduling(x, u);
        let by_input = differences(u, |u| self.scheduling(x, u));
        let b = if by_input.iter().all(|slope| *slope == T::zero()) {
            self.matrices(&scheduling).1
        } else {
            differences(u, |u| self.derivative(x, u))
        };
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

    /// x_dot with the matrices that it is made of, (f, A(s), B(s)) with s = sigma(x, u).
    ///
    /// A plant whose f and matrices have work in common may override this; it must return the same
    /// numbers, to rounding.
    #[inline(always)]
    fn embedded(
        &self,
        x: &SVector<T, NX>,
        u: &SVector<T, NU>,
    ) -> (SVector<T, NX>, SMatrix<T, NX, NX>, SMatrix<T, NX, NU>) {
        embedded_by_products(self, x, u)
    }

    /// Whether [`embedded_each`](Self::embedded_each) and [`tangent_each`](Self::tangent_each) take less time than one
    /// point after the other.
    const TOGETHER: bool = false;

    /// [`embedded`](Self::embedded) at several points, into places of theirs.
    fn embedded_each<const POINTS: usize>(
        &self,
        x: &[SVector<T, NX>; POINTS],
        u: &[SVector<T, NU>; POINTS],
        tangents: &mut [Tangent<T, NX, NU>; POINTS],
    ) {
        for (i, tangent) in tangents.iter_mut().enumerate() {
            *tangent = self.embedded(&x[i], &u[i]);
        }
    }

    /// [`tangent`](Self::tangent) at several points, into places of theirs.
    fn tangent_each<const POINTS: usize>(
        &self,
        x: &[SVector<T, NX>; POINTS],
        u: &[SVector<T, NU>; POINTS],
        tangents: &mut [Tangent<T, NX, NU>; POINTS],
    ) {
        for (i, tangent) in tangents.iter_mut().enumerate() {
            *tangent = self.tangent(&x[i], &u[i]);
        }
    }

    /// Whether there is an [`offset`](Self::offset).
    #[inline(always)]
    fn has_offset(&self) -> bool {
        self.offset(&SVector::zeros()).is_some()
    }

    /// What the sensor `i` of an [`Estimator`](crate::Estimator) measures at the state `x`, and its derivatives,
    /// of a sensor that is not linear; `None`, as a rule, where it is the row `i` of
    /// [`EstimatorSettings::c`](crate::EstimatorSettings::c).
    #[inline(always)]
    fn sensor(&self, i: usize, x: &SVector<T, NX>) -> Option<(T, SVector<T, NX>)> {
        let _ = (i, x);
        None
    }

    /// The steady state, f(x, u) = 0 (F(x, u) = x of a model with a period) within bounds, that is nearest to a reference; `None` where
    /// none is found.
    ///
    /// By Newton's method from the reference, or, where bounds are met or it bends away, by an interior-point method. A plant that knows its steady states in closed form
    /// may say so.
    fn steady_state(
        &self,
        problem: &SteadyStateProblem<T, NX, NU>,
    ) -> Option<SteadyState<T, NX, NU>> {
        steady_state::nearest(self, problem)
    }
}

/// (f, A(s), B(s)), f as the sum of products that it is.
#[inline(always)]
pub(crate) fn embedded_by_products<P, T, const NX: usize, const NU: usize, const NS: usize>(
    model: &P,
    x: &SVector<T, NX>,
    u: &SVector<T, NU>,
) -> (SVector<T, NX>, SMatrix<T, NX, NX>, SMatrix<T, NX, NU>)
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS> + ?Sized,
{
    // The embedding is exact, so its product is f.
    let scheduling = model.scheduling(x, u);
    let (a, b) = model.matrices(&scheduling);
    let mut rate = model.a_times(&a, x);
    add_product(&mut rate, &b, u);
    if let Some(c) = model.offset(&scheduling) {
        rate += c;
    }
    (rate, a, b)
}

/// The derivatives of `g` at `at`, by central differences.
fn differences<T: Scalar, const R: usize, const C: usize>(
    at: &SVector<T, C>,
    g: impl Fn(&SVector<T, C>) -> SVector<T, R>,
) -> SMatrix<T, R, C> {
    // The cube root of epsilon balances rounding and the differences' own error.
    let relative = T::default_epsilon().powf(convert(1.0 / 3.0));
    let mut slopes = SMatrix::<T, R, C>::zeros();
    for j in 0..C {
        let (mut above, mut below) = (*at, *at);
        let step = relative * (T::one() + at[j].abs());
        above[j] += step;
        below[j] -= step;
        // What was really added: x + step is rounded.
        slopes.set_column(j, &((g(&above) - g(&below)) / (above[j] - below[j])));
    }
    slopes
}
