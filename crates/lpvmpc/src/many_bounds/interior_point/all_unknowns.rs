//! The unknowns of all bounds, in the order of their stages.

use super::unknowns::{BoundUnknowns, Interior, Known};
use crate::many_bounds::side::BoundSide;
use crate::model::Scalar;

/// Places for the unknowns of all bounds, and how many of them are taken.
pub(in crate::many_bounds) struct AllUnknowns<'a, T> {
    places: &'a mut [BoundUnknowns<T>],
    taken: usize,
}

impl<'a, T: Scalar> AllUnknowns<'a, T> {
    pub fn new(places: &'a mut [BoundUnknowns<T>]) -> Self {
        Self { places, taken: 0 }
    }

    /// Takes up the sides, each with what it begins with; `None` where there are not enough places.
    pub(super) fn set(
        &mut self,
        sides: &[BoundSide<T>],
        mut begin: impl FnMut(&BoundSide<T>) -> Interior<T>,
    ) -> Option<()> {
        self.taken = 0;
        for side in sides {
            if !side.is_second {
                let place = self.places.get_mut(self.taken)?;
                *place = BoundUnknowns::new(side.bound.stage, side.bound.quantity);
                self.taken += 1;
            }
            self.bounds_mut().last_mut()?.set(side, &begin(side));
        }
        Some(())
    }

    /// Shows what there is to know of each of the sides that were taken up.
    pub fn visit(
        &self,
        sides: &mut [BoundSide<T>],
        mut visit: impl FnMut(&mut BoundSide<T>, Known<T>),
    ) {
        let mut bounds = self.bounds().iter();
        let mut bound = None;
        for side in sides {
            if !side.is_second {
                bound = bounds.next();
            }
            if let Some(bound) = bound {
                visit(side, bound.known(side.bound.side));
            }
        }
    }

    /// What there is to know of each of the sides that were taken up, beside it.
    #[cfg(all(test, feature = "alloc"))]
    pub(super) fn copied(
        &self,
        sides: &mut [BoundSide<T>],
    ) -> alloc::vec::Vec<(BoundSide<T>, Known<T>)> {
        let mut all = alloc::vec::Vec::new();
        self.visit(sides, |side, known| all.push((*side, known)));
        all
    }

    pub(super) fn bounds(&self) -> &[BoundUnknowns<T>] {
        self.places.get(..self.taken).unwrap_or_default()
    }

    pub(super) fn bounds_mut(&mut self) -> &mut [BoundUnknowns<T>] {
        self.places.get_mut(..self.taken).unwrap_or_default()
    }
}
