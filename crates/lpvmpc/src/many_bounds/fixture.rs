//! Memory for tests of the parts of the phase.

use super::ManyBoundsPlace;
use super::exchange::Program;
use super::interior_point::{AllUnknowns, BoundUnknowns};
use super::side::{self, BoundSide};
use super::span::Span;
use crate::list::List;
use crate::memory::Capacity;
use crate::ocp::Ocp;
use crate::riccati::StageFactor;
use crate::solver::Solver;
use alloc::vec;
use alloc::vec::Vec;
use core::cell::Cell;
use nalgebra::SVector;

/// What a program works with, for as many stages and rows of the dual method as there is room for.
pub(super) struct Fixture<const NX: usize, const NU: usize> {
    solver: Solver<f64, NX, NU>,
    places: [ManyBoundsPlace<f64, NX, NU>; 2],
    unknowns: Vec<BoundUnknowns<f64>>,
    spent: Cell<usize>,
}

impl<const NX: usize, const NU: usize> Fixture<NX, NU> {
    pub fn new(room: Capacity) -> Self {
        let place = || ManyBoundsPlace {
            factors: List::repeat(StageFactor::zeros(), room.stages),
            u: List::repeat(SVector::zeros(), room.stages),
            x: List::repeat(SVector::zeros(), room.stages),
        };
        Self {
            solver: Solver::allocate(room),
            places: [place(), place()],
            unknowns: vec![BoundUnknowns::empty(); 2 * (NX + NU) * (room.stages + 1)],
            spent: Cell::new(0),
        }
    }

    pub fn program<'a>(&'a mut self, span: Span<'a, f64, NX, NU>) -> Program<'a, f64, NX, NU> {
        let [place, spare] = &mut self.places;
        self.solver.dual.reset(1e-10, usize::MAX);
        Program {
            span,
            dual: &mut self.solver.dual,
            spent: &self.spent,
            most_spent: usize::MAX,
            factors: &mut place.factors,
            u: &mut place.u,
            x: &mut place.x,
            spare: (&mut spare.factors, &mut spare.u, &mut spare.x),
            unknowns: AllUnknowns::new(&mut self.unknowns),
        }
    }
}

/// The finite sides of all bounds of a problem.
pub(super) fn sides<const NX: usize, const NU: usize>(
    ocp: &Ocp<f64, NX, NU>,
) -> Vec<BoundSide<f64>> {
    let bounds = (NX + NU + ocp.rows_per_stage) * (ocp.length() + 1);
    let mut sides = vec![BoundSide::empty(); 2 * bounds];
    let count = side::collect(ocp, &mut sides).unwrap_or_default();
    sides.truncate(count);
    sides
}
