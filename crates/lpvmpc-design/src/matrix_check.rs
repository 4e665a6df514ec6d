//! Checks of the matrices handed in, so that a mistake is named at its entry and no NaN gets in.

use crate::number_text;
use nalgebra::{DMatrix, SymmetricEigen};
use thiserror::Error;

/// A matrix that cannot be what its name says. Row and column numbers count from 0, as in
/// nalgebra's `a[(row, column)]`.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum MatrixError {
    /// The matrix has no rows or no columns.
    #[error("{name} is {rows} x {columns}: it must have at least one row and one column")]
    Empty {
        /// Name of the matrix in the equation.
        name: &'static str,
        /// Its number of rows.
        rows: usize,
        /// Its number of columns.
        columns: usize,
    },
    /// The matrix must be square.
    #[error("{name} is {rows} x {columns}: it must be square")]
    NotSquare {
        /// Name of the matrix in the equation.
        name: &'static str,
        /// Its number of rows.
        rows: usize,
        /// Its number of columns.
        columns: usize,
    },
    /// The matrix does not fit the other matrices.
    #[error(
        "{name} is {rows} x {columns}: it must be {expected_rows} x {expected_columns} ({reason})"
    )]
    WrongShape {
        /// Name of the matrix in the equation.
        name: &'static str,
        /// Its number of rows.
        rows: usize,
        /// Its number of columns.
        columns: usize,
        /// The number of rows it must have.
        expected_rows: usize,
        /// The number of columns it must have.
        expected_columns: usize,
        /// What fixes that shape.
        reason: &'static str,
    },
    /// An entry is NaN or infinite.
    #[error("{name}[({row}, {column})] is {value}: every entry must be a finite number")]
    NonFinite {
        /// Name of the matrix in the equation.
        name: &'static str,
        /// Row of the entry, counted from 0.
        row: usize,
        /// Column of the entry, counted from 0.
        column: usize,
        /// The entry.
        value: f64,
    },
    /// Two mirrored entries differ by more than rounding.
    #[error(
        "{name} is not symmetric: {name}[({row}, {column})] is {value} \
         but {name}[({column}, {row})] is {mirrored}"
    )]
    NotSymmetric {
        /// Name of the matrix in the equation.
        name: &'static str,
        /// Row of the entry, counted from 0.
        row: usize,
        /// Column of the entry, counted from 0.
        column: usize,
        /// The entry.
        value: f64,
        /// The entry mirrored at the diagonal.
        mirrored: f64,
    },
    /// An eigenvalue is zero or negative where all must be positive.
    #[error(
        "{name} is not positive definite: its smallest eigenvalue is {smallest_eigenvalue}, \
         which must be > 0", smallest_eigenvalue = number_text(*smallest_eigenvalue))]
    NotPositiveDefinite {
        /// Name of the matrix in the equation.
        name: &'static str,
        /// Its smallest eigenvalue.
        smallest_eigenvalue: f64,
    },
    /// An eigenvalue is negative where none may be.
    #[error(
        "{name} is not positive semidefinite: its smallest eigenvalue is {smallest_eigenvalue}, \
         which must be >= 0", smallest_eigenvalue = number_text(*smallest_eigenvalue))]
    NotPositiveSemidefinite {
        /// Name of the matrix in the equation.
        name: &'static str,
        /// Its smallest eigenvalue.
        smallest_eigenvalue: f64,
    },
    /// The QR iteration for the eigenvalues or singular values did not end.
    #[error("the eigenvalues of {name} could not be computed: the QR iteration did not converge")]
    EigenvaluesDidNotConverge {
        /// Name of the matrix in the equation.
        name: &'static str,
    },
}

/// Steps after which a QR iteration is given up. LAPACK allows 30 per eigenvalue; this is that
/// for a matrix of a hundred rows.
pub(crate) const QR_ITERATION_CAP: usize = 3000;

/// Largest difference of mirrored entries, relative to the largest entry, that counts as rounding.
const SYMMETRY_TOLERANCE: f64 = 1e-10;

/// Every entry is finite and there is at least one.
pub(crate) fn check_finite(name: &'static str, m: &DMatrix<f64>) -> Result<(), MatrixError> {
    let (rows, columns) = m.shape();
    if rows == 0 || columns == 0 {
        return Err(MatrixError::Empty {
            name,
            rows,
            columns,
        });
    }
    for column in 0..columns {
        for row in 0..rows {
            let value = m[(row, column)];
            if !value.is_finite() {
                return Err(MatrixError::NonFinite {
                    name,
                    row,
                    column,
                    value,
                });
            }
        }
    }
    Ok(())
}

