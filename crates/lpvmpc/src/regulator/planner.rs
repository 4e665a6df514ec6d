//! What plans the input of a plant from its state.

use crate::controller::Reference;
use crate::model::Scalar;
use crate::ocp::Bounds;
use crate::solution::{BoundId, Status};
use nalgebra::SVector;

use super::Guarantee;

/// What is to be said about a plan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Planned<T, const NX: usize> {
    /// What it is worth.
    pub status: Status<T>,
    /// Bounds that are active in it.
    pub active_bounds: usize,
    /// Nonlinear rollout minus prediction at the end of the horizon, in state units.
    pub gap: SVector<T, NX>,
    /// What only a guaranteed controller knows.
    pub guarantee: Option<Guarantee<T>>,
}

/// Plans the input of a plant of `NX` states and `NU` inputs.
pub trait Planner<T: Scalar, const NX: usize, const NU: usize> {
    /// Scratch memory of a plan, which planners that run one after the other may share.
    type Workspace;

    /// Sampling time, s.
    fn t_s(&self) -> T;

    /// Samples of the horizon.
    fn horizon(&self) -> usize;

    /// Plans from `z`, the state in the model's coordinates at which the input will act. The
    /// model's input is the commanded one and the `disturbance`, so the bounds of the commanded
    /// one, `allowed`, are shifted by that.
    fn plan(
        &mut self,
        z: &SVector<T, NX>,
        disturbance: &SVector<T, NU>,
        allowed: &Bounds<T, NU>,
        reference: &Reference<'_, T, NX>,
        workspace: &mut Self::Workspace,
    ) -> Planned<T, NX>;

    /// The input to be commanded after a [`plan`](Self::plan), held for the coming `period` s or,
    /// where it moves in a ramp, in the middle of that.
    fn input(&mut self, period: T) -> SVector<T, NU>;

    /// The next input of a ramp, in the middle of the coming `period` s; `None` while it is held.
    fn next_of_ramp(&mut self, _period: T) -> Option<SVector<T, NU>> {
        None
    }

    /// Where the input is at the next sample while it moves in a ramp; `None` while it is held.
    fn next_input(&self) -> Option<SVector<T, NU>> {
        None
    }

    /// The cost J of the last plan, made from `z` along the `reference`.
    fn cost(&self, z: &SVector<T, NX>, reference: &Reference<'_, T, NX>) -> T;

    /// The state that the model reaches under the last plan `i` + 1 samples later.
    fn predicted(&self, i: usize) -> Option<SVector<T, NX>>;

    /// The bound `i` of those that are active in the last plan, as one of the plant; the rate of an
    /// input counts as another input, after the plant's.
    fn active_bound(&self, i: usize) -> Option<BoundId>;

    /// Forgets the last plan: the next one is made without it.
    fn forget_plan(&mut self);

    /// There is no state to plan for: the input that was `commanded` stays. A held one does so anyway.
    fn rest_at(&mut self, _commanded: &SVector<T, NU>) {}

    /// Goes on from the plan of another planner, whose input is `commanded` at the next sample.
    fn take_over(&mut self, previous: &Self, commanded: &SVector<T, NU>);

    /// The largest magnitude of each input that the last plan commands; `None` from one whose bounds
    /// must not change from sample to sample.
    fn largest_inputs(&self) -> Option<SVector<T, NU>> {
        None
    }
}

/// The bounds of the commanded input as those of the model's, which has the `disturbance` on top.
pub(super) fn shifted<T: Scalar, const NU: usize>(
    allowed: &Bounds<T, NU>,
    disturbance: &SVector<T, NU>,
) -> Bounds<T, NU> {
    Bounds {
        lower: allowed.lower + disturbance,
        upper: allowed.upper + disturbance,
    }
}
