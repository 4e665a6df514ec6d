//! The memory of an estimator: the instants that it remembers.

use super::Instant;
use crate::list::List;
use crate::model::Scalar;

/// Memory of an [`Estimator`](crate::Estimator): on the heap, or [lent](EstimatorArrays::lend) arrays.
#[derive(Debug)]
pub struct EstimatorMemory<
    T: 'static,
    const NX: usize,
    const NU: usize,
    const NY: usize,
    const ND: usize,
>(pub(super) List<Instant<T, NX, NU, NY, ND>>);

#[cfg(feature = "alloc")]
impl<T: Scalar, const NX: usize, const NU: usize, const NY: usize, const ND: usize>
    EstimatorMemory<T, NX, NU, NY, ND>
{
    /// For so many `instants`, on the heap.
    pub fn allocate(instants: usize) -> Self {
        Self(List::repeat(Instant::new(None), instants))
    }
}

/// The same as arrays, for `K` instants.
#[derive(Clone, Copy, Debug)]
pub struct EstimatorArrays<
    T,
    const NX: usize,
    const NU: usize,
    const NY: usize,
    const ND: usize,
    const K: usize,
>([Instant<T, NX, NU, NY, ND>; K]);

impl<T, const NX: usize, const NU: usize, const NY: usize, const ND: usize, const K: usize>
    EstimatorArrays<T, NX, NU, NY, ND, K>
where
    T: Scalar,
{
    /// The arrays as memory of an estimator.
    pub fn lend(&'static mut self) -> EstimatorMemory<T, NX, NU, NY, ND> {
        EstimatorMemory(List::Static(&mut self.0))
    }
}

impl<T, const NX: usize, const NU: usize, const NY: usize, const ND: usize, const K: usize> Default
    for EstimatorArrays<T, NX, NU, NY, ND, K>
where
    T: Scalar,
{
    fn default() -> Self {
        Self([Instant::new(None); K])
    }
}
