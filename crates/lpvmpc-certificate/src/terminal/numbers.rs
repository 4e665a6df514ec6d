//! What the numbers of a certificate must be before anything is proved with them.

use super::certificate::Certificate;
use super::claim::ClaimError;
use super::normalised::{Normaliser, Square};
use super::sampled::SampledClaim;
use crate::enclosure::{Interval, from_fn, is_positive_definite};
use nalgebra::SMatrix;
use std::ops::RangeInclusive;

/// Sizes that a number of a certificate may have, if it is not zero. SI units and costs of a plant
/// are far inside; products of a few such numbers neither overflow nor vanish, so that no rounding
/// is beyond what the enclosures account for.
const SIZES: RangeInclusive<f64> = 1e-30..=1e30;

impl<Plant, const NX: usize, const NU: usize, const NS: usize> Certificate<Plant, NX, NU, NS> {
    /// Whether the numbers can be what their names say: of a size that arithmetic bears, in their
    /// ranges, Q positive semidefinite, R and both P positive definite, all four symmetric to the
    /// bit. This proves nothing about the plant, and takes microseconds.
    ///
    /// # Errors
    /// The first number or matrix that cannot be.
    pub fn check_numbers(&self) -> Result<(), ClaimError> {
        self.sampled().check_numbers()?;
        let limits = self.scheduling_limits.iter().enumerate();
        let limits = limits.map(|(i, limit)| (format!("scheduling_limits[{i}]"), *limit));
        let rate = ("continuous.rate_1_s".to_owned(), self.continuous.rate_1_s);
        check_positive(std::iter::once(rate).chain(limits))?;
        let p = &self.continuous.p;
        check_sizes("continuous.p", p)?;
        check_symmetric("continuous.p", p)?;
        check_definite("continuous.p", Normaliser::of(p).is_some())
    }
}

impl<const NX: usize, const NU: usize> SampledClaim<NX, NU> {
    /// As [`Certificate::check_numbers`], for what it has of a certificate's numbers.
    ///
    /// # Errors
    /// The first number or matrix that cannot be.
    pub fn check_numbers(&self) -> Result<(), ClaimError> {
        self.check_scalars()?;
        let terminal = &self.terminal;
        check_sizes("q", &self.q)?;
        check_sizes("r", &self.r)?;
        check_sizes("terminal.k", &terminal.k)?;
        check_sizes("terminal.p", &terminal.p)?;
        check_symmetric("q", &self.q)?;
        check_symmetric("r", &self.r)?;
        check_symmetric("terminal.p", &terminal.p)?;
        if !is_at_most(&SMatrix::zeros(), &self.q) {
            return Err(ClaimError::NotSemidefinite { name: "q" });
        }
        check_definite("r", Normaliser::of(&self.r).is_some())?;
        check_definite("terminal.p", Normaliser::of(&terminal.p).is_some())
    }

    fn check_scalars(&self) -> Result<(), ClaimError> {
        check_positive([
            ("t_s".to_owned(), self.t_s),
            ("terminal.level".to_owned(), self.terminal.level),
        ])?;
        let states = self.state_limits.iter().enumerate();
        let states = states.map(|(i, limit)| (format!("state_limits[{i}]"), *limit));
        let inputs = self.input_limits.iter().enumerate();
        let inputs = inputs.map(|(i, limit)| (format!("input_limits[{i}]"), *limit));
        for (name, value) in states.chain(inputs) {
            if !(value == f64::INFINITY || SIZES.contains(&value)) {
                return Err(ClaimError::Value {
                    name,
                    value,
                    expected: "positive, from 1e-30 to 1e30, or null for none",
                });
            }
        }
        let value = self.terminal.contraction;
        if !(value == 0.0 || (1e-30..1.0).contains(&value)) {
            return Err(ClaimError::Value {
                name: "terminal.contraction".to_owned(),
                value,
                expected: "0, or from 1e-30 to below 1",
            });
        }
        Ok(())
    }
}

fn check_positive(numbers: impl IntoIterator<Item = (String, f64)>) -> Result<(), ClaimError> {
    for (name, value) in numbers {
        if !SIZES.contains(&value) {
            return Err(ClaimError::Value {
                name,
                value,
                expected: "positive, from 1e-30 to 1e30",
            });
        }
    }
    Ok(())
}

fn check_definite(name: &'static str, shown: bool) -> Result<(), ClaimError> {
    shown.then_some(()).ok_or(ClaimError::NotPositive { name })
}

/// Whether `larger` - `smaller` is positive semidefinite: shown in interval arithmetic, so that
/// `true` can be relied on. A semidefinite difference without inverse is recognised where whole
/// rows of it are zero, as with diagonal weights; another one is taken for unknown, `false`. So is
/// a matrix that is not symmetric to the bit.
pub fn is_at_most<const N: usize>(
    smaller: &SMatrix<f64, N, N>,
    larger: &SMatrix<f64, N, N>,
) -> bool {
    let symmetric = *smaller == smaller.transpose() && *larger == larger.transpose();
    let point = |m: &SMatrix<f64, N, N>, i, j| Interval::point(m[(i, j)]);
    let zero = Interval::point(0.0);
    let mut rest: Square<N> = from_fn(|i, j| {
        if smaller[(i, j)] == larger[(i, j)] {
            zero
        } else {
            point(larger, i, j) - point(smaller, i, j)
        }
    });
    for (i, row) in rest.iter_mut().enumerate() {
        if row.iter().all(|entry| *entry == zero) {
            row[i] = Interval::point(1.0);
        }
    }
    symmetric && is_positive_definite(&rest)
}

fn check_sizes<const R: usize, const C: usize>(
    name: &str,
    m: &SMatrix<f64, R, C>,
) -> Result<(), ClaimError> {
    for row in 0..R {
        for column in 0..C {
            let value = m[(row, column)];
            if !(value == 0.0 || SIZES.contains(&value.abs())) {
                return Err(ClaimError::Value {
                    name: format!("{name}[{row}][{column}]"),
                    value,
                    expected: "0, or of a size from 1e-30 to 1e30",
                });
            }
        }
    }
    Ok(())
}

fn check_symmetric<const N: usize>(
    name: &'static str,
    m: &SMatrix<f64, N, N>,
) -> Result<(), ClaimError> {
    for row in 0..N {
        for column in 0..row {
            let (value, mirrored) = (m[(row, column)], m[(column, row)]);
            if value != mirrored {
                return Err(ClaimError::NotSymmetric {
                    name,
                    row,
                    column,
                    value,
                    mirrored,
                });
            }
        }
    }
    Ok(())
}
