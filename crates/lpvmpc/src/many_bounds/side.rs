//! The finite sides of all bounds, as the phase for many active bounds works with them.

use crate::model::Scalar;
use crate::ocp::{Ocp, Penalty};
use crate::rows;
use crate::solution::{BoundId, Quantity, Side};
use nalgebra::{SVector, convert};

/// How a side takes part in the program with equalities that a guess leads to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Role {
    /// Not at all.
    Free,
    /// It holds with equality.
    Held,
    /// It is soft, and exceeded.
    Exceeded,
}

/// One finite side of a bound. Its distance d = value - lower or upper - value is to be >= 0; what is
/// soft may be exceeded by s >= 0, d + s >= 0.
///
/// In a linear-quadratic program the side acts with the multiplier base - weight * d.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BoundSide<T> {
    pub bound: BoundId,
    /// Whether the side in front of it is the other one of the same bound.
    pub is_second: bool,
    /// 1 for a lower bound, -1 for an upper one: the derivative of d in the bounded quantity.
    pub sign: T,
    pub limit: T,
    /// The size against which a violation is measured.
    pub size: T,
    pub soft: Option<Penalty<T>>,
    pub role: Role,
    /// The role in the guess before.
    pub last_role: Role,
    /// The role that the dual method begins with where the phase finds nothing: that of the last solution, where that is
    /// begun with, or what was foretold when rounding ended the interior-point method.
    pub known_role: Role,
    /// The role in the last guess that was nearly right, with what was wrong at its first stage exchanged: exchanges stage
    /// by stage begin with it.
    pub nearest_role: Role,
    /// Multiplier at d = 0, and how fast it falls with d.
    pub base: T,
    pub weight: T,
    /// d on the trajectory at hand.
    pub distance: T,
    /// Multiplier of the guess.
    pub estimate: T,
}

impl<T: Scalar> BoundSide<T> {
    /// A place for a side.
    pub fn empty() -> Self {
        Self::new(
            BoundId {
                stage: 0,
                quantity: Quantity::State(0),
                side: Side::Lower,
            },
            T::zero(),
            T::one(),
            None,
        )
    }

    fn new(bound: BoundId, limit: T, size: T, soft: Option<Penalty<T>>) -> Self {
        Self {
            bound,
            is_second: false,
            sign: match bound.side {
                Side::Upper => -T::one(),
                _ => T::one(),
            },
            limit,
            size,
            soft,
            role: Role::Free,
            last_role: Role::Free,
            known_role: Role::Free,
            nearest_role: Role::Free,
            base: T::zero(),
            weight: T::zero(),
            distance: T::zero(),
            estimate: T::zero(),
        }
    }

    /// The input that the side bounds.
    pub fn input(&self) -> Option<usize> {
        match self.bound.quantity {
            Quantity::Input(j) => Some(j),
            _ => None,
        }
    }

    /// Whether it can have a part in bounds that contradict each other: a hard one that is not of an input.
    pub fn may_contradict(&self) -> bool {
        self.input().is_none() && self.soft.is_none()
    }

    /// Whether it is held by a weight on its distance.
    pub fn is_weighted(&self) -> bool {
        self.role == Role::Held && self.input().is_none()
    }

    /// The bounded quantity at these values of the stage.
    #[inline(always)]
    pub fn value<const NX: usize, const NU: usize>(
        &self,
        ocp: &Ocp<T, NX, NU>,
        x: &SVector<T, NX>,
        u: Option<&SVector<T, NU>>,
    ) -> T {
        match self.bound.quantity {
            Quantity::State(j) => x[j],
            Quantity::Input(j) => u.map_or(self.limit, |u| u[j]),
            Quantity::Row(j) => {
                let row = ocp.row(self.bound.stage, j);
                row.map_or(self.limit, |row| row.value(x, u))
            }
        }
    }

    /// d where the quantity has this value.
    #[inline(always)]
    pub fn distance_of(&self, value: T) -> T {
        (value - self.limit) * self.sign
    }

    /// The multiplier at the distance d.
    pub fn multiplier_at(&self, distance: T) -> T {
        self.base - self.weight * distance
    }

