//! Whatever has a cost in the linear-quadratic program: one side of a bound, or both of them at once.

use super::side::{BoundSide, Role};
use crate::model::Scalar;
use crate::solution::Quantity;

/// What has the cost weight * z^2 / 2 - pull * z, where z is a quantity of a stage. Lists of them are in the order of their
/// stages.
pub(super) trait Weighted<T> {
    fn stage(&self) -> usize;

    fn quantity(&self) -> Quantity;

    fn weight_and_pull(&self) -> (T, T);

    /// The value of an input that is held, a constant of the factorisation.
    fn held_input(&self) -> Option<T>;
}

impl<T: Scalar> Weighted<T> for BoundSide<T> {
    #[inline(always)]
    fn stage(&self) -> usize {
        self.bound.stage
    }

    #[inline(always)]
    fn quantity(&self) -> Quantity {
        self.bound.quantity
    }

    #[inline(always)]
    fn weight_and_pull(&self) -> (T, T) {
        (
            self.weight,
            self.sign * self.base + self.weight * self.limit,
        )
    }

    #[inline(always)]
    fn held_input(&self) -> Option<T> {
        (self.role == Role::Held && self.input().is_some()).then_some(self.limit)
    }
}

/// Takes those of the last stages, from `stage` on, off the list.
#[inline(always)]
pub(super) fn split_off<'a, T, W: Weighted<T>>(bounds: &mut &'a [W], stage: usize) -> &'a [W] {
    let (rest, here) = bounds.split_at(count_before(bounds, stage));
    *bounds = rest;
    here
}

/// [`split_off`] for what is to change.
#[inline(always)]
pub(super) fn split_off_mut<'a, T, W: Weighted<T>>(
    bounds: &mut &'a mut [W],
    stage: usize,
) -> &'a mut [W] {
    let whole = core::mem::take(bounds);
    let (rest, here) = whole.split_at_mut(count_before(whole, stage));
    *bounds = rest;
    here
}

/// How many belong to stages before this one, the last of all.
#[inline(always)]
fn count_before<T, W: Weighted<T>>(bounds: &[W], stage: usize) -> usize {
    let last = bounds.iter().rposition(|bound| bound.stage() < stage);
    last.map_or(0, |last| last + 1)
}

/// Takes those of the first stages, up to `stage`, off the list.
pub(super) fn split_first_mut<'a, T, W: Weighted<T>>(
    bounds: &mut &'a mut [W],
    stage: usize,
) -> &'a mut [W] {
    let whole = core::mem::take(bounds);
    let behind = whole.iter().position(|bound| bound.stage() > stage);
    let (here, rest) = whole.split_at_mut(behind.unwrap_or(whole.len()));
    *bounds = rest;
    here
}
