//! Products in vectors, block by block: the sums of a block stay in registers, and are so many that none waits
//! for the one before it. A sum has the terms of [`small_matrix`] in the same order; where the machine multiplies
//! and adds in one instruction, a term is rounded once, not twice.

use super::{Compiled, Products};
use crate::model::Scalar;
use crate::small_matrix;
use core::any::Any;
use nalgebra::SMatrix;
use pulp::{Arch, Simd, WithSimd};

/// In the vectors of `S`, of numbers in `f64`, where columns fill two of them or, of products, most of one; else as the compiler
/// has them.
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
        if C > TOO_FEW
            && (fills_two::<S>(R) || fills_one::<S>(R))
            && let Some((a, b)) = both_in_f64(a, b)
            && let Some(out) = in_f64_mut(out)
        {
            if fills_two::<S>(R) {
                multiply(self.0, out, a, b);
            } else {
                multiply_narrow(self.0, out, a, b);
            }
        } else {
            small_matrix::set_product(out, a, b);
        }
    }

    #[inline(always)]
    fn set_symmetric_sum<T: Scalar, const R: usize, const K: usize, const L: usize>(
        self,
        out: &mut SMatrix<T, R, R>,
        addend: &SMatrix<T, R, R>,
        (a, b): (&SMatrix<T, R, K>, &SMatrix<T, K, R>),
        (c, d): (&SMatrix<T, R, L>, &SMatrix<T, L, R>),
    ) {
        if fills_two::<S>(R)
            && R.is_multiple_of(S::F64_LANES)
            && let Some(addend) = in_f64(addend)
            && let Some(first) = both_in_f64(a, b)
            && let Some(second) = both_in_f64(c, d)
            && let Some(out) = in_f64_mut(out)
        {
            set_below_diagonal(self.0, out, addend, first, second);
        } else {
            Compiled.set_symmetric_sum(out, addend, (a, b), (c, d));
        }
    }
}

/// Whether columns of so many `rows` fill two vectors.
#[inline(always)]
fn fills_two<S: Simd>(rows: usize) -> bool {
    S::F64_LANES >= LANES && rows >= 2 * S::F64_LANES
}

/// Whether columns of so many `rows`, four at least, fit into one vector and fill more than half of it.
#[inline(always)]
fn fills_one<S: Simd>(rows: usize) -> bool {
    rows >= LANES && rows <= S::F64_LANES && 2 * rows > S::F64_LANES
}

/// A matrix by columns.
type Columns<const R: usize, const C: usize> = [[f64; R]; C];

/// The matrix where its numbers are `f64`, which the compiler knows.
#[inline(always)]
fn in_f64<T: Scalar, const R: usize, const C: usize>(
    m: &SMatrix<T, R, C>,
) -> Option<&Columns<R, C>> {
    let m: &dyn Any = m;
    Some(&m.downcast_ref::<SMatrix<f64, R, C>>()?.data.0)
}

#[inline(always)]
fn in_f64_mut<T: Scalar, const R: usize, const C: usize>(
    m: &mut SMatrix<T, R, C>,
) -> Option<&mut Columns<R, C>> {
    let m: &mut dyn Any = m;
    Some(&mut m.downcast_mut::<SMatrix<f64, R, C>>()?.data.0)
}

/// The factors of a product.
type Factors<'a, const R: usize, const K: usize, const C: usize> =
    (&'a Columns<R, K>, &'a Columns<K, C>);

#[inline(always)]
fn both_in_f64<'a, T: Scalar, const R: usize, const K: usize, const C: usize>(
    a: &'a SMatrix<T, R, K>,
    b: &'a SMatrix<T, K, C>,
) -> Option<Factors<'a, R, K, C>> {
    Some((in_f64(a)?, in_f64(b)?))
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
    let (none, whole) = ((&[], &[[]; N]), R / S::F64_LANES);
    for (out, b) in out.iter_mut().zip(b) {
        set_rows(simd, out, None, (a, b), none, (0, whole));
        // Rows that fill no vector are part of one that begins before them.
        if !R.is_multiple_of(S::F64_LANES) {
            let last = (R - S::F64_LANES, 0);
            set_block::<S, 1, N, R, K, 0>(simd, out, None, (a, b), none, last);
        }
    }
    (out_rest, b_rest)
}