    /// By how much the multiplier of a held side is below zero, or above its price.
    pub fn excess(&self) -> T {
        match self.role {
            Role::Held => (-self.estimate).max(self.estimate - self.price()),
            _ => T::zero(),
        }
    }

    /// The linear price, infinite for a hard side: the largest multiplier at which the side holds.
    pub fn price(&self) -> T {
        let infinite = convert(f64::INFINITY);
        self.soft.map_or(infinite, |penalty| penalty.linear)
    }

    /// The curvature of the excess' cost.
    pub fn curvature(&self) -> T {
        self.soft.map_or(T::zero(), |penalty| penalty.quadratic)
    }
}

/// Puts the finite sides of all bounds of the problem into `sides`, stage by stage; how many there are, or `None` where there are not
/// enough places, or a bound or a row is NaN.
pub(super) fn collect<T: Scalar, const NX: usize, const NU: usize>(
    ocp: &Ocp<T, NX, NU>,
    sides: &mut [BoundSide<T>],
) -> Option<usize> {
    let mut count = 0;
    let infinite: T = convert(f64::INFINITY);
    let mut add = |stage, quantity, (lower, upper): (T, T), soft: Option<Penalty<T>>| {
        let free = |price: Penalty<T>| price.linear <= T::zero() && price.quadratic <= T::zero();
        if soft.is_some_and(free) {
            return Some(());
        }
        // Whether a bound is met that is NaN, or that no number meets, the dual method is to say.
        if !(lower < infinite && upper > -infinite) {
            return None;
        }
        let size = rows::size_of_bound(lower, upper);
        for (side, limit) in [(Side::Lower, lower), (Side::Upper, upper)] {
            if limit.is_finite() {
                let bound = BoundId {
                    stage,
                    quantity,
                    side,
                };
                let place = sides.get_mut(count)?;
                *place = BoundSide::new(bound, limit, size, soft);
                place.is_second = side == Side::Upper && lower.is_finite();
                count += 1;
            }
        }
        Some(())
    };
    let n = ocp.length();
    for i in 0..=n {
        let common = ocp.common_at(i);
        let (x, soft_x) = match i == n {
            true => (&ocp.terminal.x, &ocp.terminal.soft_x),
            false => (&common.x, &common.soft_x),
        };
        if i > 0 {
            let limits = x.lower.iter().zip(x.upper.iter());
            for (j, ((lower, upper), soft)) in limits.zip(soft_x).enumerate() {
                add(i, Quantity::State(j), (*lower, *upper), *soft)?;
            }
        }
        if i < n {
            let limits = common.u.lower.iter().zip(common.u.upper.iter());
            for (j, (lower, upper)) in limits.enumerate() {
                add(i, Quantity::Input(j), (*lower, *upper), None)?;
            }
        }
        for (j, row) in ocp.rows_of(i).iter().enumerate() {
            // A row with a coefficient that is not finite is left to the dual method, which says so, be it without limits.
            let of_input = row.u.iter().filter(|_| i < n);
            if !row.x.iter().chain(of_input).all(|of| of.is_finite()) {
                return None;
            }
            add(i, Quantity::Row(j), (row.lower, row.upper), row.soft)?;
        }
    }
    Some(count)
}

/// Whether one of them may be exceeded.
pub(super) fn any_soft<T>(sides: &[BoundSide<T>]) -> bool {
    sides.iter().any(|side| side.soft.is_some())
}

/// Whether all are of inputs.
pub(super) fn are_inputs<T: Scalar>(sides: &[BoundSide<T>]) -> bool {
    sides.iter().all(|side| side.input().is_some())
}

/// Whether there are hard ones of inputs and of states.
pub(super) fn are_mixed<T>(sides: &[BoundSide<T>]) -> bool {
    let of_input = |side: &BoundSide<T>| matches!(side.bound.quantity, Quantity::Input(_));
    let of_state = |side: &BoundSide<T>| matches!(side.bound.quantity, Quantity::State(_));
    sides.iter().any(of_input) && sides.iter().any(of_state) && !any_soft(sides)
}
