//! Products and sums of small matrices, written so that the compiler unrolls and vectorises them
//! along columns, and so that they are plain loops where it optimises for size.
//!
//! nalgebra's own `tr_mul` takes one dot product per entry, which does not vectorise without
//! reassociation; a transpose and a product by columns does.

use crate::model::Scalar;
use nalgebra::SMatrix;

/// A B
#[inline(always)]
pub(crate) fn product<T: Scalar, const R: usize, const K: usize, const C: usize>(
    a: &SMatrix<T, R, K>,
    b: &SMatrix<T, K, C>,
) -> SMatrix<T, R, C> {
    let mut out = SMatrix::<T, R, C>::zeros();
    for (out, b) in out.data.0.iter_mut().zip(&b.data.0) {
        // The first term is assigned, not added to zero: that addition could not be left out.
        let mut terms = a.data.0.iter().zip(b);
        if let Some((a, factor)) = terms.next() {
            for (out, a) in out.iter_mut().zip(a) {
                *out = *a * *factor;
            }
        }
        for (a, factor) in terms {
            for (out, a) in out.iter_mut().zip(a) {
                *out += *a * *factor;
            }
        }
    }
    out
}

/// out += A B
#[inline(always)]
pub(crate) fn add_product<T: Scalar, const R: usize, const K: usize, const C: usize>(
    out: &mut SMatrix<T, R, C>,
    a: &SMatrix<T, R, K>,
    b: &SMatrix<T, K, C>,
) {
    for (out, b) in out.data.0.iter_mut().zip(&b.data.0) {
        for (a, factor) in a.data.0.iter().zip(b) {
            for (out, a) in out.iter_mut().zip(a) {
                *out += *a * *factor;
            }
        }
    }
}

/// out *= factor
#[inline(always)]
pub(crate) fn scale<T: Scalar, const R: usize, const C: usize>(
    out: &mut SMatrix<T, R, C>,
    factor: T,
) {
    for out in out.data.0.as_flattened_mut() {
        *out *= factor;
    }
}

/// out += A factor
#[inline(always)]
pub(crate) fn add_scaled<T: Scalar, const R: usize, const C: usize>(
    out: &mut SMatrix<T, R, C>,
    a: &SMatrix<T, R, C>,
    factor: T,
) {
    let a = a.data.0.as_flattened();
    for (out, a) in out.data.0.as_flattened_mut().iter_mut().zip(a) {
        *out += *a * factor;
    }
}

/// out = A + out factor
#[inline(always)]
pub(crate) fn extend<T: Scalar, const R: usize, const C: usize>(
    out: &mut SMatrix<T, R, C>,
    a: &SMatrix<T, R, C>,
    factor: T,
) {
    let a = a.data.0.as_flattened();
    for (out, a) in out.data.0.as_flattened_mut().iter_mut().zip(a) {
        *out = *a + *out * factor;
    }
}

/// A' B
#[inline(always)]
pub(crate) fn transposed_product<T: Scalar, const R: usize, const K: usize, const C: usize>(
    a: &SMatrix<T, K, R>,
    b: &SMatrix<T, K, C>,
) -> SMatrix<T, R, C> {
    product(&a.transpose(), b)
}
