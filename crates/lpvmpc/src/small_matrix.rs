//! Products and sums of small matrices, written so that the compiler unrolls and vectorises them
//! along columns, and so that they are plain loops where it optimises for size.
//!
//! nalgebra's own `tr_mul` takes one dot product per entry, which does not vectorise without
//! reassociation; a transpose and a product by columns does.

use crate::model::Scalar;
use nalgebra::{ArrayStorage, SMatrix};

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

/// A B, in blocks.
#[inline(always)]
pub(crate) fn block_product<T: Scalar, const R: usize, const K: usize, const N: usize>(
    a: &SMatrix<T, R, K>,
    b: &SMatrix<T, K, N>,
) -> SMatrix<T, R, N> {
    let columns = core::array::from_fn(|j| {
        let mut out = [T::zero(); R];
        column(&mut out, 0, None, (&a.data.0, &b.data.0[j]), (&[], &[]));
        out
    });
    SMatrix::from_data(ArrayStorage(columns))
}

/// S + A B, in blocks.
#[inline(always)]
pub(crate) fn sum_of_product<T: Scalar, const R: usize, const K: usize, const N: usize>(
    s: &SMatrix<T, R, N>,
    a: &SMatrix<T, R, K>,
    b: &SMatrix<T, K, N>,
) -> SMatrix<T, R, N> {
    sum_of_products(s, (a, b), (&SMatrix::<T, R, 0>::from_data(ArrayStorage([])), &SMatrix::<T, 0, N>::from_data(ArrayStorage([[];N]))))
}

/// S + A B + C D
#[inline(always)]
pub(crate) fn sum_of_products<T: Scalar, const R: usize, const K: usize, const L: usize, const N: usize>(
    s: &SMatrix<T, R, N>,
    (a, b): (&SMatrix<T, R, K>, &SMatrix<T, K, N>),
    (c, d): (&SMatrix<T, R, L>, &SMatrix<T, L, N>),
) -> SMatrix<T, R, N> {
    let columns = core::array::from_fn(|j| {
        let mut out = [T::zero(); R];
        column(&mut out, 0, Some(&s.data.0[j]), (&a.data.0, &b.data.0[j]), (&c.data.0, &d.data.0[j]));
        out
    });
    SMatrix::from_data(ArrayStorage(columns))
}

/// out = S + A B + C D, which is symmetric: the lower triangle is computed.
#[inline(always)]
pub(crate) fn symmetric_sum_of_products<T: Scalar, const R: usize, const K: usize, const L: usize>(
    out: &mut SMatrix<T, R, R>,
    s: &SMatrix<T, R, R>,
    (a, b): (&SMatrix<T, R, K>, &SMatrix<T, K, R>),
    (c, d): (&SMatrix<T, R, L>, &SMatrix<T, L, R>),
) {
    for j in 0..R {
        let from = j & !(if R < 8 { 1 } else { 3 });
        column(&mut out.data.0[j], from, Some(&s.data.0[j]), (&a.data.0, &b.data.0[j]), (&c.data.0, &d.data.0[j]));
    }
    mirror(out);
}

/// Copies the lower triangle into the upper one.
#[inline(always)]
pub(crate) fn mirror<T: Scalar, const R: usize>(m: &mut SMatrix<T, R, R>) {
    let m = &mut m.data.0;
    for j in 1..R {
        for i in 0..j {
            m[j][i] = m[i][j];
        }
    }
}

#[inline(always)]
fn column<T: Scalar, const R: usize, const K: usize, const L: usize>(
    out: &mut [T; R],
    from: usize,
    start: Option<&[T; R]>,
    first: (&[[T; R]; K], &[T; K]),
    second: (&[[T; R]; L], &[T; L]),
) {
    let mut row = from;
    if R % 8 != 0 {
        while row + 12 <= R {
            block::<T, 12, R, K, L>(out, row, start, first, second);
            row += 12;
        }
    }
    while row + 8 <= R {
        block::<T, 8, R, K, L>(out, row, start, first, second);
        row += 8;
    }
    if row + 4 <= R {
        block::<T, 4, R, K, L>(out, row, start, first, second);
        row += 4;
    }
    if row + 2 <= R {
        block::<T, 2, R, K, L>(out, row, start, first, second);
        row += 2;
    }
    if row < R {
        block::<T, 1, R, K, L>(out, row, start, first, second);
    }
}

#[inline(always)]
fn block<T: Scalar, const H: usize, const R: usize, const K: usize, const L: usize>(
    out: &mut [T; R],
    row: usize,
    start: Option<&[T; R]>,
    first: (&[[T; R]; K], &[T; K]),
    second: (&[[T; R]; L], &[T; L]),
) {
    let Some(out) = out.get_mut(row..).and_then(<[T]>::first_chunk_mut::<H>) else {
        return;
    };
    let mut sum = [T::zero(); H];
    if let Some(start) = start.and_then(|s| part(s, row)) {
        sum = *start;
    }
    add(&mut sum, row, start.is_none(), first);
    add(&mut sum, row, false, second);
    *out = sum;
}

#[inline(always)]
fn add<T: Scalar, const H: usize, const R: usize, const K: usize>(
    sum: &mut [T; H],
    row: usize,
    assign: bool,
    (a, b): (&[[T; R]; K], &[T; K]),
) {
    for (k, (a, b)) in a.iter().zip(b).enumerate() {
        let Some(a) = part::<T, H, R>(a, row) else {
            return;
        };
        for (entry, a) in sum.iter_mut().zip(a) {
            if assign && k == 0 {
                *entry = *a * *b;
            } else {
                *entry += *a * *b;
            }
        }
    }
}

#[inline(always)]
fn part<T, const H: usize, const R: usize>(column: &[T; R], row: usize) -> Option<&[T; H]> {
    column.get(row..)?.first_chunk()
}
