//! A planner whose kind is chosen when the program runs.

use super::guaranteed::Guaranteed;
use super::held::Held;
use super::planner::{Planned, Planner};
use super::ramped::Ramped;
use crate::controller::Reference;
use crate::guaranteed::GuaranteedWorkspace;
use crate::model::{LpvModel, Scalar};
use crate::ocp::Bounds;
use crate::solution::BoundId;
use crate::workspace::Workspace;
use nalgebra::SVector;

/// Any of the planners, with a workspace of its own; `NXU` is `NX` + `NU`, `NA` is `NX` + 1.
///
/// Where the kind is known beforehand, take the planner itself: a microcontroller then has no code
/// for the others, and one workspace for several.
#[derive(Debug)]
#[cfg_attr(feature = "alloc", derive(Clone))]
#[allow(
    clippy::large_enum_variant,
    reason = "there is one per plane, and without a heap no box to put the largest in"
)]
pub enum AnyPlanner<
    P,
    T: 'static,
    const NX: usize,
    const NU: usize,
    const NS: usize,
    const NXU: usize,
    const NA: usize,
> {
    /// The input is held over a sample.
    Held(Held<P, T, NX, NU, NS>, Workspace<T, NX, NU>),
    /// The input moves in ramps.
    Ramped(Ramped<P, T, NX, NU, NS, NXU>, Workspace<T, NXU, NU>),
    /// The input is held, and backed by a certificate.
    Guaranteed(
        Guaranteed<P, T, NX, NU, NS, NA>,
        GuaranteedWorkspace<T, NU, NA>,
    ),
}

/// The same of whichever it is.
macro_rules! of_any {
    ($any:expr, $planner:ident => $answer:expr) => {
        match $any {
            AnyPlanner::Held($planner, _) => $answer,
            AnyPlanner::Ramped($planner, _) => $answer,
            AnyPlanner::Guaranteed($planner, _) => $answer,
        }
    };
}

impl<P, T, const NX: usize, const NU: usize, const NS: usize, const NXU: usize, const NA: usize>
    Planner<T, NX, NU> for AnyPlanner<P, T, NX, NU, NS, NXU, NA>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS> + PartialEq,
{
    /// It has its own.
    type Workspace = ();

    fn t_s(&self) -> T {
        of_any!(self, planner => planner.t_s())
    }

    fn horizon(&self) -> usize {
        of_any!(self, planner => planner.horizon())
    }

    fn plan(
        &mut self,
        z: &SVector<T, NX>,
        disturbance: &SVector<T, NU>,
        allowed: &Bounds<T, NU>,
        reference: &Reference<'_, T, NX>,
        (): &mut (),
    ) -> Planned<T, NX> {
        match self {
            Self::Held(planner, workspace) => {
                planner.plan(z, disturbance, allowed, reference, workspace)
            }
            Self::Ramped(planner, workspace) => {
                planner.plan(z, disturbance, allowed, reference, workspace)
            }
            Self::Guaranteed(planner, workspace) => {
                planner.plan(z, disturbance, allowed, reference, workspace)
            }
        }
    }

    fn input(&mut self, period: T) -> SVector<T, NU> {
        of_any!(self, planner => planner.input(period))
    }

    fn next_of_ramp(&mut self, period: T) -> Option<SVector<T, NU>> {
        of_any!(self, planner => planner.next_of_ramp(period))
    }

    fn next_input(&self) -> Option<SVector<T, NU>> {
        of_any!(self, planner => planner.next_input())
    }

    fn cost(&self, z: &SVector<T, NX>, reference: &Reference<'_, T, NX>) -> T {
        of_any!(self, planner => planner.cost(z, reference))
    }

    fn predicted(&self, i: usize) -> Option<SVector<T, NX>> {
        of_any!(self, planner => planner.predicted(i))
    }

    fn active_bound(&self, i: usize) -> Option<BoundId> {
        of_any!(self, planner => planner.active_bound(i))
    }

    fn forget_plan(&mut self) {
        of_any!(self, planner => planner.forget_plan())
    }

    fn rest_at(&mut self, commanded: &SVector<T, NU>) {
        of_any!(self, planner => planner.rest_at(commanded));
    }

    /// One of another kind leaves nothing but the input.
    fn take_over(&mut self, previous: &Self, commanded: &SVector<T, NU>) {
        match (self, previous) {
            (Self::Held(planner, _), Self::Held(before, _)) => {
                planner.take_over(before, commanded);
            }
            (Self::Ramped(planner, _), Self::Ramped(before, _)) => {
                planner.take_over(before, commanded);
            }
            (Self::Guaranteed(planner, _), Self::Guaranteed(before, _)) => {
                planner.take_over(before, commanded);
            }
            (Self::Ramped(planner, _), _) => planner.rest_at(commanded),
            (Self::Held(..) | Self::Guaranteed(..), _) => {}
        }
    }

    fn largest_inputs(&self) -> Option<SVector<T, NU>> {
        of_any!(self, planner => planner.largest_inputs())
    }
}
