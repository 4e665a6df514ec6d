//! The optimal control problem of one sample: a quadratic program with the structure of time.

use crate::list::List;
use crate::model::Scalar;
use nalgebra::{SMatrix, SVector, convert};

/// The price of exceeding a soft bound by `s` (in the unit of the bounded quantity):
/// `linear * s + quadratic * s^2 / 2`.
///
/// A `linear` part above the multiplier of the hard bound makes the penalty exact: the bound
/// then holds whenever it can (Nocedal and Wright, Numerical Optimization, ch. 17.2).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Penalty<T> {
    /// Cost per unit of excess, >= 0 and finite.
    pub linear: T,
    /// Curvature of the cost of the excess, >= 0 and finite.
    pub quadratic: T,
}

/// Lower and upper bounds on `K` quantities; an infinite bound is absent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds<T, const K: usize> {
    /// Lower bounds, in the unit of the quantity; `-infinity` where there is none.
    pub lower: SVector<T, K>,
    /// Upper bounds, in the unit of the quantity; `+infinity` where there is none.
    pub upper: SVector<T, K>,
}

/// For each of `K` bounded quantities: `None`, the bounds are hard; `Some`, either of them may
/// be exceeded at this price.
pub type Softness<T, const K: usize> = [Option<Penalty<T>>; K];

impl<T: Scalar, const K: usize> Bounds<T, K> {
    /// No bounds at all.
    pub fn none() -> Self {
        let infinity: T = convert(f64::INFINITY);
        Self {
            lower: SVector::repeat(-infinity),
            upper: SVector::repeat(infinity),
        }
    }

    /// Whether every component of `value` lies within its bounds, with the margin `tolerance`
    /// (in the unit of the quantity).
    pub fn contains(&self, value: &SVector<T, K>, tolerance: T) -> bool {
        value
            .iter()
            .zip(self.lower.iter().zip(self.upper.iter()))
            .all(|(v, (lower, upper))| *v >= *lower - tolerance && *v <= *upper + tolerance)
    }

    /// Whether every component of `value` lies within its bounds; false for NaN.
    #[inline(always)]
    pub(crate) fn hold_at(&self, value: &SVector<T, K>) -> bool {
        let [lower, upper, value] =
            [&self.lower, &self.upper, value].map(|vector| &vector.data.0[0]);
        let sides = lower.iter().zip(upper);
        // Without early exit, so that the comparisons need no branches.
        value
            .iter()
            .zip(sides)
            .fold(true, |hold, (v, (lower, upper))| {
                hold & (*v >= *lower) & (*v <= *upper)
            })
    }

    /// `value` moved into the bounds; a component that is not finite becomes the admissible
    /// value nearest to zero.
    pub fn project(&self, value: &SVector<T, K>) -> SVector<T, K> {
        value.zip_zip_map(&self.lower, &self.upper, |v, lower, upper| {
            let finite = if v.is_finite() { v } else { T::zero() };
            let raised = if finite < lower { lower } else { finite };
            let inside = if raised > upper { upper } else { raised };
            if inside.is_finite() {
                inside
            } else {
                T::zero()
            }
        })
    }
}

/// One stage i of the horizon.
///
/// ```text
/// x_{i+1} = A x_i + B u_i + c
/// cost      x'Qx/2 + u'Sx + u'Ru/2 + linear_x'x + linear_u'u
/// bounds    on x_i (not at i = 0, where x is given), on u_i, on row_x x_i + row_u u_i
/// ```
///
/// `NX` states, `NU` inputs, `NG` general rows. Q is symmetric positive semidefinite, R
/// symmetric, and R + B'PB positive definite along the horizon.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stage<T, const NX: usize, const NU: usize, const NG: usize = 0> {
    /// State matrix A, `NX` x `NX`.
    pub a: SMatrix<T, NX, NX>,
    /// Input matrix B, `NX` x `NU`.
    pub b: SMatrix<T, NX, NU>,
    /// Affine term c, `NX`.
    pub c: SVector<T, NX>,
    /// State weight Q, `NX` x `NX`.
    pub q: SMatrix<T, NX, NX>,
    /// Input weight R, `NU` x `NU`.
    pub r: SMatrix<T, NU, NU>,
    /// Cross weight S, `NU` x `NX`.
    pub s: SMatrix<T, NU, NX>,
    /// Linear cost on the state, `NX`; `-Q x_ref` when tracking.
    pub linear_x: SVector<T, NX>,
    /// Linear cost on the input, `NU`.
    pub linear_u: SVector<T, NU>,
    /// Bounds on the state.
    pub x: Bounds<T, NX>,
    /// Bounds on the input, always hard.
    pub u: Bounds<T, NU>,
    /// State part of the general rows, `NG` x `NX`.
    pub row_x: SMatrix<T, NG, NX>,
    /// Input part of the general rows, `NG` x `NU`.
    pub row_u: SMatrix<T, NG, NU>,
    /// Bounds on the general rows.
    pub rows: Bounds<T, NG>,
    /// Which general rows are soft.
    pub soft_rows: Softness<T, NG>,
}

