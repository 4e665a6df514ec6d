//! Validated numerics: enclosures that hold in spite of rounding.
//!
//! A model's formulas, written once over [`lpvmpc::Number`], are evaluated on [`Interval`]s (all
//! values in a range), on [`TaylorModel`]s (all values over a box, with their dependence on the
//! box) and on power series of either (the motion over time).

mod composition;
mod elementary;
mod flow;
mod interval;
mod motion;
mod positive;
mod rows;
mod runge_kutta;
mod series;
mod sinc;
mod taylor_map;
mod taylor_model;

pub use elementary::Arithmetic;
pub use flow::{Ball, FlowError, Frame, SampleEnclosure, SampledLaw};
pub use interval::Interval;
pub(crate) use positive::{is_positive_definite, smallest_eigenvalue};
pub(crate) use rows::{from_fn, product, transposed};
pub(crate) use runge_kutta::ScaledPlant;
pub use taylor_map::TaylorMap;
pub use taylor_model::TaylorModel;

/// Columns of a matrix with `N` rows.
pub(crate) type Columns<T, const N: usize> = Vec<[T; N]>;
