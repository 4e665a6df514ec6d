//! A model that is sampled itself, in discrete time: over several of its periods.

use super::MOST_STEPS;
use crate::embedding::Tangent;
use crate::model::Scalar;
use crate::small_matrix::product;
use nalgebra::{SMatrix, SVector, convert};

/// How many periods are nearest to `duration` s: of a time that was summed up from periods, as many as there
/// were.
pub(crate) fn periods<T: Scalar>(period: T, duration: T) -> usize {
    let half: T = convert(0.5);
    let mut count = 0;
    while count < MOST_STEPS && (convert::<f64, T>(count as f64) + half) * period <= duration {
        count += 1;
    }
    count
}

/// The pair over so many periods of a model that is sampled itself, for its constant pair over one.
pub(crate) fn over_periods<T: Scalar, const NX: usize, const NU: usize>(
    a: &SMatrix<T, NX, NX>,
    b: &SMatrix<T, NX, NU>,
    periods: usize,
) -> (SMatrix<T, NX, NX>, SMatrix<T, NX, NU>) {
    let none = (SMatrix::identity(), SMatrix::zeros());
    (0..periods).fold(none, |(a_d, b_d), _| {
        (product(a, &a_d), product(a, &b_d) + b)
    })
}

/// Each `x`, from which nothing has moved yet.
#[inline(always)]
pub(super) fn unmoved<T: Scalar, const NX: usize, const NU: usize, const POINTS: usize>(
    x: &[SVector<T, NX>; POINTS],
) -> [Tangent<T, NX, NU>; POINTS] {
    let mut reached = [(SVector::zeros(), SMatrix::identity(), SMatrix::zeros()); POINTS];
    for (reached, x) in reached.iter_mut().zip(x) {
        reached.0 = *x;
    }
    reached
}

/// The states after so many periods from each `x`, and the pairs over them along these motions, from the map and its
/// pairs `at` the states.
pub(super) fn follow_periods<T: Scalar, const NX: usize, const NU: usize, const POINTS: usize>(
    x: &[SVector<T, NX>; POINTS],
    periods: usize,
    at: impl Fn(&[SVector<T, NX>; POINTS], &mut [Tangent<T, NX, NU>; POINTS]),
) -> [Tangent<T, NX, NU>; POINTS] {
    let (mut x, mut reached) = (*x, unmoved(x));
    let mut next = reached;
    for done in 0..periods {
        at(&x, &mut next);
        let points = x.iter_mut().zip(&mut reached);
        for ((x, (x_reached, a_d, b_d)), (x_next, a, b)) in points.zip(&next) {
            (*x, *x_reached) = (*x_next, *x_next);
            (*a_d, *b_d) = match done {
                0 => (*a, *b),
                _ => (product(a, a_d), product(a, b_d) + b),
            };
        }
    }
    reached
}
