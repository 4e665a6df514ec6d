//! The modes of a linear model: its poles, and which of them the inputs reach.

use nalgebra::linalg::balancing::balance_parlett_reinsch;
use nalgebra::{Complex, DMatrix, DVector, SVD, Schur};

use crate::matrix_check::{MatrixError, QR_ITERATION_CAP, check_shape, check_square, unit};

/// The poles of x_dot = A x (in 1/s) or of x+ = A x (no unit): the eigenvalues of A, sorted by
/// real part, then by imaginary part, both ascending.
///
/// # Errors
/// A is not square, empty or not finite, or the QR iteration does not converge.
pub fn poles(a: &DMatrix<f64>) -> Result<Vec<Complex<f64>>, MatrixError> {
    const NAME: &str = "the state matrix A";
    check_square(NAME, a)?;
    // Balancing sums squares, and does not end once one overflows.
    let unit = unit(a);
    let mut balanced = a / unit;
    balance_parlett_reinsch(&mut balanced);
    let eigenvalues = eigenvalues(&balanced)
        // The QR iteration has no exceptional shifts, so a cyclic permutation stands still under
        // it. A similarity by any reflector takes it out of such a fixed point.
        .or_else(|| eigenvalues(&reflected(&balanced)))
        .ok_or(MatrixError::EigenvaluesDidNotConverge { name: NAME })?
        .into_iter()
        .map(|value| value * unit);
    // Sorted by insertion: they are few, and a general sort is a kilobyte more for a browser to load.
    let mut sorted = Vec::new();
    for y in eigenvalues {
        let below = |x: &Complex<f64>| x.re.total_cmp(&y.re).then(x.im.total_cmp(&y.im)).is_le();
        sorted.insert(sorted.partition_point(below), y);
    }
    Ok(sorted)
}

/// A pole for a message: six digits, and an imaginary part only where there is one.
pub(crate) fn pole_text(pole: Complex<f64>) -> String {
    let short = |value: f64| match value {
        0.0 => "0".to_owned(),
        value if (1e-3..1e6).contains(&value.abs()) => {
            let decimals = (5 - value.abs().log10().floor() as i32).max(0) as usize;
            let text = format!("{value:.decimals$}");
            match text.contains('.') {
                true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
                false => text,
            }
        }
        value => format!("{value:.2e}"),
    };
    let sign = if pole.im < 0.0 { '-' } else { '+' };
    match pole.im {
        0.0 => short(pole.re),
        imaginary => format!("{} {sign} {} i", short(pole.re), short(imaginary.abs())),
    }
}

fn eigenvalues(a: &DMatrix<f64>) -> Option<Vec<Complex<f64>>> {
    let schur = Schur::try_new(a.clone(), f64::EPSILON, QR_ITERATION_CAP)?;
    let values = schur.complex_eigenvalues();
    values
        .iter()
        .all(|z| z.re.is_finite() && z.im.is_finite())
        .then(|| values.iter().copied().collect())
}

/// H A H with the reflector H = I - 2 v v' / v'v and a v that no symmetry shares.
fn reflected(a: &DMatrix<f64>) -> DMatrix<f64> {
    let n = a.nrows();
    let v = DVector::from_fn(n, |i, _| 1.0 / (i as f64 + 1.7));
    let h = DMatrix::identity(n, n) - (&v * v.transpose()) * (2.0 / v.norm_squared());
    &h * a * &h
}

