//! Products and sums of small matrices, written so that the compiler unrolls and vectorises them
//! along columns, and so that they are plain loops where it optimises for size.
//!
//! nalgebra's own `tr_mul` takes one dot product per entry, which does not vectorise without
//! reassociation; a transpose and a product by columns does. A product of larger matrices goes through
//! its columns in blocks of rows whose sums stay in vector registers.

use crate::model::Scalar;
use nalgebra::SMatrix;

/// The columns A and the column b of a product A b.
type Factors<'a, T, const R: usize, const K: usize> = (&'a [[T; R]; K], &'a [T; K]);

/// A B
#[inline(always)]
pub(crate) fn product<T: Scalar, const R: usize, const K: usize, const C: usize>(
    a: &SMatrix<T, R, K>,
    b: &SMatrix<T, K, C>,
) -> SMatrix<T, R, C> {
    let mut out = SMatrix::<T, R, C>::zeros();
    for (out, b) in out.data.0.iter_mut().zip(&b.data.0) {
        fill(out, 0, None, (&a.data.0, b), (&[], &[]));
    }
    out
}

/// S + A B
#[inline(always)]
pub(crate) fn plus_product<T: Scalar, const R: usize, const K: usize, const C: usize>(
    s: &SMatrix<T, R, C>,
    a: &SMatrix<T, R, K>,
    b: &SMatrix<T, K, C>,
) -> SMatrix<T, R, C> {
    let mut out = SMatrix::<T, R, C>::zeros();
    let columns = s.data.0.iter().zip(&b.data.0);
    for (out, (s, b)) in out.data.0.iter_mut().zip(columns) {
        fill(out, 0, Some(s), (&a.data.0, b), (&[], &[]));
    }
    out
}

/// out = S + A B + C D, where that is symmetric: little more than the lower triangle is computed.
#[inline(always)]
pub(crate) fn symmetric_sum<T: Scalar, const R: usize, const K: usize, const L: usize>(
    out: &mut SMatrix<T, R, R>,
    s: &SMatrix<T, R, R>,
    (a, b): (&SMatrix<T, R, K>, &SMatrix<T, K, R>),
    (c, d): (&SMatrix<T, R, L>, &SMatrix<T, L, R>),
) {
    // Where the rows of a column begin: whole vectors of few rows, whole blocks of many.
    let step = if R < 8 { 2 } else { 4 };
    let factors = b.data.0.iter().zip(&d.data.0);
    let columns = s.data.0.iter().zip(factors).enumerate();
    for (out, (j, (s, (b, d)))) in out.data.0.iter_mut().zip(columns) {
        let from = j - j % step;
        fill(out, from, Some(s), (&a.data.0, b), (&c.data.0, d));
    }
    for j in 1..R {
        for i in 0..j {
            out[(i, j)] = out[(j, i)];
        }
    }
}

/// The rows of `out` from `from` on: those of s + A b + C d, in blocks of rows. A vector register has
/// room for two numbers at least, and there are 16.
#[inline(always)]
fn fill<T: Scalar, const R: usize, const K: usize, const L: usize>(
    out: &mut [T; R],
    from: usize,
    s: Option<&[T; R]>,
    ab: Factors<'_, T, R, K>,
    cd: Factors<'_, T, R, L>,
) {
    let mut row = from;
    // The taller a block, the fewer instructions; but 12 and 4 rows are slower than twice 8.
    if !R.is_multiple_of(8) {
        while row + 12 <= R {
            fill_block::<T, 12, R, K, L>(out, row, s, ab, cd);
            row += 12;
        }
    }
    while row + 8 <= R {
        fill_block::<T, 8, R, K, L>(out, row, s, ab, cd);
        row += 8;
    }
    if row + 4 <= R {
        fill_block::<T, 4, R, K, L>(out, row, s, ab, cd);
        row += 4;
    }
    if row + 2 <= R {
        fill_block::<T, 2, R, K, L>(out, row, s, ab, cd);
        row += 2;
    }
    if row < R {
        fill_block::<T, 1, R, K, L>(out, row, s, ab, cd);
    }
}

/// [`fill`] for `H` rows from `row` on.
#[inline(always)]
fn fill_block<T: Scalar, const H: usize, const R: usize, const K: usize, const L: usize>(
    out: &mut [T; R],
    row: usize,
    s: Option<&[T; R]>,
    ab: Factors<'_, T, R, K>,
    cd: Factors<'_, T, R, L>,
) {
    let Some(out) = out.get_mut(row..).and_then(<[T]>::first_chunk_mut::<H>) else {
        return;
    };
    let start = s.and_then(|s| rows(s, row));
    let mut sum = start.copied().unwrap_or([T::zero(); H]);
    // A first term is assigned, not added to zero: that addition could not be left out.
    add_rows(&mut sum, row, start.is_none(), ab);
    add_rows(&mut sum, row, false, cd);
    *out = sum;
}

/// `sum` += the rows from `row` on of A b; or = if it is to be assigned.
#[inline(always)]
fn add_rows<T: Scalar, const H: usize, const R: usize, const K: usize>(
    sum: &mut [T; H],
    row: usize,
    assign: bool,
    (a, b): Factors<'_, T, R, K>,
) {
    for (k, (a, factor)) in a.iter().zip(b).enumerate() {
        let Some(a) = rows::<T, H, R>(a, row) else {
            return;
        };
        for (sum, a) in sum.iter_mut().zip(a) {
            if assign && k == 0 {
                *sum = *a * *factor;
            } else {
                *sum += *a * *factor;
            }
        }
    }
}

/// `H` entries of `column` from `row` on.
#[inline(always)]
fn rows<T, const H: usize, const R: usize>(column: &[T; R], row: usize) -> Option<&[T; H]> {
    column.get(row..)?.first_chunk()
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
