//! An output feedback with a workspace of its own.

use super::output_feedback::OutputFeedback;
use super::planner::Planner;
use super::{Command, Measurement, Regulator};
use crate::estimator::Observation;
use crate::model::{LpvModel, Scalar};
use crate::solution::BoundId;
use nalgebra::SVector;

/// An [`OutputFeedback`] that shares its workspace with nobody.
#[derive(Clone, Debug)]
pub struct Standalone<F, W> {
    /// The feedback.
    pub feedback: F,
    /// The workspace of its planner.
    pub workspace: W,
}

impl<P, K, T, const NX: usize, const NU: usize, const NS: usize, const NY: usize, const ND: usize>
    Regulator<T, NX, NU, NY>
    for Standalone<OutputFeedback<P, K, T, NX, NU, NS, NY, ND>, K::Workspace>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
    K: Planner<T, NX, NU>,
{
    fn t_s(&self) -> T {
        self.feedback.t_s()
    }

    fn observe(&mut self, measurement: &Measurement<T, NY>) -> Observation<NY> {
        self.feedback.observe(measurement)
    }

    fn decide(&mut self, reference: &dyn Fn(f64) -> SVector<T, NX>) -> Command<T, NX, NU> {
        self.feedback.decide(reference, &mut self.workspace)
    }

    fn between(&mut self) -> Option<SVector<T, NU>> {
        self.feedback.between()
    }

    fn take_over(&mut self, previous: &Self) {
        self.feedback.take_over(&previous.feedback);
    }

    fn cost(&self) -> T {
        self.feedback.cost()
    }

    fn predicted(&self, i: usize) -> Option<SVector<T, NX>> {
        self.feedback.predicted(i)
    }

    fn active_bound(&self, i: usize) -> Option<BoundId> {
        self.feedback.active_bound(i)
    }
}
