//! The exact pair of a constant one over a sample.

use crate::model::Scalar;
use crate::small_matrix::product;
use nalgebra::{SMatrix, convert};

/// The matrix exponential's pair: Taylor polynomials of degree 14 for a step so short that what
/// is left out is below rounding, doubled until the step is `t_s` (Moler and Van Loan, Nineteen
/// dubious ways to compute the exponential of a matrix, 2003, method 3).
// Not inlined, so that the other kinds keep the registers.
#[inline(never)]
pub(super) fn exact_hold<T: Scalar, const NX: usize, const NU: usize>(
    a: &SMatrix<T, NX, NX>,
    b: &SMatrix<T, NX, NU>,
    t_s: T,
) -> (SMatrix<T, NX, NX>, SMatrix<T, NX, NU>) {
    const DEGREE: u32 = 14;
    const MOST_DOUBLINGS: usize = 64;
    let half: T = convert(0.5);
    let mut h = t_s;
    let mut doublings = 0;
    while a.norm() * h > half && doublings < MOST_DOUBLINGS {
        h *= half;
        doublings += 1;
    }
    let m = a * h;
    let mut a_d = SMatrix::identity();
    let mut b_d = *b;
    for k in (1..=DEGREE).rev() {
        a_d = SMatrix::identity() + times(&m, &a_d) / convert::<f64, T>(f64::from(k));
        b_d = b + times(&m, &b_d) / convert::<f64, T>(f64::from(k + 1));
    }
    b_d *= h;
    for _ in 0..doublings {
        b_d += times(&a_d, &b_d);
        a_d = times(&a_d, &a_d);
    }
    (a_d, b_d)
}

/// A B, once in the machine code for each size.
#[inline(never)]
fn times<T: Scalar, const K: usize, const C: usize>(
    a: &SMatrix<T, K, K>,
    b: &SMatrix<T, K, C>,
) -> SMatrix<T, K, C> {
    product(a, b)
}
