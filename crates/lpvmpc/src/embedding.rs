//! A plant written once, for every kind of number.

use crate::model::{LpvModel, Scalar, embedded_by_products};
use crate::number::{Dual, Number};
use crate::small_matrix::product;
use crate::steady_state::{self, SteadyState, SteadyStateProblem};
use nalgebra::{SMatrix, SVector, convert};

/// f and its derivatives at a point: (f, df/dx, df/du).
pub type Tangent<T, const NX: usize, const NU: usize> =
    (SVector<T, NX>, SMatrix<T, NX, NX>, SMatrix<T, NX, NU>);

/// An LPV plant written once, for every kind of [`Number`]: an [`LpvModel`] of `f32` and `f64` for
/// controllers, filters, simulations and fits, with its derivatives by [`Dual`] numbers, and the
/// plant of the proofs of `lpvmpc-certificate`.
///
/// ```text
/// x_dot = A(s) x + B(s) u + c(s),     s = sigma(x, u)
/// ```
///
/// with `NX` states, `NU` inputs and `NS` scheduling parameters, in SI units. A plant that is known
/// by its f alone is a [`Dynamics`].
pub trait Embedding<const NX: usize, const NU: usize, const NS: usize> {
    /// See [`LpvModel::period`], s.
    #[inline(always)]
    fn period(&self) -> Option<f64> {
        None
    }

    /// sigma(x, u): the scheduling vector.
    fn scheduling<N: Number>(&self, x: &SVector<N, NX>, u: &SVector<N, NU>) -> SVector<N, NS>;

    /// A(s), `NX` x `NX`, per second, and B(s), `NX` x `NU`.
    fn matrices<N: Number>(
        &self,
        scheduling: &SVector<N, NS>,
    ) -> (SMatrix<N, NX, NX>, SMatrix<N, NX, NU>);

    /// The affine term c(s) in state units per second; `None` where it is always zero.
    #[inline(always)]
    fn offset<N: Number>(&self, scheduling: &SVector<N, NS>) -> Option<SVector<N, NX>> {
        let _ = scheduling;
        None
    }

    /// x_dot = f(x, u), in state units per second.
    ///
    /// A plant with a cheaper direct form may override this; it must be the same function.
    #[inline(always)]
    fn f<N: Number>(&self, x: &SVector<N, NX>, u: &SVector<N, NU>) -> SVector<N, NX> {
        let scheduling = self.scheduling(x, u);
        let (a, b) = self.matrices(&scheduling);
        let zero = N::constant(0.0);
        let c = self.offset(&scheduling);
        let mut rate = c.unwrap_or_else(|| SVector::repeat(zero));
        for (i, rate) in rate.iter_mut().enumerate() {
            for (j, x) in x.iter().enumerate() {
                *rate = *rate + a[(i, j)] * *x;
            }
            for (j, u) in u.iter().enumerate() {
                *rate = *rate + b[(i, j)] * *u;
            }
        }
        rate
    }

    /// f with its derivatives at `x` and `u`.
    ///
    /// By dual numbers. A plant with a closed form may override this where speed counts; it must
    /// return the same numbers, to rounding.
    #[inline(always)]
    fn tangent<T: Scalar + Number>(
        &self,
        x: &SVector<T, NX>,
        u: &SVector<T, NU>,
    ) -> Tangent<T, NX, NU> {
        tangent_by_duals(
            x,
            u,
            |x: &SVector<Dual<T, NX>, NX>, u| self.f(x, u),
            |x, u| self.f(x, u),
        )
    }

    /// See [`LpvModel::TOGETHER`].
    const TOGETHER: bool = false;

    /// [`tangent`](Self::tangent) at several points, into places of theirs.
    #[inline(always)]
    fn tangent_each<T: Scalar + Number, const POINTS: usize>(
        &self,
        x: &[SVector<T, NX>; POINTS],
        u: &[SVector<T, NU>; POINTS],
        tangents: &mut [Tangent<T, NX, NU>; POINTS],
    ) {
        for (i, tangent) in tangents.iter_mut().enumerate() {
            *tangent = self.tangent(&x[i], &u[i]);
        }
    }

