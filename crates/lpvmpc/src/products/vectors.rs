//! Products in vectors, block by block: the sums of a block stay in registers, and are so many that none waits
//! for the one before it. A sum has the terms of [`small_matrix`] in the same order; where the machine multiplies and
//! adds in one instruction, a term is rounded once, not twice.

use super::Products;
use crate::model::Scalar;
use crate::small_matrix;
use core::any::Any;
use nalgebra::SMatrix;
use pulp::{Arch, Simd, WithSimd};

/// In the vectors of `S`, of numbers in `f64`, where columns fill two of them; else as the compiler has them.
#[derive(Clone, Copy)]
pub(crate) struct Vectors<S>(pub S);

/// Does the `work` in the widest vectors of the machine that are good for columns of `R` numbers.
#[inline(always)]
pub(crate) fn dispatch<const R: usize, W: WithSimd>(work: W) -> W::Output {
    #[cfg(target_arch = "x86_64")]
    if !R.is_multiple_of(WIDEST) {
        return match pulp::x86::V3::try_new() {
            Some(simd) => Simd::vectorize(simd, work),
            None => Simd::vectorize(pulp::Scalar::new(), work),
        };
    }
    Arch::new().dispatch(work)
}

/// Vectors of 512 bits are for columns that fill two of them: others would be left to a rest of single numbers.
#[cfg(target_arch = "x86_64")]
const WIDEST: usize = 16;

/// With fewer numbers in a vector there is nothing to be gained.
const LANES: usize = 4;

/// Columns of a block; the larger where it divides all of them.
const FEW: usize = 4;
const MORE: usize = 6;
/// With so few columns there are too few sums.
const TOO_FEW: usize = 2;

impl<S: Simd> Products for Vectors<S> {
    #[inline(always)]
    fn set_product<T: Scalar, const R: usize, const K: usize, const C: usize>(
        self,
        out: &mut SMatrix<T, R, C>,
        a: &SMatrix<T, R, K>,
        b: &SMatrix<T, K, C>,
    ) {
        if fills::<S>(R)
            && C > TOO_FEW
            && let Some((out, a, b)) = in_f64(out, a, b)
        {
            multiply(self.0, out, a, b);
        } else {
            small_matrix::set_product(out, a, b);
        }
    }

    #[inline(always)]
    fn add_symmetric_product<T: Scalar, const R: usize, const K: usize>(
        self,
        out: &mut SMatrix<T, R, R>,
        a: &SMatrix<T, R, K>,
        b: &SMatrix<T, K, R>,
    ) {
        if fills::<S>(R)
            && R.is_multiple_of(S::F64_LANES)
            && let Some((out, a, b)) = in_f64(out, a, b)
        {
            add_below_diagonal(self.0, out, a, b);
        } else {
            small_matrix::add_symmetric_product(out, a, b);
        }
    }
}

/// Whether columns of so many `rows` fill two vectors.
#[inline(always)]
fn fills<S: Simd>(rows: usize) -> bool {
    S::F64_LANES >= LANES && rows >= 2 * S::F64_LANES
}

/// A matrix by columns.
type Columns<const R: usize, const C: usize> = [[f64; R]; C];

/// The three matrices where their numbers are `f64`, which the compiler knows.
#[inline(always)]
fn in_f64<'a, T: Scalar, const R: usize, const K: usize, const C: usize>(
    out: &'a mut SMatrix<T, R, C>,
    a: &'a SMatrix<T, R, K>,
    b: &'a SMatrix<T, K, C>,
) -> Option<(&'a mut Columns<R, C>, &'a Columns<R, K>, &'a Columns<K, C>)> {
    let (out, a, b): (&mut dyn Any, &dyn Any, &dyn Any) = (out, a, b);
    let out = &mut out.downcast_mut::<SMatrix<f64, R, C>>()?.data.0;
    let a = &a.downcast_ref::<SMatrix<f64, R, K>>()?.data.0;
    let b = &b.downcast_ref::<SMatrix<f64, K, C>>()?.data.0;
    Some((out, a, b))
}

/// out = A B
#[inline(always)]
fn multiply<S: Simd, const R: usize, const K: usize, const C: usize>(
    simd: S,
    out: &mut Columns<R, C>,
    a: &Columns<R, K>,
    b: &Columns<K, C>,
) {
    let (mut out, mut b) = (&mut out[..], &b[..]);
    if C.is_multiple_of(MORE) {
        (out, b) = multiply_by::<S, MORE, R, K>(simd, out, a, b);
    }
    (out, b) = multiply_by::<S, FEW, R, K>(simd, out, a, b);
    (out, b) = multiply_by::<S, 2, R, K>(simd, out, a, b);
    multiply_by::<S, 1, R, K>(simd, out, a, b);
}

/// The same by `N` columns at a time; the answer is what they leave.
#[inline(always)]
fn multiply_by<'a, S: Simd, const N: usize, const R: usize, const K: usize>(
    simd: S,
    out: &'a mut [[f64; R]],
    a: &Columns<R, K>,
    b: &'a [[f64; K]],
) -> (&'a mut [[f64; R]], &'a [[f64; K]]) {
    let (out, out_rest) = out.as_chunks_mut::<N>();
    let (b, b_rest) = b.as_chunks::<N>();
    let set = |out: &mut S::f64s, sum| *out = sum;
    let whole = R / S::F64_LANES;
    for (out, b) in out.iter_mut().zip(b) {
        add_rows(simd, out, a, b, (0, whole), set);
        // Rows that fill no vector are part of one that begins before them.
        if !R.is_multiple_of(S::F64_LANES) {
            add_block::<S, 1, N, R, K>(simd, out, a, b, (R - S::F64_LANES, 0), set);
        }
    }
    (out_rest, b_rest)
}

