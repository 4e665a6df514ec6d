//! The poles of A(s) - B(s) K with the scheduling s frozen at each point of a grid.

use crate::number_text;
use lpvmpc::LpvModel;
use nalgebra::{Complex, DMatrix, SMatrix, SVector};
use thiserror::Error;

use crate::matrix_check::{MatrixError, check_finite};
use crate::modes::poles;

/// A regular grid over the box `lower` <= s <= `upper` of scheduling values, its faces included.
#[derive(Debug, Clone, PartialEq)]
pub struct SchedulingGrid<const NS: usize> {
    lower: SVector<f64, NS>,
    upper: SVector<f64, NS>,
    points: [usize; NS],
}

/// A check over a scheduling grid that cannot be made.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum FrozenError {
    /// An end of the box is NaN or infinite, or the ends are in the wrong order.
    #[error(
        "scheduling {index} (counted from 0) ranges from {lower} to {upper}: \
         both ends must be finite, and the lower one not above the upper",
        lower = number_text(*lower),
        upper = number_text(*upper)
    )]
    Box {
        /// Component of the scheduling, counted from 0.
        index: usize,
        /// Its lower end.
        lower: f64,
        /// Its upper end.
        upper: f64,
    },
    /// Too few points to reach both ends.
    #[error(
        "scheduling {index} (counted from 0) has {points} grid points: \
         at least 2 are needed, or exactly 1 when both ends are equal"
    )]
    Points {
        /// Component of the scheduling, counted from 0.
        index: usize,
        /// The number of points asked for.
        points: usize,
    },
    /// The model's matrices at a grid point, or the gain, are not finite, or have no eigenvalues.
    #[error("at the scheduling {scheduling:?}: {source}")]
    Matrix {
        /// The grid point.
        scheduling: Vec<f64>,
        /// What is wrong there.
        source: MatrixError,
    },
}

impl<const NS: usize> SchedulingGrid<NS> {
    /// A grid with `points[i]` equally spaced values of scheduling i from `lower[i]` to
    /// `upper[i]`, both included, in the scheduling's units.
    ///
    /// # Errors
    /// An end is not finite, the ends are in the wrong order, or there are too few points.
    pub fn new(
        lower: SVector<f64, NS>,
        upper: SVector<f64, NS>,
        points: [usize; NS],
    ) -> Result<Self, FrozenError> {
        for index in 0..NS {
            let (lower, upper) = (lower[index], upper[index]);
            if !(lower.is_finite() && upper.is_finite() && lower <= upper) {
                return Err(FrozenError::Box {
                    index,
                    lower,
                    upper,
                });
            }
            let enough = points[index] >= 2 || (points[index] == 1 && lower == upper);
            if !enough {
                return Err(FrozenError::Points {
                    index,
                    points: points[index],
                });
            }
        }
        Ok(Self {
            lower,
            upper,
            points,
        })
    }

    /// The number of grid points.
    pub fn point_count(&self) -> usize {
        self.points.iter().fold(1, |all, n| all.saturating_mul(*n))
    }

    /// The grid points, the first component running fastest.
    pub fn points(&self) -> impl Iterator<Item = SVector<f64, NS>> + '_ {
        (0..self.point_count()).map(|number| self.point(number))
    }

    /// The middle of the box.
    pub fn middle(&self) -> SVector<f64, NS> {
        (self.lower + self.upper) * 0.5
    }

    fn point(&self, number: usize) -> SVector<f64, NS> {
        let mut rest = number;
        SVector::from_fn(|index, _| {
            let points = self.points[index];
            let position = rest % points;
            rest /= points;
            let last = points - 1;
            if position == last {
                // Exactly the end, where a rounded sum could pass it.
                self.upper[index]
            } else {
                let part = position as f64 / last as f64;
                self.lower[index] + part * (self.upper[index] - self.lower[index])
            }
        })
    }
}

/// The slowest frozen closed loop over a grid.
#[derive(Debug, Clone, PartialEq)]
pub struct FrozenStability<const NS: usize> {
    /// The largest real part of a pole of A(s) - B(s) K over the grid, 1/s.
    pub largest_real_part: f64,
    /// The pole that has it.
    pub pole: Complex<f64>,
    /// The scheduling where it occurs.
    pub scheduling: SVector<f64, NS>,
    /// The number of grid points checked.
    pub points: usize,
}

impl<const NS: usize> FrozenStability<NS> {
    /// Whether A(s) - B(s) K is Hurwitz at every grid point.
    pub fn is_hurwitz(&self) -> bool {
        self.largest_real_part < 0.0
    }
}

/// The Hurwitz check of A(s) - B(s) K with u = -K x, for each scheduling s of the grid (the check
/// of Karachalios and Abbas, section II-C).
///
/// It is necessary for a loop that must hold still at any scheduling, and **no proof for one that
/// moves**: each frozen loop decreases a quadratic function of its own, and without one that all
/// of them decrease, a scheduling that moves at the right moments feeds in more energy at its
/// changes than the loops take out between them. Nor does it say anything between the points.
///
/// # Errors
/// A matrix of the model or the gain is not finite, or its eigenvalues cannot be computed.
pub fn frozen_stability<M, const NX: usize, const NU: usize, const NS: usize>(
    model: &M,
    k: &SMatrix<f64, NU, NX>,
    grid: &SchedulingGrid<NS>,
) -> Result<FrozenStability<NS>, FrozenError>
where
    M: LpvModel<f64, NX, NU, NS>,
{
    let mut worst = FrozenStability {
        largest_real_part: f64::NEG_INFINITY,
        pole: Complex::from(f64::NEG_INFINITY),
        scheduling: grid.lower,
        points: grid.point_count(),
    };
    for scheduling in grid.points() {
        let pole = slowest_pole(model, k, &scheduling).map_err(|source| FrozenError::Matrix {
            scheduling: scheduling.as_slice().to_vec(),
            source,
        })?;
        if pole.re > worst.largest_real_part {
            worst.largest_real_part = pole.re;
            worst.pole = pole;
            worst.scheduling = scheduling;
        }
    }
    Ok(worst)
}

fn slowest_pole<M, const NX: usize, const NU: usize, const NS: usize>(
    model: &M,
    k: &SMatrix<f64, NU, NX>,
    scheduling: &SVector<f64, NS>,
) -> Result<Complex<f64>, MatrixError>
where
    M: LpvModel<f64, NX, NU, NS>,
{
    let (a, b) = model.matrices(scheduling);
    let closed_loop = a - b * k;
    let closed_loop = DMatrix::from_column_slice(NX, NX, closed_loop.as_slice());
    check_finite("A - B K", &closed_loop)?;
    let poles = poles(&closed_loop)?;
    poles.last().copied().ok_or(MatrixError::Empty {
        name: "A - B K",
        rows: NX,
        columns: NX,
    })
}
