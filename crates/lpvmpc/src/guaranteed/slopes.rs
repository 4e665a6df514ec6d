//! The derivatives of the prediction along plans, kept from plan to plan.
//!
//! A program is linear along a plan, and a plan is judged by how deviations from it move on: both need the
//! derivatives of every sample, which take longer than anything else but the rollout. From plan to plan, and
//! from sample to sample, one stage earlier, most samples hardly change.

use super::{GuaranteedSettings, Planner};
use crate::model::{LpvModel, Scalar};
use crate::ocp::Bounds;
use nalgebra::{SMatrix, SVector, convert};

/// A and B of a sample.
pub(super) type Slopes<T, const NX: usize, const NU: usize> =
    (SMatrix<T, NX, NX>, SMatrix<T, NX, NU>);

/// Samples whose states and inputs are as near as this, as a part of the bounds' width, count as having the same
/// derivatives. What the derivatives are then off by adds to the error of their Runge-Kutta steps; a test shows
/// how much that is for the ballbot.
pub const NEAR_SAMPLES: f64 = 3e-4;

/// The derivatives of the prediction over a sample, and where they were worked out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampleSlopes<T, const NX: usize, const NU: usize> {
    x: SVector<T, NX>,
    u: SVector<T, NU>,
    pub(super) slopes: Slopes<T, NX, NU>,
}

impl<T: Scalar, const NX: usize, const NU: usize> SampleSlopes<T, NX, NU> {
    /// Of no sample yet: nothing is near to it.
    pub(super) fn unknown() -> Self {
        Self {
            x: SVector::repeat(convert(f64::NAN)),
            u: SVector::zeros(),
            slopes: (SMatrix::zeros(), SMatrix::zeros()),
        }
    }

    /// Whether they serve for the sample from `x` under `u`, wherever along the direction that is.
    fn serve(
        &self,
        x: &SVector<T, NX>,
        u: &SVector<T, NU>,
        settings: &GuaranteedSettings<T, NX, NU>,
    ) -> bool {
        let d = &settings.direction;
        let moved = x - self.x;
        let aside = moved - d * (moved.dot(d) / d.norm_squared());
        is_little(&aside, &settings.x) && is_little(&(u - self.u), &settings.u)
    }
}

/// Whether each component is a small part of its bounds; where it has none, nothing says how much is little.
fn is_little<T: Scalar, const K: usize>(move_by: &SVector<T, K>, bounds: &Bounds<T, K>) -> bool {
    let sides = bounds.lower.iter().zip(bounds.upper.iter());
    // Without early exit, so that the comparisons need no branches.
    move_by
        .iter()
        .zip(sides)
        .fold(true, |little, (move_by, (lower, upper))| {
            let most = (*upper - *lower) * convert(NEAR_SAMPLES);
            little & ((move_by.abs() <= most) & most.is_finite() | (*move_by == T::zero()))
        })
}

impl<P, T, const NX: usize, const NU: usize, const NS: usize> Planner<P, T, NX, NU, NS>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
{
    /// The derivatives of the prediction over the sample `i` of a plan, from `x` under `u`: those that are
    /// known of this sample or the one after it, where one is near.
    pub(super) fn slopes_at(
        &mut self,
        i: usize,
        x: &SVector<T, NX>,
        u: &SVector<T, NU>,
    ) -> Slopes<T, NX, NU> {
        let serves = |known: &SampleSlopes<T, NX, NU>| known.serve(x, u, &self.settings);
        // As a rule it is this sample's own, which stay where they are.
        if let Some(own) = self.slopes.get(i).filter(|own| serves(own)) {
            return own.slopes;
        }
        let next = self.slopes.get(i + 1).filter(|next| serves(next)).copied();
        let found = next.unwrap_or_else(|| SampleSlopes {
            x: *x,
            u: *u,
            slopes: self.differentiate(x, u),
        });
        if let Some(place) = self.slopes.get_mut(i) {
            *place = found;
        }
        found.slopes
    }

    /// The derivatives of the prediction over a sample.
    pub(super) fn differentiate(
        &self,
        x: &SVector<T, NX>,
        u: &SVector<T, NU>,
    ) -> Slopes<T, NX, NU> {
        let GuaranteedSettings { rk4, t_s, .. } = &self.settings;
        rk4.differentiate(&self.model, x, u, *t_s)
    }
}
