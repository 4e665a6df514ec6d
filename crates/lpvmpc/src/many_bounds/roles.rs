//! The roles that follow from the answer of a guess, and which of their changes are taken.

use super::side::{BoundSide, Role};
use crate::model::Scalar;

/// Gives every side the role that follows from its distance and multiplier; how many change.
pub(super) fn reassign<T: Scalar>(sides: &mut [BoundSide<T>], violation: T, rounding: T) -> usize {
    let mut changes = 0;
    for side in sides {
        let margin = violation * side.size;
        let held = |side: &BoundSide<T>| match side.soft {
            Some(price) if price.linear <= T::zero() => Role::Exceeded,
            _ => Role::Held,
        };
        let role = match side.role {
            Role::Free if side.distance < -margin => held(side),
            Role::Held if side.estimate < -rounding => Role::Free,
            Role::Held if side.estimate > side.price() + rounding => Role::Exceeded,
            Role::Exceeded if side.distance > margin => match held(side) {
                Role::Held => Role::Held,
                _ => Role::Free,
            },
            known => known,
        };
        side.last_role = side.role;
        if role != side.role {
            if side.role == Role::Free {
                side.estimate = T::zero();
            }
            if side.role == Role::Exceeded {
                side.estimate = side.price();
            }
            side.role = role;
            changes += 1;
        }
    }
    changes
}

/// Lets go of a held side that stays where it is not to be, since the other held ones leave nothing that moves it, of
/// several the one that is farthest away: what is kept all the same is free, what is soft is exceeded. How many
/// there are.
pub(super) fn release_unmet<T: Scalar>(sides: &mut [BoundSide<T>], violation: T) -> usize {
    let mut farthest = violation;
    let mut unmet = None;
    for side in sides.iter_mut().filter(|side| side.is_weighted()) {
        let distance = side.distance / side.size;
        let role = if distance > farthest {
            Role::Free
        } else if distance < -farthest && side.soft.is_some() {
            Role::Exceeded
        } else {
            continue;
        };
        farthest = distance.abs();
        unmet = Some((side, role));
    }
    match unmet {
        Some((side, role)) => {
            side.role = role;
            1
        }
        None => 0,
    }
}

/// The first stage at which a role has changed.
pub(super) fn first_change<T: Scalar>(sides: &[BoundSide<T>]) -> Option<usize> {
    let mut changed = sides.iter().filter(|side| side.role != side.last_role);
    changed.next().map(|side| side.bound.stage)
}

/// Takes back all changes of roles but those at the first stage at which there are any.
pub(super) fn keep_first_changes<T: Scalar>(sides: &mut [BoundSide<T>]) {
    let first = first_change(sides);
    for side in sides {
        if Some(side.bound.stage) != first {
            side.role = side.last_role;
        }
    }
}

/// Takes back all changes of roles but the last `count`.
pub(super) fn keep_last_changes<T: Scalar>(sides: &mut [BoundSide<T>], count: usize) {
    let changed = sides.iter_mut().filter(|side| side.role != side.last_role);
    for side in changed.rev().skip(count) {
        side.role = side.last_role;
    }
}

/// Takes back all changes of roles but that of the side which was most wrong: by its distance beside its size, or by its
/// multiplier beside the largest one.
pub(super) fn keep_worst_change<T: Scalar>(sides: &mut [BoundSide<T>]) {
    let held = sides.iter().filter(|side| side.last_role == Role::Held);
    let largest = held.fold(T::default_epsilon(), |most, side| {
        most.max(side.estimate.abs() * side.size)
    });
    let (mut most, mut worst) = (-T::one(), None);
    for (place, side) in sides.iter().enumerate() {
        let wrong = match side.last_role {
            Role::Held => (-side.estimate).max(side.estimate - side.price()) * side.size / largest,
            Role::Free | Role::Exceeded => side.distance.abs() / side.size,
        };
        if side.role != side.last_role && wrong > most {
            (most, worst) = (wrong, Some(place));
        }
    }
    for (place, side) in sides.iter_mut().enumerate() {
        if Some(place) != worst {
            side.role = side.last_role;
        }
    }
}
