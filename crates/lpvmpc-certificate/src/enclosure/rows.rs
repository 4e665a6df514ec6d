//! Matrices given by their rows, of numbers that are enclosures.
//!
//! In loops over slices: a closure that makes an array is compiled anew for every size, and for every caller.

use super::elementary::Arithmetic;
use lpvmpc::Number;

/// The matrix with these entries, by row and column.
pub(crate) fn from_fn<T: Number, const R: usize, const C: usize>(
    mut entry: impl FnMut(usize, usize) -> T,
) -> [[T; C]; R] {
    let mut matrix = [[T::constant(0.0); C]; R];
    for (i, row) in matrix.iter_mut().enumerate() {
        for (j, place) in row.iter_mut().enumerate() {
            *place = entry(i, j);
        }
    }
    matrix
}

/// The product of two matrices.
pub(crate) fn product<T: Arithmetic, const R: usize, const N: usize, const C: usize>(
    a: &[[T; N]; R],
    b: &[[T; C]; N],
) -> [[T; C]; R] {
    let mut product = [[T::constant(0.0); C]; R];
    for (sums, a) in product.iter_mut().zip(a) {
        for (a, b) in a.iter().zip(b) {
            for (sum, b) in sums.iter_mut().zip(b) {
                *sum = sum.plus_product(a, b);
            }
        }
    }
    product
}

/// The rows as columns.
pub(crate) fn transposed<T: Number, const R: usize, const C: usize>(
    m: &[[T; C]; R],
) -> [[T; R]; C] {
    from_fn(|i, j| m[j][i])
}
