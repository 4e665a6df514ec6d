//! The end of the horizon as a problem of its own.

use super::side::BoundSide;
use crate::model::Scalar;
use crate::ocp::Ocp;
use crate::rows::Trajectory;
use crate::solution::{BoundId, Quantity};
use crate::transposed::{StageBothWays, Transposed};
use nalgebra::SVector;

/// The stages of the problem from one on, and the state that is given there. Factors, inputs and states keep their
/// places along the whole horizon.
#[derive(Clone, Copy)]
pub(super) struct Span<'a, T: 'static, const NX: usize, const NU: usize> {
    pub ocp: &'a Ocp<T, NX, NU>,
    pub begin: usize,
    pub start: SVector<T, NX>,
    /// The matrices of all stages transposed, of as many as there are places for.
    pub transposed: &'a [Transposed<T, NX, NU>],
}

impl<'a, T: Scalar, const NX: usize, const NU: usize> Span<'a, T, NX, NU> {
    /// All of the horizon.
    pub fn whole(ocp: &'a Ocp<T, NX, NU>, transposed: &'a [Transposed<T, NX, NU>]) -> Self {
        Self {
            ocp,
            begin: 0,
            start: ocp.x0,
            transposed,
        }
    }

    /// Its stages, each with its number.
    #[inline(always)]
    pub fn stages(
        &self,
    ) -> impl DoubleEndedIterator<Item = (usize, StageBothWays<'a, T, NX, NU>)>
    + ExactSizeIterator
    + use<'a, T, NX, NU> {
        let numbers = self.begin..self.ocp.length();
        let stages = self.ocp.stages.get(numbers.clone());
        let transposed = self.transposed;
        numbers
            .zip(stages.unwrap_or_default())
            .map(move |(i, stage)| (i, StageBothWays::new(stage).with(transposed, i)))
    }

    /// What belongs to its stages, out of what belongs to all of them.
    pub fn of<'b, V>(&self, all: &'b [V]) -> &'b [V] {
        all.get(self.begin..).unwrap_or_default()
    }

    /// [`of`](Self::of) for what is to change.
    pub fn of_mut<'b, V>(&self, all: &'b mut [V]) -> &'b mut [V] {
        all.get_mut(self.begin..).unwrap_or_default()
    }

    /// The bounds that have to do with its inputs, out of those of all stages.
    pub fn sides<'b>(&self, all: &'b mut [BoundSide<T>]) -> &'b mut [BoundSide<T>] {
        let before = all.partition_point(|side| {
            let BoundId {
                stage, quantity, ..
            } = side.bound;
            stage < self.begin || (stage == self.begin && matches!(quantity, Quantity::State(_)))
        });
        all.get_mut(before..).unwrap_or_default()
    }

    /// x_`stage` on a trajectory from its start.
    pub fn state<'b>(
        &'b self,
        trajectory: &Trajectory<'b, T, NX, NU>,
        stage: usize,
    ) -> &'b SVector<T, NX> {
        let later = stage.checked_sub(1).filter(|_| stage > self.begin);
        let later = later.and_then(|before| trajectory.x.get(before));
        later.unwrap_or(&self.start)
    }
}