    /// f with the matrices that it is made of, (f, A(s), B(s)), at several points, into places of theirs, of a plant that
    /// has them cheaper together than one by one; the same numbers, to rounding. `false` of any other plant.
    #[inline(always)]
    fn embedded_each<T: Scalar + Number, const POINTS: usize>(
        &self,
        x: &[SVector<T, NX>; POINTS],
        u: &[SVector<T, NU>; POINTS],
        tangents: &mut [Tangent<T, NX, NU>; POINTS],
    ) -> bool {
        let _ = (x, u, tangents);
        false
    }

    /// See [`LpvModel::a_times`].
    #[inline(always)]
    fn a_times<T: Scalar, const C: usize>(
        &self,
        a: &SMatrix<T, NX, NX>,
        v: &SMatrix<T, NX, C>,
    ) -> SMatrix<T, NX, C> {
        product(a, v)
    }

    /// See [`LpvModel::steady_state`].
    fn steady_state<T: Scalar + Number>(
        &self,
        problem: &SteadyStateProblem<T, NX, NU>,
    ) -> Option<SteadyState<T, NX, NU>>
    where
        Self: Sized,
    {
        steady_state::nearest(self, problem)
    }
}

impl<P, T, const NX: usize, const NU: usize, const NS: usize> LpvModel<T, NX, NU, NS> for P
where
    T: Scalar + Number,
    P: Embedding<NX, NU, NS>,
{
    #[inline(always)]
    fn period(&self) -> Option<T> {
        Embedding::period(self).map(convert)
    }

    #[inline(always)]
    fn scheduling(&self, x: &SVector<T, NX>, u: &SVector<T, NU>) -> SVector<T, NS> {
        Embedding::scheduling(self, x, u)
    }

    #[inline(always)]
    fn matrices(&self, scheduling: &SVector<T, NS>) -> (SMatrix<T, NX, NX>, SMatrix<T, NX, NU>) {
        Embedding::matrices(self, scheduling)
    }

    #[inline(always)]
    fn offset(&self, scheduling: &SVector<T, NS>) -> Option<SVector<T, NX>> {
        Embedding::offset(self, scheduling)
    }

    #[inline(always)]
    fn a_times<const C: usize>(
        &self,
        a: &SMatrix<T, NX, NX>,
        v: &SMatrix<T, NX, C>,
    ) -> SMatrix<T, NX, C> {
        Embedding::a_times(self, a, v)
    }

    #[inline(always)]
    fn derivative(&self, x: &SVector<T, NX>, u: &SVector<T, NU>) -> SVector<T, NX> {
        self.f(x, u)
    }

    #[inline(always)]
    fn jacobian(
        &self,
        x: &SVector<T, NX>,
        u: &SVector<T, NU>,
    ) -> (SMatrix<T, NX, NX>, SMatrix<T, NX, NU>) {
        let (_, a, b) = Embedding::tangent(self, x, u);
        (a, b)
    }

    #[inline(always)]
    fn tangent(&self, x: &SVector<T, NX>, u: &SVector<T, NU>) -> Tangent<T, NX, NU> {
        Embedding::tangent(self, x, u)
    }

    #[inline(always)]
    fn embedded(&self, x: &SVector<T, NX>, u: &SVector<T, NU>) -> Tangent<T, NX, NU> {
        let mut embedded = [(SVector::zeros(), SMatrix::zeros(), SMatrix::zeros())];
        if Embedding::embedded_each(self, &[*x], &[*u], &mut embedded) {
            let [embedded] = embedded;
            return embedded;
        }
        embedded_by_products(self, x, u)
    }

    const TOGETHER: bool = P::TOGETHER;

    #[inline(always)]
    fn embedded_each<const POINTS: usize>(
        &self,
        x: &[SVector<T, NX>; POINTS],
        u: &[SVector<T, NU>; POINTS],
        tangents: &mut [Tangent<T, NX, NU>; POINTS],
    ) {
        if !Embedding::embedded_each(self, x, u, tangents) {
            for (i, tangent) in tangents.iter_mut().enumerate() {
                *tangent = embedded_by_products(self, &x[i], &u[i]);
            }
        }
    }

    #[inline(always)]
    fn tangent_each<const POINTS: usize>(
        &self,
        x: &[SVector<T, NX>; POINTS],
        u: &[SVector<T, NU>; POINTS],
        tangents: &mut [Tangent<T, NX, NU>; POINTS],
    ) {
        Embedding::tangent_each(self, x, u, tangents);
    }

    fn steady_state(
        &self,
        problem: &SteadyStateProblem<T, NX, NU>,
    ) -> Option<SteadyState<T, NX, NU>> {
        Embedding::steady_state(self, problem)
    }
}

