//! How the products of a backward step are worked out: as the compiler has them, or in the machine's widest
//! vectors, where it has them and matrices are large.

#[cfg(feature = "simd")]
mod vectors;

use crate::model::Scalar;
use crate::small_matrix;
use nalgebra::SMatrix;
#[cfg(feature = "simd")]
pub(crate) use vectors::{Vectors, dispatch};

/// From so many states on, the machine's widest vectors pay.
const WIDE: usize = 6;

/// Whether products with columns of so many `states` are worked out in the machine's widest vectors.
#[inline(always)]
pub(crate) const fn are_in_vectors(states: usize) -> bool {
    cfg!(feature = "simd") && states >= WIDE
}

/// Does the `work`, such as a pass along the horizon, compiled for vectors of 256 bits where they `pay` and the machine has them.
/// The closure, and whatever it calls that is to be compiled for them, must be `#[inline(always)]`.
#[inline(always)]
pub(crate) fn in_vectors<O>(pay: bool, work: impl FnOnce() -> O) -> O {
    #[cfg(all(feature = "simd", target_arch = "x86_64"))]
    if pay && let Some(simd) = pulp::x86::V3::try_new() {
        return pulp::Simd::vectorize(simd, work);
    }
    let _ = pay;
    work()
}

/// The products of a backward step.
pub(crate) trait Products: Copy {
    /// out = A B
    fn set_product<T: Scalar, const R: usize, const K: usize, const C: usize>(
        self,
        out: &mut SMatrix<T, R, C>,
        a: &SMatrix<T, R, K>,
        b: &SMatrix<T, K, C>,
    );

    /// A B
    #[inline(always)]
    fn product<T: Scalar, const R: usize, const K: usize, const C: usize>(
        self,
        a: &SMatrix<T, R, K>,
        b: &SMatrix<T, K, C>,
    ) -> SMatrix<T, R, C> {
        let mut out = SMatrix::zeros();
        self.set_product(&mut out, a, b);
        out
    }

    /// out = `addend` + A B + C D, a sum that is symmetric: what is above the diagonal may be left as it was, see
    /// [`mirror`](small_matrix::mirror).
    fn set_symmetric_sum<T: Scalar, const R: usize, const K: usize, const L: usize>(
        self,
        out: &mut SMatrix<T, R, R>,
        addend: &SMatrix<T, R, R>,
        first: (&SMatrix<T, R, K>, &SMatrix<T, K, R>),
        second: (&SMatrix<T, R, L>, &SMatrix<T, L, R>),
    );
}

/// As the compiler has them.
#[derive(Clone, Copy)]
pub(crate) struct Compiled;

impl Products for Compiled {
    #[inline(always)]
    fn set_product<T: Scalar, const R: usize, const K: usize, const C: usize>(
        self,
        out: &mut SMatrix<T, R, C>,
        a: &SMatrix<T, R, K>,
        b: &SMatrix<T, K, C>,
    ) {
        small_matrix::set_product(out, a, b);
    }

    #[inline(always)]
    fn set_symmetric_sum<T: Scalar, const R: usize, const K: usize, const L: usize>(
        self,
        out: &mut SMatrix<T, R, R>,
        addend: &SMatrix<T, R, R>,
        (a, b): (&SMatrix<T, R, K>, &SMatrix<T, K, R>),
        (c, d): (&SMatrix<T, R, L>, &SMatrix<T, L, R>),
    ) {
        *out = *addend;
        small_matrix::add_symmetric_product(out, a, b);
        small_matrix::add_symmetric_product(out, c, d);
    }
}