/// out = `addend` + A B + C D on the diagonal and below, whose vectors begin at or before it.
#[inline(always)]
fn set_below_diagonal<S: Simd, const R: usize, const K: usize, const L: usize>(
    simd: S,
    out: &mut Columns<R, R>,
    addend: &Columns<R, R>,
    (a, b): Factors<'_, R, K, R>,
    (c, d): Factors<'_, R, L, R>,
) {
    let columns = out.as_chunks_mut::<FEW>().0.iter_mut();
    let columns = columns.zip(addend.as_chunks::<FEW>().0);
    let factors = b.as_chunks::<FEW>().0.iter().zip(d.as_chunks::<FEW>().0);
    for (i, ((out, addend), (b, d))) in columns.zip(factors).enumerate() {
        let rows = (i * FEW / S::F64_LANES, R / S::F64_LANES);
        set_rows(simd, out, Some(addend), (a, b), (c, d), rows);
    }
}

/// A few columns of `addend`, or zero, + A B + C D in the vectors `from` to `end` of `out`.
#[inline(always)]
fn set_rows<S: Simd, const N: usize, const R: usize, const K: usize, const L: usize>(
    simd: S,
    out: &mut Columns<R, N>,
    addend: Option<&Columns<R, N>>,
    first: Factors<'_, R, K, N>,
    second: Factors<'_, R, L, N>,
    (mut from, end): (usize, usize),
) {
    while from + 2 <= end {
        set_block::<S, 2, N, R, K, L>(simd, out, addend, first, second, (0, from));
        from += 2;
    }
    if from < end {
        set_block::<S, 1, N, R, K, L>(simd, out, addend, first, second, (0, from));
    }
}

/// The same for `M` vectors of each column, from the vector `from` behind `row` on.
#[inline(always)]
fn set_block<
    S: Simd,
    const M: usize,
    const N: usize,
    const R: usize,
    const K: usize,
    const L: usize,
>(
    simd: S,
    out: &mut Columns<R, N>,
    addend: Option<&Columns<R, N>>,
    first: Factors<'_, R, K, N>,
    second: Factors<'_, R, L, N>,
    (row, from): (usize, usize),
) {
    let mut sums = [[simd.splat_f64s(0.0); M]; N];
    for (sums, addend) in sums.iter_mut().zip(addend.into_iter().flatten()) {
        let (addend, _) = S::as_simd_f64s(&addend[row..]);
        let addend = addend.get(from..).unwrap_or_default();
        for (sum, addend) in sums.iter_mut().zip(addend) {
            *sum = *addend;
        }
    }
    add_terms(simd, &mut sums, first, (row, from));
    add_terms(simd, &mut sums, second, (row, from));
    for (out, sums) in out.iter_mut().zip(&sums) {
        let (out, _) = S::as_mut_simd_f64s(&mut out[row..]);
        let out = out.get_mut(from..).unwrap_or_default();
        for (out, sum) in out.iter_mut().zip(sums) {
            *out = *sum;
        }
    }
}

/// Adds the terms of A B to the sums of a block.
#[inline(always)]
fn add_terms<S: Simd, const M: usize, const N: usize, const R: usize, const K: usize>(
    simd: S,
    sums: &mut [[S::f64s; M]; N],
    (a, b): Factors<'_, R, K, N>,
    (row, from): (usize, usize),
) {
    for (k, a) in a.iter().enumerate() {
        let (a, _) = S::as_simd_f64s(&a[row..]);
        let Some(a) = a.get(from..).and_then(|a| a.first_chunk::<M>()) else {
            return;
        };
        for (sums, b) in sums.iter_mut().zip(b) {
            let factor = simd.splat_f64s(b[k]);
            for (sum, a) in sums.iter_mut().zip(a) {
                *sum = simd.mul_add_e_f64s(*a, factor, *sum);
            }
        }
    }
}

