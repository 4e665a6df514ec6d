//! The optimal control problem of one sample: a quadratic program with the structure of time.

use crate::list::List;
use crate::model::Scalar;
use crate::small_matrix::add_product;
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

impl<T: Scalar> Penalty<T> {
    /// Whether both parts are finite and not negative.
    pub(crate) fn makes_sense(&self) -> bool {
        let parts = [self.linear, self.quadratic];
        { parts.iter() }.all(|part| *part >= T::zero() && part.is_finite())
    }

    /// The price of the excess `s` >= 0.
    pub(crate) fn of(&self, s: T) -> T {
        (self.linear + self.quadratic * s * convert(0.5)) * s
    }
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
pub type SoftBounds<T, const K: usize> = [Option<Penalty<T>>; K];

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
        let (lower, upper) = (&self.lower.data.0[0], &self.upper.data.0[0]);
        let sides = lower.iter().zip(upper);
        let value = &value.data.0[0];
        let mut values = value.iter().zip(sides);
        if cfg!(feature = "alloc") {
            // Without early exit the comparisons need no branches.
            values.fold(true, |hold, (v, (lower, upper))| {
                hold & (*v >= *lower) & (*v <= *upper)
            })
        } else {
            values.all(|(v, (lower, upper))| *v >= *lower && *v <= *upper)
        }
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
/// bounds    on x_i (not at i = 0, where x is given), on u_i, and on general rows
/// ```
///
/// `NX` states, `NU` inputs. What is here changes along the horizon as a rule; weights and bounds, which
/// do not, are the [`Common`] part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stage<T, const NX: usize, const NU: usize> {
    /// State matrix A, `NX` x `NX`.
    pub a: SMatrix<T, NX, NX>,
    /// Input matrix B, `NX` x `NU`.
    pub b: SMatrix<T, NX, NU>,
    /// Affine term c, `NX`.
    pub c: SVector<T, NX>,
    /// Linear cost on the state, `NX`; `-Q x_ref` when tracking.
    pub linear_x: SVector<T, NX>,
    /// Linear cost on the input, `NU`.
    pub linear_u: SVector<T, NU>,
}

/// Weights and bounds of a stage, as a rule the same at all of them. Q is symmetric positive
/// semidefinite, R symmetric, and R + B'PB positive definite along the horizon.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Common<T, const NX: usize, const NU: usize> {
    /// State weight Q, `NX` x `NX`.
    pub q: SMatrix<T, NX, NX>,
    /// Input weight R, `NU` x `NU`.
    pub r: SMatrix<T, NU, NU>,
    /// Cross weight S, `NU` x `NX`.
    pub s: SMatrix<T, NU, NX>,
    /// Bounds on the state.
    pub x: Bounds<T, NX>,
    /// Which of them are soft.
    pub soft_x: SoftBounds<T, NX>,
    /// Bounds on the input, always hard.
    pub u: Bounds<T, NU>,
}

/// A bounded linear combination of state and input: lower <= x'x_i + u'u_i <= upper. At the end of the
/// horizon, where there is no input, only the state's part counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GeneralRow<T, const NX: usize, const NU: usize> {
    /// Coefficients of the state.
    pub x: SVector<T, NX>,
    /// Coefficients of the input.
    pub u: SVector<T, NU>,
    /// Lower bound, `-infinity` where there is none.
    pub lower: T,
    /// Upper bound, `+infinity` where there is none.
    pub upper: T,
    /// `None`: both bounds are hard; `Some`: they may be exceeded at this price.
    pub soft: Option<Penalty<T>>,
}

/// The end of the horizon: cost x'Px/2 + linear_x'x, bounds and, if given, x_N = `equality`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Terminal<T, const NX: usize> {
    /// Terminal weight P, `NX` x `NX`, symmetric positive semidefinite.
    pub p: SMatrix<T, NX, NX>,
    /// Linear cost on the terminal state, `NX`.
    pub linear_x: SVector<T, NX>,
    /// Bounds on the terminal state.
    pub x: Bounds<T, NX>,
    /// Which of them are soft.
    pub soft_x: SoftBounds<T, NX>,
    /// The terminal state that must be reached exactly, if any (eq. (9) of the paper).
    pub equality: Option<SVector<T, NX>>,
}