/// out += A B on the diagonal and below, whose vectors begin at or before it.
#[inline(always)]
fn add_below_diagonal<S: Simd, const R: usize, const K: usize>(
    simd: S,
    out: &mut Columns<R, R>,
    a: &Columns<R, K>,
    b: &Columns<K, R>,
) {
    let columns = out.as_chunks_mut::<FEW>().0.iter_mut();
    for (i, (out, b)) in columns.zip(b.as_chunks::<FEW>().0).enumerate() {
        let rows = (i * FEW / S::F64_LANES, R / S::F64_LANES);
        add_rows(simd, out, a, b, rows, |out, sum| {
            *out = simd.add_f64s(*out, sum);
        });
    }
}

/// A few columns of A B, added or set in the vectors `first` to `end` of `out`.
#[inline(always)]
fn add_rows<S: Simd, const N: usize, const R: usize, const K: usize>(
    simd: S,
    out: &mut Columns<R, N>,
    a: &Columns<R, K>,
    b: &Columns<K, N>,
    (mut first, end): (usize, usize),
    add: impl Fn(&mut S::f64s, S::f64s) + Copy,
) {
    while first + 2 <= end {
        add_block::<S, 2, N, R, K>(simd, out, a, b, (0, first), add);
        first += 2;
    }
    if first < end {
        add_block::<S, 1, N, R, K>(simd, out, a, b, (0, first), add);
    }
}

/// The same for `M` vectors of each column, from the vector `first` behind `row` on.
#[inline(always)]
fn add_block<S: Simd, const M: usize, const N: usize, const R: usize, const K: usize>(
    simd: S,
    out: &mut Columns<R, N>,
    a: &Columns<R, K>,
    b: &Columns<K, N>,
    (row, first): (usize, usize),
    add: impl Fn(&mut S::f64s, S::f64s),
) {
    let mut sums = [[simd.splat_f64s(0.0); M]; N];
    for (k, a) in a.iter().enumerate() {
        let (a, _) = S::as_simd_f64s(&a[row..]);
        let Some(a) = a.get(first..).and_then(|a| a.first_chunk::<M>()) else {
            return;
        };
        for (sums, b) in sums.iter_mut().zip(b) {
            let factor = simd.splat_f64s(b[k]);
            for (sum, a) in sums.iter_mut().zip(a) {
                *sum = simd.mul_add_e_f64s(*a, factor, *sum);
            }
        }
    }
    for (out, sums) in out.iter_mut().zip(&sums) {
        let (out, _) = S::as_mut_simd_f64s(&mut out[row..]);
        let out = out.get_mut(first..).unwrap_or_default();
        for (out, sum) in out.iter_mut().zip(sums) {
            add(out, *sum);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lpvmpc_testkit::rng::Rng;

    /// The products of random matrices of one size, and what they are to be.
    struct Compare<const R: usize, const K: usize, const C: usize>;

    impl<const R: usize, const K: usize, const C: usize> WithSimd for Compare<R, K, C> {
        type Output = ();

        fn with_simd<S: Simd>(self, simd: S) {
            let mut random = Rng::new(R as u64 * 100 + K as u64);
            let mut number = || random.uniform(-2.0, 2.0);
            let a = SMatrix::<f64, R, K>::from_fn(|_, _| number());
            let b = SMatrix::<f64, K, C>::from_fn(|_, _| number());
            // Each of K terms, of 4 at most, is rounded with the sum so far.
            let rounding = 4.0 * (K * K) as f64 * f64::EPSILON;
            let rest = Vectors(simd).product(&a, &b) - small_matrix::product(&a, &b);
            assert!(rest.amax() <= rounding, "{R} x {K} x {C}: {}", rest.amax());
            let (a_32, b_32) = (a.map(|a| a as f32), b.map(|b| b as f32));
            assert_eq!(
                Vectors(simd).product(&a_32, &b_32),
                small_matrix::product(&a_32, &b_32)
            );

            let (mut found, mut expected) = (SMatrix::zeros(), SMatrix::zeros());
            for _ in 0..2 {
                Vectors(simd).add_symmetric_product(&mut found, &a, &a.transpose());
                small_matrix::add_symmetric_product(&mut expected, &a, &a.transpose());
            }
            small_matrix::mirror(&mut found);
            small_matrix::mirror(&mut expected);
            let rest = (found - expected).amax();
            assert!(rest <= 4.0 * rounding, "{R} x {K} x {R}, symmetric: {rest}");
        }
    }

    fn compare<const R: usize, const K: usize, const C: usize>() {
        dispatch::<R, _>(Compare::<R, K, C>);
        Arch::new().dispatch(Compare::<R, K, C>);
        Arch::Scalar.dispatch(Compare::<R, K, C>);
    }

    /// Whatever the machine's vectors, and however the columns fill them.
    #[test]
    fn they_are_those_of_the_compiler_but_for_rounding() {
        compare::<6, 6, 2>();
        compare::<8, 8, 2>();
        compare::<8, 8, 8>();
        compare::<8, 3, 7>();
        compare::<9, 9, 9>();
        compare::<10, 10, 3>();
        compare::<12, 12, 4>();
        compare::<12, 4, 12>();
        compare::<13, 5, 11>();
        compare::<16, 16, 6>();
        compare::<16, 16, 16>();
        compare::<16, 6, 16>();
        compare::<18, 18, 5>();
        compare::<24, 24, 9>();
    }
}