/// out = A B, whose columns are one vector or a part of it.
#[inline(always)]
fn multiply_narrow<S: Simd, const R: usize, const K: usize, const C: usize>(
    simd: S,
    out: &mut Columns<R, C>,
    a: &Columns<R, K>,
    b: &Columns<K, C>,
) {
    let mut sums = [simd.splat_f64s(0.0); C];
    // A part of a vector is loaded and stored by a jump into a table.
    for (k, a) in a.iter().enumerate() {
        let a = match S::as_simd_f64s(a).0 {
            [whole, ..] => *whole,
            [] => simd.partial_load_f64s(a),
        };
        for (sum, b) in sums.iter_mut().zip(b) {
            *sum = simd.mul_add_e_f64s(a, simd.splat_f64s(b[k]), *sum);
        }
    }
    for (out, sum) in out.iter_mut().zip(&sums) {
        match S::as_mut_simd_f64s(out).0 {
            [whole, ..] => *whole = *sum,
            [] => simd.partial_store_f64s(out, *sum),
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
            // Each of K terms, of 4 at most, is rounded with the sum so far. What stands in the answer's place is no part of it.
            let rounding = 4.0 * (K * K) as f64 * f64::EPSILON;
            let mut found = SMatrix::from_element(f64::NAN);
            Vectors(simd).set_product(&mut found, &a, &b);
            let rest = (found - a * b).amax();
            assert!(rest <= rounding, "{R} x {K} x {C}: {rest}");
            let (a_32, b_32) = (a.map(|a| a as f32), b.map(|b| b as f32));
            assert_eq!(
                Vectors(simd).product(&a_32, &b_32),
                small_matrix::product(&a_32, &b_32)
            );

            let c = SMatrix::<f64, R, C>::from_fn(|_, _| number());
            let root = SMatrix::<f64, R, R>::from_fn(|_, _| number());
            let addend = root + root.transpose();
            let rest = symmetric_sum(Vectors(simd), &addend, &a, &c)
                - (addend + a * a.transpose() + c * c.transpose());
            let rounding = 4.0 * ((K + C + 1) * (K + C + 1)) as f64 * f64::EPSILON;
            assert!(rest.amax() <= rounding, "{R}, {K} + {C}: {}", rest.amax());
            let nothing = SMatrix::<f64, R, 0>::zeros();
            let rest =
                symmetric_sum(Vectors(simd), &addend, &a, &nothing) - (addend + a * a.transpose());
            assert!(rest.amax() <= rounding, "{R}, {K}: {}", rest.amax());
            let (addend_32, c_32) = (addend.map(|a| a as f32), c.map(|c| c as f32));
            assert_eq!(
                symmetric_sum(Vectors(simd), &addend_32, &a_32, &c_32),
                symmetric_sum(Compiled, &addend_32, &a_32, &c_32)
            );

            // Of small integers products are exact, and what is added to a large one tells the order of the terms.
            let (a, c) = (a.map(f64::round), c.map(f64::round));
            let large = SMatrix::from_element(2_f64.powi(53));
            assert_eq!(
                symmetric_sum(Vectors(simd), &large, &a, &c),
                symmetric_sum(Compiled, &large, &a, &c)
            );
        }
    }

    /// `addend` + A A' + C C'
    fn symmetric_sum<M: Products, T: Scalar, const R: usize, const K: usize, const L: usize>(
        by: M,
        addend: &SMatrix<T, R, R>,
        a: &SMatrix<T, R, K>,
        c: &SMatrix<T, R, L>,
    ) -> SMatrix<T, R, R> {
        let mut out = SMatrix::from_element(T::one() / T::zero());
        let (a_transposed, c_transposed) = (a.transpose(), c.transpose());
        by.set_symmetric_sum(&mut out, addend, (a, &a_transposed), (c, &c_transposed));
        small_matrix::mirror(&mut out);
        out
    }

    fn compare<const R: usize, const K: usize, const C: usize>() {
        dispatch::<R, _>(Compare::<R, K, C>);
        Arch::new().dispatch(Compare::<R, K, C>);
        Arch::Scalar.dispatch(Compare::<R, K, C>);
    }

    /// Whatever the machine's vectors, and however the columns fill them.
    #[test]
    fn they_are_those_of_the_compiler_but_for_rounding() {
        compare::<3, 9, 3>();
        compare::<4, 12, 4>();
        compare::<5, 16, 5>();
        compare::<6, 16, 6>();
        compare::<6, 6, 2>();
        compare::<7, 16, 7>();
        compare::<8, 16, 8>();
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
