//! One sample of a rollout and of the plant from the same state, for all starts of a cell.

use super::claim::RolloutClaim;
use super::deviation;
use super::rays::Rays;
use crate::cover::{Cell, Finding};
use crate::enclosure::{FlowError, Interval, ScaledPlant, TaylorModel};
use lpvmpc::Embedding;

/// A sample of the rollout and of the plant from the same start.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EnclosedSample<const NX: usize> {
    /// The rollout's state less the plant's at the end, as a share of what the start has of the bounds; state units.
    pub error: [Interval; NX],
    /// How far the plant goes beyond the states of the rollout at both ends of a step, at most; state units.
    pub between: [f64; NX],
    /// Whether the rollout stays within the bounds, for certain.
    pub stays: bool,
}

/// The samples of a claim that start on `rays`.
pub(super) struct Samples<'a, M, const NX: usize, const NU: usize> {
    pub claim: &'a RolloutClaim<NX, NU>,
    pub rays: Rays<'a, M>,
}

/// A cell that is thinner is looked at in its middle, too, where it may be seen that no cut will help.
const THIN: f64 = 0.05;

impl<M, const NX: usize, const NU: usize> Samples<'_, M, NX, NU> {
    pub fn examine<const NS: usize, const D: usize>(&self, cell: &Cell<D>) -> Finding
    where
        M: Embedding<NX, NU, NS>,
    {
        let across = cell.half_widths.imax();
        match self.enclose(cell) {
            Ok(None) => return Finding::Outside,
            Ok(Some(sample)) => {
                let spare = self.spare(&sample, Interval::magnitude);
                // So that NaN fails.
                if spare >= 0.0 {
                    return Finding::Holds { spare };
                }
            }
            Err(_) => {}
        }
        if cell.half_widths.amax() < THIN
            && let Ok(Some(sample)) = self.enclose(&cell.middle())
        {
            let least = |error: Interval| error.lower.max(-error.upper);
            let errors_only = EnclosedSample {
                between: [0.0; NX],
                ..sample
            };
            if sample.stays && self.spare(&errors_only, least) < 0.0 {
                return Finding::Fails;
            }
            if sample.stays && self.spare(&sample, Interval::magnitude) < 0.0 {
                return Finding::Hopeless;
            }
        }
        Finding::Open { across }
    }

    /// How much of the claimed bounds is left, at least; below zero where they are exceeded.
    fn spare(&self, sample: &EnclosedSample<NX>, size: fn(Interval) -> f64) -> f64 {
        let (error, between) = (&self.claim.error, &self.claim.between);
        let spare = |i: usize| {
            let (off, beyond) = (size(sample.error[i]), sample.between[i]);
            // Where nothing is allowed, nothing is 0/0.
            let used = |value: f64, most: f64| if value <= 0.0 { 0.0 } else { value / most };
            1.0 - used(off, error[i]).max(used(beyond, between[i]))
        };
        (0..NX).map(spare).fold(f64::INFINITY, f64::min)
    }

    /// `None` where every rollout of the cell leaves the bounds.
    pub fn enclose<const NS: usize, const D: usize>(
        &self,
        cell: &Cell<D>,
    ) -> Result<Option<EnclosedSample<NX>>, FlowError>
    where
        M: Embedding<NX, NU, NS>,
    {
        let length = self.claim.step_length();
        let (ray, y) = self.rays.part(cell);
        let Some((states, stays)) = self.rollout(&ray, y) else {
            return Ok(None);
        };
        let farthest = Interval::point(ray.ranges().scale.magnitude());
        let mut error = [TaylorModel::from(Interval::point(0.0)); NX];
        let mut between = [0.0_f64; NX];
        for y in &states {
            let step = Step {
                ray: &ray,
                y,
                length,
            };
            let (next, sag) = step.enclose(&error)?;
            for i in 0..NX {
                let [before, after] = [error[i], next[i]].map(|error| error.range().magnitude());
                let room = Interval::point(before.max(after)) + Interval::point(sag[i]);
                between[i] = between[i].max((room * farthest).upper);
            }
            error = next;
        }
        Ok(Some(EnclosedSample {
            error: error.map(TaylorModel::range),
            between,
            stays,
        }))
    }

    /// The states y at the beginning of each step, and whether all stay within the bounds; `None` where all leave
    /// them.
    fn rollout<const NS: usize, const D: usize>(
        &self,
        ray: &ScaledPlant<'_, M, TaylorModel<D>, NU>,
        start: [TaylorModel<D>; NX],
    ) -> Option<(Vec<[TaylorModel<D>; NX]>, bool)>
    where
        M: Embedding<NX, NU, NS>,
    {
        let length = TaylorModel::from(self.claim.step_length());
        let bounds = &self.claim.x;
        let (mut states, mut y, mut stays) = (Vec::new(), start, true);
        for taken in 0..=self.claim.substeps {
            for (i, y) in y.iter().enumerate() {
                let x = (ray.scale * *y).range();
                if x.lower > bounds.upper[i] || x.upper < bounds.lower[i] {
                    return None;
                }
                stays &= x.lower >= bounds.lower[i] && x.upper <= bounds.upper[i];
            }
            if taken < self.claim.substeps {
                states.push(y);
                y = ray.step(&y, length);
            }
        }
        Some((states, stays))
    }
}

/// One step from the rollout's states `y`, and from the plant's nearby.
struct Step<'a, M, const NX: usize, const NU: usize, const D: usize> {
    ray: &'a ScaledPlant<'a, M, TaylorModel<D>, NU>,
    y: &'a [TaylorModel<D>; NX],
    length: Interval,
}

impl<M, const NX: usize, const NU: usize, const D: usize> Step<'_, M, NX, NU, D> {
    /// Rollout less plant after the step, from `error` on, and how far the plant goes beyond its own states at both
    /// ends.
    fn enclose<const NS: usize>(
        &self,
        error: &[TaylorModel<D>; NX],
    ) -> Result<([TaylorModel<D>; NX], [f64; NX]), FlowError>
    where
        M: Embedding<NX, NU, NS>,
    {
        let Self { ray, y, length } = *self;
        let ranges = ray.ranges();
        let start: [Interval; NX] =
            std::array::from_fn(|i| y[i].range().hull((y[i] - error[i]).range()));
        // Both motions, that from the rollout's state and that from the plant's, stay in this box.
        let coarse = ranges.during(&start, length.upper)?;
        let path = ray.path(y, length, &coarse);
        let errors = error.map(TaylorModel::range);
        let apart = deviation::during(&errors, &ranges.jacobian(&coarse), length)?;
        // On the straight line from one to the other.
        let near: [TaylorModel<D>; NX] = std::array::from_fn(|i| {
            path[i] - TaylorModel::from(apart[i].hull(Interval::point(0.0)))
        });
        let slopes = ray
            .jacobian(&near)
            .map(|row| row.map(TaylorModel::at_any_time));
        let carried = deviation::after(error, &slopes, &apart, length);
        let fresh = ray.error_of_step(y, length, &path);
        let next = std::array::from_fn(|i| carried[i] + fresh[i]);
        let motion = ray.coefficients(&near, 2);
        let sag = std::array::from_fn(|i| {
            let (rate, half_curvature) = (motion[1][i].range(), motion[2][i].range());
            // What only rises or only falls is between its ends; else it is within h^2/8 of the line through
            // them, per unit of curvature.
            if rate.lower > 0.0 || rate.upper < 0.0 {
                return 0.0;
            }
            (length * length * half_curvature * Interval::point(0.25)).magnitude()
        });
        Ok((next, sag))
    }
}
