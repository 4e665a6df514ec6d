//! How far a Newton step may go, and what becomes of the products of slack and multiplier on its way.

use super::unknowns::Interior;
use crate::model::Scalar;
use nalgebra::convert;

/// What is farther than so many steps away does not count.
const FAR: f64 = 1e3;

/// Parts of a way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Part<T> {
    /// Of slacks and excesses.
    pub primal: T,
    /// Of multipliers.
    pub dual: T,
}

impl<T: Scalar> Part<T> {
    /// Times `factor`, at most the whole way.
    pub fn shortened(self, factor: T) -> Self {
        Self {
            primal: (self.primal * factor).min(T::one()),
            dual: (self.dual * factor).min(T::one()),
        }
    }

    pub fn shortest(self) -> T {
        self.primal.min(self.dual)
    }
}

/// What a step leaves of the unknowns, relative to where they are: the least of lower and of upper sides.
pub(super) struct Left<T> {
    primal: [T; 2],
    dual: [T; 2],
}

impl<T: Scalar> Left<T> {
    pub fn begin() -> Self {
        let far = [T::one() - T::one() / convert(FAR); 2];
        Self {
            primal: far,
            dual: far,
        }
    }

    /// Takes a side into account, which is to go `to` that point from where one divided by its unknowns is `inverse`.
    #[inline(always)]
    pub fn add(&mut self, k: usize, inverse: &Interior<T>, to: &Interior<T>, soft: bool) {
        // What is and stays zero is no number then, which is not less.
        let keep = |least: &mut T, inverse: T, to: T| {
            let left = to * inverse;
            *least = if left < *least { left } else { *least };
        };
        keep(&mut self.primal[k], inverse.slack, to.slack);
        keep(&mut self.dual[k], inverse.multiplier, to.multiplier);
        if soft {
            keep(&mut self.primal[k], inverse.excess, to.excess);
            keep(&mut self.dual[k], inverse.rest, to.rest);
        }
    }

    /// The parts of the way at which the first unknowns are zero.
    pub fn part(&self) -> Part<T> {
        let until_zero = |left: &[T; 2]| {
            let least = left.iter().fold(T::one(), |least, left| least.min(*left));
            T::one() / (T::one() - least)
        };
        Part {
            primal: until_zero(&self.primal),
            dual: until_zero(&self.dual),
        }
    }
}

/// What there is to know of the way to a prediction, of lower and of upper sides.
pub(super) struct Sums<T> {
    least: [T; 2],
    most: [T; 2],
    left: [T; 2],
    both: [T; 2],
}

impl<T: Scalar> Sums<T> {
    pub fn begin() -> Self {
        let zeros = [T::zero(); 2];
        Self {
            least: [T::one(); 2],
            most: zeros,
            left: zeros,
            both: zeros,
        }
    }

    /// Takes into account that a step towards zero leaves this part of a slack, whose product with its multiplier is known,
    /// and so the rest of the multiplier; the product of their changes.
    #[inline(always)]
    pub fn add(&mut self, k: usize, left: T, product: T) -> T {
        self.least[k] = if left < self.least[k] {
            left
        } else {
            self.least[k]
        };
        self.most[k] = if left > self.most[k] {
            left
        } else {
            self.most[k]
        };
        let of_slack = left * product;
        let both = of_slack - of_slack * left;
        self.left[k] += of_slack;
        self.both[k] += both;
        both
    }

    pub fn total(&self) -> Prediction<T> {
        let sum = |each: &[T; 2]| each.iter().fold(T::zero(), |sum, one| sum + *one);
        let least = self
            .least
            .iter()
            .fold(T::one(), |least, one| least.min(*one));
        let most = self.most.iter().fold(T::zero(), |most, one| most.max(*one));
        Prediction {
            part: Part {
                primal: T::one() / (T::one() - least),
                dual: T::one() / most,
            },
            left: sum(&self.left),
            both: sum(&self.both),
        }
    }
}

/// What there is to know of the way to a prediction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Prediction<T> {
    /// Where the first unknown is zero.
    part: Part<T>,
    /// What slacks leave of the sum of slack * multiplier, multipliers as they are.
    left: T,
    /// By how much it changes in second order.
    both: T,
}

impl<T: Scalar> Prediction<T> {
    /// What the `sum` of slack * multiplier comes to where that first unknown is zero.
    pub fn sum(&self, sum: T) -> T {
        let Part { primal, dual } = self.part.shortened(T::one());
        sum - primal * (sum - self.left) - dual * self.left + primal * dual * self.both
    }
}

/// What a step says of the roles of the sides.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(in crate::many_bounds) struct Foretold {
    /// How many are not those of the step before.
    pub changed: usize,
    /// How many sides are active.
    pub active: usize,
    /// Of how many sides the step does not say clearly whether they are active.
    pub undecided: usize,
}
