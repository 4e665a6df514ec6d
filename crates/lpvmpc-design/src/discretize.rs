//! The exact discretisation of a linear model under a held input.

use crate::number_text;
use nalgebra::DMatrix;
use thiserror::Error;

use crate::matrix_check::{MatrixError, check_finite, check_shape, check_square};

/// A discretisation that cannot be computed.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum DiscretizeError {
    /// A or B is not what it must be.
    #[error(transparent)]
    Matrix(#[from] MatrixError),
    /// The sampling time is not a positive, finite number.
    #[error(
        "the sampling time is {value} s: it must be finite and > 0",
        value = number_text(*value)
    )]
    SampleTime {
        /// The sampling time, s.
        value: f64,
    },
}

/// x+ = A_d x + B_d u for x_dot = A x + B u with u held over `sample_time` (zero-order hold).
///
/// A (n x n, 1/s), B (n x m), `sample_time` in s; returns (A_d, B_d) of the same shapes. It is
/// exact up to rounding: exp(t_s [A B; 0 0]) = [A_d B_d; 0 I] (Van Loan 1978), so it is the oracle
/// for every Runge-Kutta predictor of a frozen model.
///
/// # Errors
/// A is not square, B has not the rows of A, an entry or the sampling time is not finite, the
/// sampling time is not positive, or the result overflows.
pub fn zero_order_hold(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    sample_time: f64,
) -> Result<(DMatrix<f64>, DMatrix<f64>), DiscretizeError> {
    check_square("A", a)?;
    check_shape("B", b, (a.nrows(), b.ncols()), "as many rows as A")?;
    if !(sample_time.is_finite() && sample_time > 0.0) {
        return Err(DiscretizeError::SampleTime { value: sample_time });
    }
    let (n, m) = b.shape();
    let mut generator = DMatrix::zeros(n + m, n + m);
    generator
        .view_mut((0, 0), (n, n))
        .copy_from(&(a * sample_time));
    generator
        .view_mut((0, n), (n, m))
        .copy_from(&(b * sample_time));
    let transition = generator.exp();
    let a_d = transition.view((0, 0), (n, n)).into_owned();
    let b_d = transition.view((0, n), (n, m)).into_owned();
    check_finite("A_d", &a_d)?;
    check_finite("B_d", &b_d)?;
    Ok((a_d, b_d))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_double_integrator_has_the_textbook_form() {
        let a = DMatrix::from_row_slice(2, 2, &[0.0, 1.0, 0.0, 0.0]);
        let b = DMatrix::from_row_slice(2, 1, &[0.0, 1.0]);
        let h = 0.3;
        let (a_d, b_d) = zero_order_hold(&a, &b, h).unwrap();
        let expected = DMatrix::from_row_slice(2, 2, &[1.0, h, 0.0, 1.0]);
        assert!((a_d - expected).norm() < 1e-15);
        assert!((b_d - DMatrix::from_row_slice(2, 1, &[h * h / 2.0, h])).norm() < 1e-15);
    }

    #[test]
    fn a_damped_oscillator_with_drive_follows_its_closed_form() {
        // x_dot = [-s w; -w -s] x has the flow e^(-s t) [cos wt, sin wt; -sin wt, cos wt].
        let (s, w, h) = (3.0, 20.0, 0.11_f64);
        let a = DMatrix::from_row_slice(2, 2, &[-s, w, -w, -s]);
        let b = DMatrix::from_row_slice(2, 1, &[1.0, -2.0]);
        let (a_d, b_d) = zero_order_hold(&a, &b, h).unwrap();
        let (sin, cos) = (w * h).sin_cos();
        let flow = DMatrix::from_row_slice(2, 2, &[cos, sin, -sin, cos]) * (-s * h).exp();
        assert!((&a_d - &flow).norm() < 1e-14);
        let held = a.try_inverse().unwrap() * (flow - DMatrix::identity(2, 2)) * b;
        assert!((b_d - held).norm() < 1e-14);
    }

    #[test]
    fn bad_times_and_overflow_are_refused() {
        let one = DMatrix::from_element(1, 1, 1.0);
        for time in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let error = zero_order_hold(&one, &one, time).unwrap_err();
            assert!(matches!(error, DiscretizeError::SampleTime { .. }));
        }
        assert!(zero_order_hold(&one, &one, 1e6).is_err());
    }
}
