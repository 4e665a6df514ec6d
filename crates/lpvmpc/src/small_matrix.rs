//! Products and sums of small matrices, written so that the compiler unrolls and vectorises them
//! along columns, and so that they are plain loops where it optimises for size.
//!
//! nalgebra's own `tr_mul` takes one dot product per entry, which does not vectorise without
//! reassociation; a transpose and a product by columns does.

use crate::model::Scalar;
use nalgebra::{SMatrix, SVector};

/// A B
#[inline(always)]
pub(crate) fn product<T: Scalar, const R: usize, const K: usize, const C: usize>(
    a: &SMatrix<T, R, K>,
    b: &SMatrix<T, K, C>,
) -> SMatrix<T, R, C> {
    let mut out = SMatrix::zeros();
    set_product(&mut out, a, b);
    out
}

/// out = A B
#[inline(always)]
pub(crate) fn set_product<T: Scalar, const R: usize, const K: usize, const C: usize>(
    out: &mut SMatrix<T, R, C>,
    a: &SMatrix<T, R, K>,
    b: &SMatrix<T, K, C>,
) {
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

/// out += a factor b'. Columns where b is zero are left out.
#[inline(always)]
pub(crate) fn add_outer_product<T: Scalar, const R: usize, const C: usize>(
    out: &mut SMatrix<T, R, C>,
    a: &SVector<T, R>,
    factor: T,
    b: &SVector<T, C>,
) {
    for (out, b) in out.data.0.iter_mut().zip(&b.data.0[0]) {
        if *b != T::zero() {
            let factor = *b * factor;
            for (out, a) in out.iter_mut().zip(&a.data.0[0]) {
                *out += *a * factor;
            }
        }
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
    product(&transposed(a), b)
}

/// A' v, each entry in two sums side by side: where one product waits for another, half the way is half the
/// time.
#[inline(always)]
pub(crate) fn transposed_times<T: Scalar, const R: usize, const C: usize>(
    a: &SMatrix<T, R, C>,
    v: &SVector<T, R>,
) -> SVector<T, C> {
    let mut out = SVector::zeros();
    if !cfg!(feature = "alloc") {
        // A microcontroller has neither the registers for two sums nor units that would wait.
        for (out, column) in out.data.0[0].iter_mut().zip(&a.data.0) {
            for (a, v) in column.iter().zip(&v.data.0[0]) {
                *out += *a * *v;
            }
        }
        return out;
    }
    let (pairs, last) = v.data.0[0].as_chunks::<2>();
    for (out, column) in out.data.0[0].iter_mut().zip(&a.data.0) {
        let (columns, rest) = column.as_chunks::<2>();
        let mut sums = [T::zero(); 2];
        for (a, v) in columns.iter().zip(pairs) {
            for ((sum, a), v) in sums.iter_mut().zip(a).zip(v) {
                *sum += *a * *v;
            }
        }
        for (a, v) in rest.iter().zip(last) {
            sums[0] += *a * *v;
        }
        *out = sums[0] + sums[1];
    }
    out
}

/// |A'| |v|: the sizes of what adds up to A' v.
#[inline(always)]
pub(crate) fn transposed_sizes<T: Scalar, const R: usize, const C: usize>(
    a: &SMatrix<T, R, C>,
    v: &SVector<T, R>,
) -> SVector<T, C> {
    let mut out = SVector::zeros();
    for (out, column) in out.data.0[0].iter_mut().zip(&a.data.0) {
        for (a, v) in column.iter().zip(&v.data.0[0]) {
            *out += (*a * *v).abs();
        }
    }
    out
}

/// |A| |v|: the sizes of what adds up to A v.
#[inline(always)]
pub(crate) fn sizes_of_product<T: Scalar, const R: usize, const C: usize>(
    a: &SMatrix<T, R, C>,
    v: &SVector<T, C>,
) -> SVector<T, R> {
    let mut out = SVector::zeros();
    for (a, v) in a.data.0.iter().zip(&v.data.0[0]) {
        for (out, a) in out.data.0[0].iter_mut().zip(a) {
            *out += (*a * *v).abs();
        }
    }
    out
}

/// The size of the largest entry. nalgebra's own, with its `abs`, takes a tenth of the time of a guess with 16 states.
#[inline(always)]
pub(crate) fn largest<T: Scalar, const R: usize>(v: &SVector<T, R>) -> T {
    let sizes = v.data.0[0].iter().map(|entry| entry.abs());
    sizes.fold(T::zero(), |most, size| most.max(size))
}

/// A'
#[inline(always)]
pub(crate) fn transposed<T: Scalar, const R: usize, const C: usize>(
    a: &SMatrix<T, R, C>,
) -> SMatrix<T, C, R> {
    let mut out = SMatrix::zeros();
    for (i, a) in a.data.0.iter().enumerate() {
        for (out, a) in out.data.0.iter_mut().zip(a) {
            out[i] = *a;
        }
    }
    out
}

/// Rows and columns of a tile of a symmetric product.
const TILE: usize = 4;

/// out += A B, a product that is symmetric: above the diagonal it may be left as it is, see [`mirror`].
#[inline(always)]
pub(crate) fn add_symmetric_product<T: Scalar, const R: usize, const K: usize>(
    out: &mut SMatrix<T, R, R>,
    a: &SMatrix<T, R, K>,
    b: &SMatrix<T, K, R>,
) {
    // In small matrices half of the products are not worth telling them apart.
    if R <= TILE || !R.is_multiple_of(TILE) {
        add_product(out, a, b);
        return;
    }
    for column in (0..R).step_by(TILE) {
        for row in (column..R).step_by(TILE) {
            add_tile(out, a, b, row, column);
        }
    }
}

/// The tile of out += A B whose first entry is at `row` and `column`.
#[inline(always)]
fn add_tile<T: Scalar, const R: usize, const K: usize>(
    out: &mut SMatrix<T, R, R>,
    a: &SMatrix<T, R, K>,
    b: &SMatrix<T, K, R>,
    row: usize,
    column: usize,
) {
    let mut sums = [[T::zero(); TILE]; TILE];
    let columns = b.data.0.get(column..).and_then(|b| b.first_chunk::<TILE>());
    let Some(columns) = columns else {
        return;
    };
    let out = out.data.0.get_mut(column..).unwrap_or_default();
    for (sums, out) in sums.iter_mut().zip(out.iter()) {
        for (sum, out) in sums.iter_mut().zip(out.get(row..).unwrap_or_default()) {
            *sum = *out;
        }
    }
    for (k, a) in a.data.0.iter().enumerate() {
        let Some(a) = a.get(row..).and_then(|a| a.first_chunk::<TILE>()) else {
            return;
        };
        for (sums, b) in sums.iter_mut().zip(columns) {
            for (sum, a) in sums.iter_mut().zip(a) {
                *sum += *a * b[k];
            }
        }
    }
    for (out, sums) in out.iter_mut().zip(&sums) {
        let out = out.get_mut(row..).unwrap_or_default();
        for (out, sum) in out.iter_mut().zip(sums) {
            *out = *sum;
        }
    }
}

/// Makes the matrix symmetric by what is below its diagonal.
#[inline(always)]
pub(crate) fn mirror<T: Scalar, const K: usize>(m: &mut SMatrix<T, K, K>) {
    for j in 1..K {
        for i in 0..j {
            m.data.0[j][i] = m.data.0[i][j];
        }
    }
}
