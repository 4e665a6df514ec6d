//! What a plan costs at least of which only the first samples are known: a rollout that is too dear
//! need not come to its end.

use super::GuaranteedSettings;
use super::aim::Aims;
use crate::model::Scalar;
use nalgebra::SVector;

/// Offset cost and stage costs so far, as a parabola over the move m of the plan's set point:
/// constant + 2 slope m + curvature m^2. What follows costs nothing or more.
pub(super) struct LeastCost<'a, T: 'static, const NX: usize, const NU: usize> {
    settings: &'a GuaranteedSettings<T, NX, NU>,
    aims: &'a Aims<T>,
    /// The set point from which it moves.
    near: T,
    constant: T,
    slope: T,
    curvature: T,
}

impl<'a, T: Scalar, const NX: usize, const NU: usize> LeastCost<'a, T, NX, NU> {
    /// Of no sample yet, seen from the set point `near`: far from zero, squares would leave no digits.
    pub fn new(settings: &'a GuaranteedSettings<T, NX, NU>, aims: &'a Aims<T>, near: T) -> Self {
        let (weight, offset) = (settings.offset_weight, near - aims.end);
        Self {
            settings,
            aims,
            near,
            constant: weight * offset * offset,
            slope: weight * offset,
            curvature: weight,
        }
    }

    /// With the sample `i` from `x` under `u`, too.
    pub fn add(&mut self, i: usize, x: &SVector<T, NX>, u: &SVector<T, NU>) {
        let (weights, d) = (&self.settings.weights, &self.settings.direction);
        let wanted = self.aims.stages.get(i).filter(|_| i < self.aims.changes);
        let error = x - d * *wanted.unwrap_or(&self.near);
        let pull = weights.q * error;
        self.constant += pull.dot(&error) + (weights.r * u).dot(u);
        if wanted.is_none() {
            self.slope -= pull.dot(d);
            self.curvature += (weights.q * d).dot(d);
        }
    }

    /// With the set point that is best for it.
    pub fn value(&self) -> T {
        self.constant - self.slope * self.slope / self.curvature
    }
}
