//! The memory of the phase for many active bounds, lent or on the heap.

use super::interior_point::BoundUnknowns;
use super::side::BoundSide;
use super::{ManyBounds, ManyBoundsPlace};
use crate::list::List;
#[cfg(all(feature = "alloc", not(target_arch = "wasm32")))]
use crate::memory::Capacity;
use crate::memory::SolverMemory;
use crate::model::Scalar;
#[cfg(all(feature = "alloc", not(target_arch = "wasm32")))]
use crate::products;
use crate::riccati::StageFactor;
#[cfg(all(feature = "alloc", not(target_arch = "wasm32")))]
use crate::transposed::Transposed;
use nalgebra::SVector;

/// Memory with which problems with many active bounds are solved in less time, for `N` stages and `B` finite
/// sides of bounds: twice the bounded states, inputs and general rows of all stages as a rule. On
/// the heap it is always there, but for WebAssembly. Where it is not, neither is its machine code; the
/// answers are the same.
#[derive(Debug)]
pub struct ManyBoundsArrays<
    T: 'static,
    const NX: usize,
    const NU: usize,
    const N: usize,
    const B: usize,
> {
    places: [Place<T, NX, NU, N>; 2],
    sides: [BoundSide<T>; B],
    unknowns: [BoundUnknowns<T>; B],
    /// What is made of the others once they are lent.
    phase: [ManyBounds<T, NX, NU>; 1],
}

/// Factors and a trajectory, inputs and states.
type Place<T, const NX: usize, const NU: usize, const N: usize> = (
    [StageFactor<T, NX, NU>; N],
    [SVector<T, NU>; N],
    [SVector<T, NX>; N],
);

impl<T: Scalar, const NX: usize, const NU: usize, const N: usize, const B: usize> Default
    for ManyBoundsArrays<T, NX, NU, N, B>
{
    #[inline(always)]
    fn default() -> Self {
        Self {
            places: [(
                [StageFactor::zeros(); N],
                [SVector::zeros(); N],
                [SVector::zeros(); N],
            ); 2],
            sides: [BoundSide::empty(); B],
            unknowns: [BoundUnknowns::empty(); B],
            phase: [ManyBounds::new(
                core::array::from_fn(|_| ManyBoundsPlace::empty()),
                List::empty(),
                List::empty(),
                List::empty(),
            )],
        }
    }
}

impl<T: Scalar, const NX: usize, const NU: usize> SolverMemory<T, NX, NU> {
    /// The same for many active bounds, in problems of up to `N` stages whose bounds have up to `B` finite sides.
    pub fn with_many_bounds<const N: usize, const B: usize>(
        self,
        arrays: &'static mut ManyBoundsArrays<T, NX, NU, N, B>,
    ) -> Self {
        let ManyBoundsArrays {
            places,
            sides,
            unknowns,
            phase,
        } = arrays;
        let places = places.each_mut().map(|(factors, u, x)| ManyBoundsPlace {
            factors: List::Static(factors),
            u: List::Static(u),
            x: List::Static(x),
        });
        let (sides, unknowns) = (List::Static(sides), List::Static(unknowns));
        *phase = [ManyBounds::new(places, sides, unknowns, List::empty())];
        Self {
            many_bounds: List::Static(phase),
            ..self
        }
    }
}

#[cfg(all(feature = "alloc", not(target_arch = "wasm32")))]
impl<T: Scalar, const NX: usize, const NU: usize> ManyBounds<T, NX, NU> {
    /// As much as is needed, on the heap.
    pub fn allocate(capacity: Capacity) -> Self {
        let stages = capacity.stages;
        let transposed = if products::are_in_vectors(NX) {
            stages
        } else {
            0
        };
        let bounds = (stages + 1) * (NX + NU + capacity.general_rows);
        let place = || ManyBoundsPlace {
            factors: List::repeat(StageFactor::zeros(), stages),
            u: List::repeat(SVector::zeros(), stages),
            x: List::repeat(SVector::zeros(), stages),
        };
        Self::new(
            [place(), place()],
            List::repeat(BoundSide::empty(), 2 * bounds),
            List::repeat(BoundUnknowns::empty(), bounds),
            List::repeat(Transposed::zeros(), transposed),
        )
    }
}
