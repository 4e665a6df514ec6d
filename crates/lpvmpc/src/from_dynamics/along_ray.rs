//! Linear models about a steady state, by the fundamental theorem of calculus.

use super::{GaussLegendre, joined, parted, tangent, tangent_each};
use crate::embedding::{Dynamics, Tangent};
use crate::model::{LpvModel, Scalar};
use crate::number::Number;
use crate::small_matrix::{add_scaled, product};
use nalgebra::{SMatrix, SVector, convert};

/// The linear models of a plant about a point (x_r, u_r), such as a steady state: the mean
/// derivatives of f along the ray from there to the scheduling (x, u),
///
/// ```text
/// A = integral over lambda from 0 to 1 of df/dx(x_r + lambda (x - x_r), u_r + lambda (u - u_r))
/// ```
///
/// and B the same of df/du. By the fundamental theorem of calculus
/// f(x, u) = f(x_r, u_r) + A (x - x_r) + B (u - u_r): an embedding that nobody had to factorise, whose A
/// and B say how the plant comes back from (x, u) to (x_r, u_r), where its derivatives at (x, u) say what
/// it does next to (x, u). The integral is a sum over the nodes of a [`GaussLegendre`] formula; what that leaves
/// goes into c = f - A x - B u, so the model is exact at (x, u) whatever their number.
/// `lpvmpc_design::nodes_along_ray` says how many are enough.
///
/// `NS` is the number of scheduling parameters, that of states and inputs together. Any other number
/// does not compile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AlongRay<P, T: Scalar, const NX: usize, const NU: usize, const NS: usize> {
    /// The plant.
    pub plant: P,
    /// x_r, in state units.
    pub x: SVector<T, NX>,
    /// u_r, in input units.
    pub u: SVector<T, NU>,
    /// Where on the ray the derivatives are taken.
    pub nodes: GaussLegendre,
}

impl<P, T, const NX: usize, const NU: usize, const NS: usize> AlongRay<P, T, NX, NU, NS>
where
    T: Scalar + Number,
    P: Dynamics<NX, NU>,
{
    /// A and B for the ray to (x, u).
    fn mean(
        &self,
        x: &SVector<T, NX>,
        u: &SVector<T, NU>,
    ) -> (SMatrix<T, NX, NX>, SMatrix<T, NX, NU>) {
        let mut means = [(*x, SMatrix::zeros(), SMatrix::zeros())];
        self.mean_each(&[*x], &[*u], &mut means);
        let [(_, a, b)] = means;
        (a, b)
    }

    /// The same for rays to several points, into the matrices of `means`.
    fn mean_each<const POINTS: usize>(
        &self,
        x: &[SVector<T, NX>; POINTS],
        u: &[SVector<T, NU>; POINTS],
        means: &mut [Tangent<T, NX, NU>; POINTS],
    ) {
        for (_, a, b) in means.iter_mut() {
            (*a, *b) = (SMatrix::zeros(), SMatrix::zeros());
        }
        let mut tangents = *means;
        for (place, weight) in self.nodes.iter() {
            let (place, weight): (T, T) = (convert(place), convert(weight));
            let x = x.map(|x| self.x + (x - self.x) * place);
            let u = u.map(|u| self.u + (u - self.u) * place);
            tangent_each::<_, _, NX, NU, NS, POINTS>(&self.plant, &x, &u, &mut tangents);
            for ((_, a, b), (_, by_x, by_u)) in means.iter_mut().zip(&tangents) {
                add_scaled(a, by_x, weight);
                add_scaled(b, by_u, weight);
            }
        }
    }
}

impl<P, T, const NX: usize, const NU: usize, const NS: usize> LpvModel<T, NX, NU, NS>
    for AlongRay<P, T, NX, NU, NS>
where
    T: Scalar + Number,
    P: Dynamics<NX, NU>,
{
    #[inline(always)]
    fn period(&self) -> Option<T> {
        self.plant.period().map(convert)
    }

    /// (x, u).
    fn scheduling(&self, x: &SVector<T, NX>, u: &SVector<T, NU>) -> SVector<T, NS> {
        joined(x, u)
    }

    fn matrices(&self, scheduling: &SVector<T, NS>) -> (SMatrix<T, NX, NX>, SMatrix<T, NX, NU>) {
        let (x, u) = parted(scheduling);
        self.mean(&x, &u)
    }

    fn offset(&self, scheduling: &SVector<T, NS>) -> Option<SVector<T, NX>> {
        let (x, u) = parted(scheduling);
        let (rate, a, b) = self.embedded(&x, &u);
        Some(rate - product(&a, &x) - product(&b, &u))
    }

    fn embedded(&self, x: &SVector<T, NX>, u: &SVector<T, NU>) -> Tangent<T, NX, NU> {
        let (a, b) = self.mean(x, u);
        (self.plant.f(x, u), a, b)
    }

    fn derivative(&self, x: &SVector<T, NX>, u: &SVector<T, NU>) -> SVector<T, NX> {
        self.plant.f(x, u)
    }

    fn jacobian(
        &self,
        x: &SVector<T, NX>,
        u: &SVector<T, NU>,
    ) -> (SMatrix<T, NX, NX>, SMatrix<T, NX, NU>) {
        let (_, a, b) = self.tangent(x, u);
        (a, b)
    }

    fn tangent(&self, x: &SVector<T, NX>, u: &SVector<T, NU>) -> Tangent<T, NX, NU> {
        tangent::<_, _, NX, NU, NS>(&self.plant, x, u)
    }

    const TOGETHER: bool = P::TOGETHER;

    fn embedded_each<const POINTS: usize>(
        &self,
        x: &[SVector<T, NX>; POINTS],
        u: &[SVector<T, NU>; POINTS],
        tangents: &mut [Tangent<T, NX, NU>; POINTS],
    ) {
        self.mean_each(x, u, tangents);
        for (i, (rate, ..)) in tangents.iter_mut().enumerate() {
            *rate = self.plant.f(&x[i], &u[i]);
        }
    }

    fn tangent_each<const POINTS: usize>(
        &self,
        x: &[SVector<T, NX>; POINTS],
        u: &[SVector<T, NU>; POINTS],
        tangents: &mut [Tangent<T, NX, NU>; POINTS],
    ) {
        tangent_each::<_, _, NX, NU, NS, POINTS>(&self.plant, x, u, tangents);
    }

    fn has_offset(&self) -> bool {
        true
    }
}