/// The problem: from `x0`, choose the inputs of the first `horizon` stages.
#[derive(Debug, PartialEq)]
#[cfg_attr(feature = "alloc", derive(Clone))]
pub struct Ocp<T: 'static, const NX: usize, const NU: usize> {
    /// The given initial state.
    pub x0: SVector<T, NX>,
    /// The stages; those from `horizon` on are not read.
    pub stages: List<Stage<T, NX, NU>>,
    /// Weights and bounds of every stage that has none of its own.
    pub common: Common<T, NX, NU>,
    /// Weights and bounds of their own for the stages from 0 on; empty where they are all the same.
    pub own: List<Common<T, NX, NU>>,
    /// General rows, `rows_per_stage` of stage 0, then of stage 1, up to those of the end of the horizon.
    pub rows: List<GeneralRow<T, NX, NU>>,
    /// General rows of each stage and of the end; 0 as a rule.
    pub rows_per_stage: usize,
    /// The end of the horizon.
    pub terminal: Terminal<T, NX>,
    /// Stages in use; no more than there are, 0 counts as 1.
    pub horizon: usize,
}

impl<T: Scalar, const NX: usize, const NU: usize> Stage<T, NX, NU> {
    /// A stage with zero dynamics and no linear cost.
    pub fn new() -> Self {
        Self {
            a: SMatrix::zeros(),
            b: SMatrix::zeros(),
            c: SVector::zeros(),
            linear_x: SVector::zeros(),
            linear_u: SVector::zeros(),
        }
    }

    /// The next state, A x + B u + c.
    #[inline(always)]
    pub fn next(&self, x: &SVector<T, NX>, u: &SVector<T, NU>) -> SVector<T, NX> {
        let mut next = self.c;
        add_product(&mut next, &self.a, x);
        add_product(&mut next, &self.b, u);
        next
    }
}

impl<T: Scalar, const NX: usize, const NU: usize> Default for Stage<T, NX, NU> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Scalar, const NX: usize, const NU: usize> Default for Common<T, NX, NU> {
    /// Unit input weight, no other cost and no bounds.
    fn default() -> Self {
        Self {
            q: SMatrix::zeros(),
            r: SMatrix::identity(),
            s: SMatrix::zeros(),
            x: Bounds::none(),
            soft_x: [None; NX],
            u: Bounds::none(),
        }
    }
}

impl<T: Scalar, const NX: usize, const NU: usize> Default for GeneralRow<T, NX, NU> {
    /// A row that bounds nothing.
    fn default() -> Self {
        let infinity: T = convert(f64::INFINITY);
        Self {
            x: SVector::zeros(),
            u: SVector::zeros(),
            lower: -infinity,
            upper: infinity,
            soft: None,
        }
    }
}

impl<T: Scalar, const NX: usize, const NU: usize> GeneralRow<T, NX, NU> {
    /// Whether the row can be met or missed at the beginning, where the state is given, or at the end,
    /// where there is no input.
    pub(crate) fn counts(&self, beginning: bool, end: bool) -> bool {
        let of_state = self.u.iter().all(|entry| *entry == T::zero());
        if of_state { !beginning } else { !end }
    }

    /// x'x_i + u'u_i; without an input at the end of the horizon.
    pub(crate) fn value(&self, x: &SVector<T, NX>, u: Option<&SVector<T, NU>>) -> T {
        self.x.dot(x) + u.map_or(T::zero(), |u| self.u.dot(u))
    }
}

impl<T: Scalar, const NX: usize> Default for Terminal<T, NX> {
    /// No terminal cost, bounds or equality.
    fn default() -> Self {
        Self {
            p: SMatrix::zeros(),
            linear_x: SVector::zeros(),
            x: Bounds::none(),
            soft_x: [None; NX],
            equality: None,
        }
    }
}

impl<T: Scalar, const NX: usize, const NU: usize> Ocp<T, NX, NU> {
    /// From the origin, over as many stages as there is memory for, with the same weights and bounds at
    /// all of them and without general rows.
    pub fn new(stages: List<Stage<T, NX, NU>>) -> Self {
        Self {
            x0: SVector::zeros(),
            horizon: stages.len(),
            stages,
            common: Common::default(),
            own: List::empty(),
            rows: List::empty(),
            rows_per_stage: 0,
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

    /// Weights and bounds of stage `i`.
    #[inline(always)]
    pub fn common_at(&self, i: usize) -> &Common<T, NX, NU> {
        self.own.get(i).unwrap_or(&self.common)
    }

    /// General row `j` of stage `i`, from 0 to the end of the horizon, if there is one.
    #[inline]
    pub fn row(&self, i: usize, j: usize) -> Option<&GeneralRow<T, NX, NU>> {
        self.rows_of(i).get(j)
    }

    /// General rows of stage `i`, from 0 to the end of the horizon.
    pub(crate) fn rows_of(&self, i: usize) -> &[GeneralRow<T, NX, NU>] {
        let count = self.rows_per_stage;
        let first = i.checked_mul(count);
        let range = first.and_then(|first| Some(first..first.checked_add(count)?));
        let rows = range.and_then(|range| self.rows.get(range));
        rows.unwrap_or_default()
    }
}
