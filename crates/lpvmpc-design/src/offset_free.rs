//! Whether a disturbance can be told from the measurements, as offset-free tracking needs.

use nalgebra::DMatrix;
use thiserror::Error;

use crate::modes::pivots;

/// Disturbances that no measurement can tell apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum OffsetFreeError {
    /// The matrices do not fit together.
    #[error("A is n x n, B_d n x n_d, C n_y x n, C_d n_y x n_d; these are not")]
    Shapes,
    /// An entry is not finite.
    #[error("the matrices must have finite entries")]
    NotFinite,
    /// More disturbances than measured quantities.
    #[error("{disturbances} disturbances cannot be found with {measured} measured quantities")]
    TooMany {
        /// Disturbances n_d.
        disturbances: usize,
        /// Measured quantities n_y.
        measured: usize,
    },
    /// The rank condition fails.
    #[error(
        "the disturbances cannot be distinguished from steady states: rank [A, B_d; C, C_d] is {rank}, it \
         must be {needed}"
    )]
    Rank {
        /// The rank found.
        rank: usize,
        /// n + n_d.
        needed: usize,
    },
}

/// A pivot below this share of the largest one counts as zero.
const NEGLIGIBLE: f64 = 1e-9;

/// Checks the rank condition of offset-free tracking for x_dot = A x + B u + B_d d,
/// y = C x + C_d d with constant d: rank [A, B_d; C, C_d] = n + n_d, where for a detectable
/// (A, C) plant and disturbance are detectable together (Pannocchia and Rawlings, AIChE J. 49,
/// 2003; their I - A belongs to sampled time).
///
/// # Errors
/// [`OffsetFreeError`] says what is missing.
pub fn check_offset_free(
    a: &DMatrix<f64>,
    b_d: &DMatrix<f64>,
    c: &DMatrix<f64>,
    c_d: &DMatrix<f64>,
) -> Result<(), OffsetFreeError> {
    let (n, n_d, n_y) = (a.nrows(), b_d.ncols(), c.nrows());
    let fits = a.is_square() && b_d.nrows() == n && c.ncols() == n && c_d.shape() == (n_y, n_d);
    if !fits {
        return Err(OffsetFreeError::Shapes);
    }
    if n_d > n_y {
        return Err(OffsetFreeError::TooMany {
            disturbances: n_d,
            measured: n_y,
        });
    }
    let mut joint = DMatrix::zeros(n + n_y, n + n_d);
    for (place, block) in [((0, 0), a), ((0, n), b_d), ((n, 0), c), ((n, n), c_d)] {
        joint.view_mut(place, block.shape()).copy_from(block);
    }
    if !joint.iter().all(|entry| entry.is_finite()) {
        return Err(OffsetFreeError::NotFinite);
    }
    // Units must not decide about the rank: rows, then columns, to unit length.
    for mut row in joint.row_iter_mut() {
        let length = row.norm();
        row.unscale_mut(if length > 0.0 { length } else { 1.0 });
    }
    for mut column in joint.column_iter_mut() {
        let length = column.norm();
        column.unscale_mut(if length > 0.0 { length } else { 1.0 });
    }
    let pivots = pivots(joint);
    let least = NEGLIGIBLE * pivots.max();
    let rank = pivots.iter().filter(|pivot| **pivot > least).count();
    if rank == n + n_d {
        Ok(())
    } else {
        Err(OffsetFreeError::Rank {
            rank,
            needed: n + n_d,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::dmatrix;

    #[test]
    fn a_torque_on_a_pendulum_can_be_found_from_its_angle() {
        let (a, c) = (dmatrix![0.0, 1.0; 9.81, 0.0], dmatrix![1.0, 0.0]);
        let found = check_offset_free(&a, &dmatrix![0.0; 1.0], &c, &dmatrix![0.0]);
        assert_eq!(found, Ok(()));
    }

    #[test]
    fn torque_and_offset_of_a_pendulum_cannot_be_told_apart_even_with_its_rate() {
        // A lean of 1 rad with a torque of -9.81 and an offset of 1 rad rests and reads zero.
        let a = dmatrix![0.0, 1.0; 9.81, 0.0];
        let (b_d, c_d) = (dmatrix![0.0, 0.0; 1.0, 0.0], dmatrix![0.0, -1.0; 0.0, 0.0]);
        let found = check_offset_free(&a, &b_d, &DMatrix::identity(2, 2), &c_d);
        assert_eq!(found, Err(OffsetFreeError::Rank { rank: 3, needed: 4 }));
    }

    #[test]
    fn a_disturbance_that_does_nothing_cannot_be_found() {
        let (a, c) = (dmatrix![0.0, 1.0; 9.81, 0.0], dmatrix![1.0, 0.0]);
        let found = check_offset_free(&a, &dmatrix![0.0; 0.0], &c, &dmatrix![0.0]);
        assert_eq!(found, Err(OffsetFreeError::Rank { rank: 2, needed: 3 }));
    }

    #[test]
    fn mistakes_are_named() {
        let one = dmatrix![1.0];
        let two = DMatrix::zeros(1, 2);
        assert_eq!(
            check_offset_free(&one, &two, &one, &two),
            Err(OffsetFreeError::TooMany {
                disturbances: 2,
                measured: 1
            })
        );
        assert_eq!(
            check_offset_free(&two, &one, &one, &one),
            Err(OffsetFreeError::Shapes)
        );
        let nan = dmatrix![f64::NAN];
        let found = check_offset_free(&nan, &one, &one, &one);
        assert_eq!(found, Err(OffsetFreeError::NotFinite));
    }
}
