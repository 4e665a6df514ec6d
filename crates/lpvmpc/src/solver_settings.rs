//! What the solver may be told: how exact its answer is, how long it searches, and where it begins.

use crate::many_bounds::cap_with_later_turn;
use crate::model::Scalar;
use crate::ocp::Ocp;
use nalgebra::convert;

/// Settings of the solver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolverSettings<T> {
    /// A bound may be violated by this much, relative to its own size. Default, also in place of
    /// what is no positive number: eps^(2/3) of the number type, 4e-11 for `f64` and 2e-5 for
    /// `f32`. Where bounds depend on each other
    /// so strongly that rounding decides, sqrt(eps) is let through (1.5e-8 and 3.5e-4); an
    /// input is within its bounds to the last bit all the same.
    pub tolerance: T,
    /// The search ends after this many changes of the active set. Default, `None`: ten for every
    /// state, input and general row of every stage in use, and 96 for every state and input at least.
    ///
    /// That is measured, not proved: of 2424 searches on random problems with horizons of 1 to 200 none
    /// was ended by it, and half of those of each size need less than 4 % of it (`tests/it/solver/changes.rs`).
    pub max_changes: Option<usize>,
    /// What the active set of the previous solution is used for. Default: shifted.
    pub warm_start: WarmStart,
}

pub(crate) fn default_cap<T: Scalar, const NX: usize, const NU: usize>(
    ocp: &Ocp<T, NX, NU>,
) -> usize {
    let rows = (NX + NU).saturating_add(ocp.rows_per_stage);
    let by_rows = rows.saturating_mul(CHANGES_PER_ROW * ocp.length());
    by_rows.max(cap_with_later_turn(NX + NU))
}

/// Where the search for the active set begins. It changes the time, never the answer. Where the previous active set has
/// been of little use, the next few searches begin with those of its rows alone that the trajectory without bounds
/// violates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WarmStart {
    /// From nothing.
    Cold,
    /// From the previous active set, at the same stages.
    Same,
    /// From the previous active set, one stage earlier: the horizon has moved on.
    Shifted,
}

/// Changes of the active set for every state, input and general row of a stage, by default.
const CHANGES_PER_ROW: usize = 10;

#[inline(never)]
pub(crate) fn default_tolerance<T: Scalar>() -> T {
    T::default_epsilon().powf(convert(2.0 / 3.0))
}

impl<T: Scalar> Default for SolverSettings<T> {
    fn default() -> Self {
        Self {
            tolerance: default_tolerance(),
            max_changes: None,
            warm_start: WarmStart::Shifted,
        }
    }
}