/// The end of the horizon: cost x'Px/2 + linear_x'x, bounds and, if given, x_N = `equality`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Terminal<T, const NX: usize, const NG: usize = 0> {
    /// Terminal weight P, `NX` x `NX`, symmetric positive semidefinite.
    pub p: SMatrix<T, NX, NX>,
    /// Linear cost on the terminal state, `NX`.
    pub linear_x: SVector<T, NX>,
    /// Bounds on the terminal state.
    pub x: Bounds<T, NX>,
    /// Which of them are soft.
    pub soft_x: Softness<T, NX>,
    /// General rows on the terminal state, `NG` x `NX`.
    pub row_x: SMatrix<T, NG, NX>,
    /// Bounds on the general rows.
    pub rows: Bounds<T, NG>,
    /// Which general rows are soft.
    pub soft_rows: Softness<T, NG>,
    /// The terminal state that must be reached exactly, if any (eq. (9) of the paper).
    pub equality: Option<SVector<T, NX>>,
}

/// The problem: from `x0`, choose the inputs of the first `horizon` stages.
#[derive(Debug, PartialEq)]
#[cfg_attr(feature = "alloc", derive(Clone))]
pub struct Ocp<T: 'static, const NX: usize, const NU: usize, const NG: usize = 0> {
    /// The given initial state.
    pub x0: SVector<T, NX>,
    /// The stages; those from `horizon` on are not read.
    pub stages: List<Stage<T, NX, NU, NG>>,
    /// Which state bounds of the stages are soft, at the same price at all of them.
    pub soft_x: Softness<T, NX>,
    /// The end of the horizon.
    pub terminal: Terminal<T, NX, NG>,
    /// Stages in use; no more than there are, 0 counts as 1.
    pub horizon: usize,
}

impl<T: Scalar, const NX: usize, const NU: usize, const NG: usize> Stage<T, NX, NU, NG> {
    /// A stage with zero dynamics, unit input weight, no other cost and no bounds.
    pub fn new() -> Self {
        Self {
            a: SMatrix::zeros(),
            b: SMatrix::zeros(),
            c: SVector::zeros(),
            q: SMatrix::zeros(),
            r: SMatrix::identity(),
            s: SMatrix::zeros(),
            linear_x: SVector::zeros(),
            linear_u: SVector::zeros(),
            x: Bounds::none(),
            u: Bounds::none(),
            row_x: SMatrix::zeros(),
            row_u: SMatrix::zeros(),
            rows: Bounds::none(),
            soft_rows: [None; NG],
        }
    }
}

impl<T: Scalar, const NX: usize, const NU: usize, const NG: usize> Default
    for Stage<T, NX, NU, NG>
{
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Scalar, const NX: usize, const NG: usize> Default for Terminal<T, NX, NG> {
    /// No terminal cost, bounds or equality.
    fn default() -> Self {
        Self {
            p: SMatrix::zeros(),
            linear_x: SVector::zeros(),
            x: Bounds::none(),
            soft_x: [None; NX],
            row_x: SMatrix::zeros(),
            rows: Bounds::none(),
            soft_rows: [None; NG],
            equality: None,
        }
    }
}

impl<T: Scalar, const NX: usize, const NU: usize, const NG: usize> Ocp<T, NX, NU, NG> {
    /// From the origin, over as many stages as there is memory for.
    pub fn new(stages: List<Stage<T, NX, NU, NG>>) -> Self {
        Self {
            x0: SVector::zeros(),
            horizon: stages.len(),
            stages,
            soft_x: [None; NX],
            terminal: Terminal::default(),
        }
    }

    /// The same on the heap, with default stages.
    #[cfg(feature = "alloc")]
    pub fn allocate(stages: usize) -> Self {
        Self::new(List::repeat(Stage::new(), stages))
    }

    /// Stages in use, at least 1.
    pub fn length(&self) -> usize {
        self.horizon.max(1).min(self.stages.len())
    }
}