/// The controllability matrix [B, A B, .., A^(n-1) B] with its rank, by singular values.
///
/// A (n x n) is divided by its Frobenius norm and B by its largest entry first: this leaves the
/// rank as it is and keeps the powers from spreading over many decades. A singular value counts when it is above
/// n * max(n, n m) * machine epsilon times the largest.
///
/// The rank says which part of the state space the inputs (B is n x m) reach in exact arithmetic;
/// it is n exactly when (A, B) is controllable. For large n the powers lose it to rounding; use it
/// for n up to about 10.
///
/// # Errors
/// A is not square, B has not the rows of A, an entry is not finite.
pub fn controllability_rank(a: &DMatrix<f64>, b: &DMatrix<f64>) -> Result<usize, MatrixError> {
    check_square("A", a)?;
    check_shape(
        "B",
        b,
        (a.nrows(), b.ncols()),
        "as many rows as A, for x_dot = A x + B u",
    )?;
    let (n, m) = b.shape();
    let mut scaled = a / unit(a);
    let norm = scaled.norm();
    if norm > 0.0 {
        scaled /= norm;
    }
    let mut matrix = DMatrix::zeros(n, n * m);
    let mut power = b / unit(b);
    for k in 0..n {
        matrix.columns_mut(k * m, m).copy_from(&power);
        power = &scaled * power;
    }
    let svd = SVD::try_new(matrix, false, false, f64::EPSILON, QR_ITERATION_CAP).ok_or(
        MatrixError::EigenvaluesDidNotConverge {
            name: "the controllability matrix",
        },
    )?;
    let threshold = (n * n * m) as f64 * f64::EPSILON * svd.singular_values.max();
    Ok(svd
        .singular_values
        .iter()
        .filter(|s| **s > threshold)
        .count())
}

/// How near the mode `pole` of A is to being out of reach of the inputs B: about the smallest
/// singular value of [pole I - A, B] (Popov-Belevitch-Hautus test), as the last pivot of a QR
/// decomposition. Zero: no input moves this mode. A is taken relative to its largest entry and
/// each column of B relative to its own, since what an input reaches does not depend on its unit.
pub(crate) fn distance_to_unreachable(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    pole: Complex<f64>,
) -> f64 {
    let (n, m) = b.shape();
    let unit_of_a = unit(a);
    let (a, pole) = (a / unit_of_a, pole / unit_of_a);
    let mut b = b.clone();
    for mut column in b.column_iter_mut() {
        let largest = column.amax();
        if largest > 0.0 {
            column /= largest;
        }
    }
    // [Re, -Im; Im, Re] has the singular values of Re + i Im, each twice.
    let mut pencil = DMatrix::zeros(2 * n, 2 * (n + m));
    for half in 0..2 {
        let (top, left) = (half * n, half * (n + m));
        pencil.view_mut((top, left), (n, n)).copy_from(&-&a);
        pencil.view_mut((top, left + n), (n, m)).copy_from(&b);
        for i in 0..n {
            pencil[(top + i, left + i)] += pole.re;
        }
    }
    for i in 0..n {
        pencil[(i, n + m + i)] = -pole.im;
        pencil[(n + i, i)] = pole.im;
    }
    pivots(pencil.transpose()).min()
}