/// Square, finite and not empty.
pub(crate) fn check_square(name: &'static str, m: &DMatrix<f64>) -> Result<(), MatrixError> {
    if !m.is_square() {
        let (rows, columns) = m.shape();
        return Err(MatrixError::NotSquare {
            name,
            rows,
            columns,
        });
    }
    check_finite(name, m)
}

/// Of the shape `expected` (rows, columns), finite and not empty.
pub(crate) fn check_shape(
    name: &'static str,
    m: &DMatrix<f64>,
    expected: (usize, usize),
    reason: &'static str,
) -> Result<(), MatrixError> {
    if m.shape() != expected {
        let (rows, columns) = m.shape();
        return Err(MatrixError::WrongShape {
            name,
            rows,
            columns,
            expected_rows: expected.0,
            expected_columns: expected.1,
            reason,
        });
    }
    check_finite(name, m)
}

/// The symmetric part of `m`, once its mirrored entries agree up to rounding.
pub fn checked_symmetric(
    name: &'static str,
    m: &DMatrix<f64>,
) -> Result<DMatrix<f64>, MatrixError> {
    check_square(name, m)?;
    let allowed = SYMMETRY_TOLERANCE * m.amax();
    for column in 0..m.ncols() {
        for row in 0..column {
            let (value, mirrored) = (m[(row, column)], m[(column, row)]);
            if (value - mirrored).abs() > allowed {
                return Err(MatrixError::NotSymmetric {
                    name,
                    row,
                    column,
                    value,
                    mirrored,
                });
            }
        }
    }
    Ok(symmetric_part(m))
}

/// (M + M') / 2, halved first: the sum could overflow.
pub(crate) fn symmetric_part(m: &DMatrix<f64>) -> DMatrix<f64> {
    m * 0.5 + m.transpose() * 0.5
}

/// The power of two at the largest entry of a finite M; 1 for M = 0. M over it has entries below
/// 2, exactly, whose squares do not overflow.
pub(crate) fn unit(m: &DMatrix<f64>) -> f64 {
    let largest = m.amax();
    if largest > 0.0 {
        largest.max(f64::MIN_POSITIVE).log2().floor().exp2()
    } else {
        1.0
    }
}

/// M > 0 for a symmetric, finite M, whose entries may be of very different units.
pub fn check_positive_definite(name: &'static str, m: &DMatrix<f64>) -> Result<(), MatrixError> {
    if let Some(scaled) = with_similar_diagonal(m)
        && smallest_eigenvalue(name, &scaled)? > rounding_of_eigenvalues(&scaled)
    {
        return Ok(());
    }
    let unit = unit(m);
    Err(MatrixError::NotPositiveDefinite {
        name,
        smallest_eigenvalue: smallest_eigenvalue(name, &(m / unit))? * unit,
    })
}

/// D M D with a diagonal D of powers of two and a diagonal between 1 and 4: definite as M is. `None` if it can be seen from
/// its entries that M is not positive definite.
fn with_similar_diagonal(m: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let diagonal = m.diagonal();
    if !diagonal.iter().all(|entry| *entry > 0.0) {
        return None;
    }
    let scale = diagonal.map(|entry| (-0.5 * entry.log2()).ceil().exp2());
    let scaled = m.map_with_location(|i, j, entry| scale[i] * entry * scale[j]);
    // |m_ij|^2 <= m_ii m_jj
    let bounded = scaled.iter().all(|entry| entry.abs() <= 4.0);
    bounded.then_some(scaled)
}

/// M >= 0 for a symmetric, finite M, up to the rounding of its eigenvalues.
pub fn check_positive_semidefinite(
    name: &'static str,
    m: &DMatrix<f64>,
) -> Result<(), MatrixError> {
    let unit = unit(m);
    let scaled = m / unit;
    let smallest = smallest_eigenvalue(name, &scaled)?;
    if smallest < -rounding_of_eigenvalues(&scaled) {
        return Err(MatrixError::NotPositiveSemidefinite {
            name,
            smallest_eigenvalue: smallest * unit,
        });
    }
    Ok(())
}

fn smallest_eigenvalue(name: &'static str, m: &DMatrix<f64>) -> Result<f64, MatrixError> {
    SymmetricEigen::try_new(m.clone(), f64::EPSILON, QR_ITERATION_CAP)
        .map(|eigen| eigen.eigenvalues.min())
        .ok_or(MatrixError::EigenvaluesDidNotConverge { name })
}

/// By how much the computed eigenvalues of a symmetric matrix may be off (Weyl's bound).
fn rounding_of_eigenvalues(m: &DMatrix<f64>) -> f64 {
    10.0 * m.nrows() as f64 * f64::EPSILON * m.norm()
}