/// A plant that is known by its f alone, written once for every kind of [`Number`].
///
/// [`AlongMotion`](crate::AlongMotion) and [`AlongRay`](crate::AlongRay) make an [`LpvModel`] of it.
pub trait Dynamics<const NX: usize, const NU: usize> {
    /// See [`LpvModel::period`], s.
    #[inline(always)]
    fn period(&self) -> Option<f64> {
        None
    }

    /// x_dot = f(x, u), in state units per second; with a [`period`](Self::period) x+ = F(x, u), in state units.
    fn f<N: Number>(&self, x: &SVector<N, NX>, u: &SVector<N, NU>) -> SVector<N, NX>;

    /// See [`LpvModel::TOGETHER`].
    const TOGETHER: bool = false;

    /// f with its derivatives at several points, into places of theirs, of a plant that has them cheaper than by dual
    /// numbers; the same numbers, to rounding. `false` of any other plant.
    #[inline(always)]
    fn tangent_each<T: Scalar + Number, const POINTS: usize>(
        &self,
        x: &[SVector<T, NX>; POINTS],
        u: &[SVector<T, NU>; POINTS],
        tangents: &mut [Tangent<T, NX, NU>; POINTS],
    ) -> bool {
        let _ = (x, u, tangents);
        false
    }
}

impl<P: Dynamics<NX, NU>, const NX: usize, const NU: usize> Dynamics<NX, NU> for &P {
    #[inline(always)]
    fn period(&self) -> Option<f64> {
        P::period(self)
    }

    #[inline(always)]
    fn f<N: Number>(&self, x: &SVector<N, NX>, u: &SVector<N, NU>) -> SVector<N, NX> {
        P::f(self, x, u)
    }

    const TOGETHER: bool = P::TOGETHER;

    #[inline(always)]
    fn tangent_each<T: Scalar + Number, const POINTS: usize>(
        &self,
        x: &[SVector<T, NX>; POINTS],
        u: &[SVector<T, NU>; POINTS],
        tangents: &mut [Tangent<T, NX, NU>; POINTS],
    ) -> bool {
        P::tangent_each(self, x, u, tangents)
    }
}

/// (f, df/dx, df/du) at `x` and `u` by two passes of dual numbers: one for the states, one for the inputs. `by_x` and
/// `by_u` are f of these.
#[inline(always)]
pub fn tangent_by_duals<T: Scalar + Number, const NX: usize, const NU: usize>(
    x: &SVector<T, NX>,
    u: &SVector<T, NU>,
    by_x: impl Fn(&SVector<Dual<T, NX>, NX>, &SVector<Dual<T, NX>, NU>) -> SVector<Dual<T, NX>, NX>,
    by_u: impl Fn(&SVector<Dual<T, NU>, NX>, &SVector<Dual<T, NU>, NU>) -> SVector<Dual<T, NU>, NX>,
) -> Tangent<T, NX, NU> {
    let along_x = by_x(&Dual::variables(x), &u.map(Dual::fixed));
    let along_u = by_u(&x.map(Dual::fixed), &Dual::variables(u));
    (
        along_x.map(|rate| rate.value),
        slopes(&along_x),
        slopes(&along_u),
    )
}

/// The derivatives of each of R numbers as the rows of a matrix.
#[inline(always)]
fn slopes<T: Scalar, const R: usize, const D: usize>(
    numbers: &SVector<Dual<T, D>, R>,
) -> SMatrix<T, R, D> {
    let mut matrix = SMatrix::zeros();
    for (i, number) in numbers.iter().enumerate() {
        for (j, slope) in number.slopes.iter().enumerate() {
            matrix[(i, j)] = *slope;
        }
    }
    matrix
}