/// The sizes of the pivots of a QR decomposition with column pivoting: they fall, and show the rank
/// as the singular values do, which are within a factor of the matrix' size of them in practice
/// (Golub and Van Loan, Matrix Computations, section 5.4).
pub(crate) fn pivots(matrix: DMatrix<f64>) -> DVector<f64> {
    matrix.col_piv_qr().r().diagonal().abs()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poles_of_a_companion_matrix_are_the_roots() {
        // (s + 1)(s + 2)(s^2 + 2 s + 5) = s^4 + 5 s^3 + 13 s^2 + 19 s + 10
        #[rustfmt::skip]
        let a = DMatrix::from_row_slice(4, 4, &[
            0.0, 1.0, 0.0, 0.0,
            0.0, 0.0, 1.0, 0.0,
            0.0, 0.0, 0.0, 1.0,
            -10.0, -19.0, -13.0, -5.0,
        ]);
        let found = poles(&a).unwrap();
        let roots = [(-2.0, 0.0), (-1.0, -2.0), (-1.0, 0.0), (-1.0, 2.0)];
        // Equal real parts come in the order of rounding, so each root is looked up.
        assert_eq!(found.len(), 4);
        assert!((found[0] - Complex::new(-2.0, 0.0)).norm() < 1e-12);
        for (re, im) in roots {
            assert!(
                found
                    .iter()
                    .any(|z| (z - Complex::new(re, im)).norm() < 1e-12),
                "{re} + {im} i is not in {found:?}"
            );
        }
    }

    #[test]
    fn a_cyclic_permutation_has_the_roots_of_unity() {
        for n in 3..7 {
            let a = DMatrix::from_fn(n, n, |i, j| if i == (j + 1) % n { 1.0 } else { 0.0 });
            for z in poles(&a).unwrap() {
                assert!((z.powu(n as u32) - 1.0).norm() < 1e-12, "n = {n}, pole {z}");
            }
        }
    }

    #[test]
    fn badly_scaled_states_keep_their_poles() {
        // T^-1 diag(-1, -2, -3) T with states in units nine decades apart.
        let t = DMatrix::from_row_slice(3, 3, &[1.0, 1.0, 1.0, 0.0, 1.0, 2.0, 0.0, 0.0, 1.0]);
        let unit = DMatrix::from_diagonal(&DVector::from_vec(vec![1.0, 1e-4, 1e5]));
        let mixed = &unit * t;
        let diagonal = DMatrix::from_diagonal(&DVector::from_vec(vec![-1.0, -2.0, -3.0]));
        let a = &mixed * diagonal * mixed.clone().try_inverse().unwrap();
        for (z, root) in poles(&a).unwrap().iter().zip([-3.0, -2.0, -1.0]) {
            assert!((z - root).norm() < 1e-11, "{z} for {root}");
        }
    }

    #[test]
    fn zero_and_single_entry_matrices_have_poles() {
        assert_eq!(
            poles(&DMatrix::zeros(3, 3)).unwrap(),
            vec![Complex::from(0.0); 3]
        );
        assert_eq!(
            poles(&DMatrix::from_element(1, 1, 4.0)).unwrap(),
            vec![Complex::from(4.0)]
        );
    }

    #[test]
    fn matrices_at_the_ends_of_the_numbers_have_poles() {
        // Squares of these overflow or vanish: balancing once did not end.
        for size in [1e-300, 1e-160, 1e160, 1e200, 1e307] {
            let a = DMatrix::from_row_slice(2, 2, &[0.0, size, 0.25 * size, 0.0]);
            let found = poles(&a).unwrap();
            for (pole, expected) in found.iter().zip([-0.5, 0.5]) {
                assert!((pole.re / size - expected).abs() < 1e-14, "{pole}");
            }
            let b = DMatrix::from_row_slice(2, 1, &[size, 0.0]);
            assert_eq!(controllability_rank(&a, &b).unwrap(), 2, "{size}");
        }
        let spread = DMatrix::from_row_slice(2, 2, &[1.0, 1e200, 1e-100, 1.0]);
        let found = poles(&spread).unwrap();
        assert!((found[1].re / 1e50 - 1.0).abs() < 1e-12, "{found:?}");
    }

    #[test]
    fn poles_are_written_for_people() {
        for (re, im, text) in [
            (-51.801_508_841_443_706, 0.0, "-51.8015"),
            (1.0, 0.0, "1"),
            (-2.5, -1.25, "-2.5 - 1.25 i"),
            (0.0, 3e-9, "0 + 3.00e-9 i"),
        ] {
            assert_eq!(pole_text(Complex::new(re, im)), text);
        }
    }

    #[test]
    fn a_nan_is_named_at_its_entry() {
        let mut a = DMatrix::zeros(3, 3);
        a[(2, 1)] = f64::NAN;
        let error = poles(&a).unwrap_err();
        assert!(error.to_string().contains("A[(2, 1)] is NaN"), "{error}");
    }

    #[test]
    fn an_input_that_misses_a_mode_lowers_the_rank() {
        let a = DMatrix::from_row_slice(3, 3, &[0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -7.0]);
        let b = DMatrix::from_row_slice(3, 1, &[0.0, 1.0, 0.0]);
        assert_eq!(controllability_rank(&a, &b).unwrap(), 2);
        let all = DMatrix::from_row_slice(3, 1, &[0.0, 1.0, 1.0]);
        assert_eq!(controllability_rank(&a, &all).unwrap(), 3);
        let far = distance_to_unreachable(&a, &b, Complex::from(-7.0));
        assert!(far < 1e-15, "{far}");
        let near = distance_to_unreachable(&a, &b, Complex::from(0.0));
        assert!(near > 0.1, "{near}");
    }
}
