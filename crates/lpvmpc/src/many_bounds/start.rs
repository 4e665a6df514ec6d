//! Where the interior-point method begins.

use super::interior_point::Interior;
use super::side::BoundSide;
use crate::model::Scalar;
use nalgebra::convert;

/// Least slack to begin with, as a part of the bound's size.
const LEAST: f64 = 1.0;
/// And as a part of the largest violation, each in its bound's size: from far beyond their bounds steps that begin with
/// little slack are short.
const LEAST_OF_WORST: f64 = 0.1;
/// The products begin so many times the largest violation larger, between once and
const PER_VIOLATION: f64 = 0.3;
/// so many times.
const LARGEST: f64 = 100.0;
/// Those of a soft side begin with this part of what it costs to exceed its bound by as much as the worst is violated: with
/// less the role that it begins with, which may be wrong, is hard to leave.
const UNDECIDED_SOFT: f64 = 0.5;
/// Its price is that of an excess of at least this part of the bound's size.
const EXCESS: f64 = 0.1;

/// What the unknowns begin with.
pub(super) struct Start<T> {
    /// The largest violation, in its bound's size.
    worst: T,
    /// How many times larger the products are for it.
    times: T,
    /// The products.
    cost: T,
}

impl<T: Scalar> Start<T> {
    /// For sides whose distance is known, with products of slack and multiplier of the size of `cost`, larger where bounds
    /// are violated by several times their size.
    pub fn new(sides: &[BoundSide<T>], cost: T) -> Self {
        let worst = sides.iter().fold(T::zero(), |worst, side| {
            worst.max(-side.distance / side.size)
        });
        let times = worst * convert(PER_VIOLATION);
        let times = times.max(T::one()).min(convert(LARGEST));
        Self {
            worst,
            times,
            cost: cost * times,
        }
    }

    /// The unknowns that a side begins with.
    pub fn of(&self, side: &BoundSide<T>) -> Interior<T> {
        let Self { worst, times, cost } = *self;
        match side.soft {
            None => {
                let least = convert::<f64, T>(LEAST).max(worst * convert(LEAST_OF_WORST));
                let slack = side.distance.max(side.size * least);
                Interior {
                    slack,
                    multiplier: cost / slack,
                    excess: T::zero(),
                    rest: T::zero(),
                }
            }
            Some(price) => {
                let excess = (-side.distance).max(side.size * convert(EXCESS));
                let price = price.linear + price.quadratic * excess;
                let far = side.distance.max(side.size * worst.max(T::one()));
                let product = price * far * times * convert(UNDECIDED_SOFT);
                centred(side.distance, price, product.max(cost))
            }
        }
    }
}

/// The unknowns of a soft side whose multipliers add up to `price`, with both its products equal.
fn centred<T: Scalar>(distance: T, price: T, product: T) -> Interior<T> {
    let half_value = price * distance.abs() * convert(0.5);
    let value = half_value + (half_value * half_value + product * product).sqrt();
    let larger = (value + product) / price;
    let smaller = larger * product / value;
    let (slack, excess) = match distance > T::zero() {
        true => (larger, smaller),
        false => (smaller, larger),
    };
    Interior {
        slack,
        multiplier: product / slack,
        excess,
        rest: product / excess,
    }
}
