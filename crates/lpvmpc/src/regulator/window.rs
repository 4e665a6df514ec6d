//! The reference over a horizon.

use crate::controller::Reference;
use crate::list::List;
use crate::model::Scalar;
use crate::working_set::copy;
use nalgebra::SVector;

/// A reference that was looked up for one sample.
#[derive(Debug)]
#[cfg_attr(feature = "alloc", derive(Clone))]
pub(super) struct Window<T: 'static, const NX: usize> {
    stages: List<SVector<T, NX>>,
    /// Stages that were looked up; the terminal reference holds from there on.
    seen: usize,
    terminal: SVector<T, NX>,
}

impl<T: Scalar, const NX: usize> Window<T, NX> {
    /// A window of as many stages as there is memory for.
    pub(super) fn new(stages: List<SVector<T, NX>>) -> Self {
        Self {
            stages,
            seen: 0,
            terminal: SVector::zeros(),
        }
    }

    /// Looks the reference `at` every stage of the `horizon` up, and at its end.
    pub(super) fn look(&mut self, horizon: usize, at: impl Fn(usize) -> SVector<T, NX>) {
        self.seen = horizon.min(self.stages.len());
        for (i, place) in self.stages.iter_mut().take(self.seen).enumerate() {
            *place = at(i);
        }
        self.terminal = at(horizon);
    }

    /// The same reference at all times.
    pub(super) fn hold(&mut self, x_ref: SVector<T, NX>) {
        (self.seen, self.terminal) = (0, x_ref);
    }

    /// What another window has seen, as far as there is memory for.
    pub(super) fn copy_from(&mut self, other: &Self) {
        copy(&mut self.stages, &other.stages);
        self.seen = other.seen.min(self.stages.len());
        self.terminal = other.terminal;
    }

    pub(super) fn reference(&self) -> Reference<'_, T, NX> {
        Reference {
            stages: self.stages.get(..self.seen).unwrap_or_default(),
            terminal: self.terminal,
        }
    }
}
