//! Intervals with outward rounding.

use super::elementary::{self, Arithmetic, Coefficients};
use lpvmpc::{Bivariate, Elementary, Number};
use std::ops::{Add, Div, Mul, Neg, Sub};

/// All real numbers from `lower` to `upper`. The result of an operation contains the result for
/// every choice of numbers in its operands: bounds are rounded to nearest, then moved outwards by
/// one floating-point number. What has no bound, or is not a number, is everything.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interval {
    /// Lower end.
    pub lower: f64,
    /// Upper end.
    pub upper: f64,
}

impl Interval {
    /// Every real number.
    pub const EVERYTHING: Self = Self {
        lower: f64::NEG_INFINITY,
        upper: f64::INFINITY,
    };

    /// From `lower` to `upper`; everything, if that is no range.
    pub fn new(lower: f64, upper: f64) -> Self {
        if lower <= upper {
            Self { lower, upper }
        } else {
            Self::EVERYTHING
        }
    }

    /// The one number `value`.
    pub fn point(value: f64) -> Self {
        Self::new(value, value)
    }

    /// The numbers within `radius` of `middle`.
    pub fn around(middle: f64, radius: f64) -> Self {
        Self::point(middle) + Self::new(-radius, radius)
    }

    /// A number in the middle, up to rounding.
    pub fn middle(self) -> f64 {
        0.5 * self.lower + 0.5 * self.upper
    }

    /// An upper bound of the distance from [`Self::middle`] to any number of the interval.
    pub fn radius(self) -> f64 {
        let middle = self.middle();
        (self.upper - middle).max(middle - self.lower).next_up()
    }

    /// The largest absolute value.
    pub fn magnitude(self) -> f64 {
        self.lower.abs().max(self.upper.abs())
    }

    /// Whether `other` is inside.
    pub fn contains(self, other: Self) -> bool {
        self.lower <= other.lower && other.upper <= self.upper
    }

    /// The smallest interval with both.
    pub fn hull(self, other: Self) -> Self {
        Self::new(self.lower.min(other.lower), self.upper.max(other.upper))
    }

    /// What both have in common; they must have some.
    pub fn common(self, other: Self) -> Self {
        Self::new(self.lower.max(other.lower), self.upper.min(other.upper))
    }

    /// The square, not below zero.
    pub fn square(self) -> Self {
        let product = self * self;
        let contains_zero = self.lower <= 0.0 && 0.0 <= self.upper;
        let smallest = self.lower.abs().min(self.upper.abs());
        let lower = if contains_zero {
            0.0
        } else {
            down(smallest * smallest).max(0.0)
        };
        Self::new(lower, product.upper)
    }

    /// The square root of the part that is not below zero.
    pub fn square_root(self) -> Self {
        let lower = self.lower.max(0.0).sqrt();
        Self::new(down(lower).max(0.0), up(self.upper.sqrt()))
    }
}

/// The next number below a rounded result.
fn down(rounded: f64) -> f64 {
    rounded.next_down()
}

fn up(rounded: f64) -> f64 {
    rounded.next_up()
}

impl Add for Interval {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        // An exact zero keeps sparse matrices sparse, and the arithmetic out of the slow range of
        // subnormal numbers.
        let zero = Self::point(0.0);
        if self == zero {
            return other;
        }
        if other == zero {
            return self;
        }
        Self::new(down(self.lower + other.lower), up(self.upper + other.upper))
    }
}

impl Neg for Interval {
    type Output = Self;

    fn neg(self) -> Self {
        Self::new(-self.upper, -self.lower)
    }
}

impl Sub for Interval {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for Interval {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        let zero = Self::point(0.0);
        if self == zero || other == zero {
            // What has no bound may have no value, 1/0, and then neither has the product.
            let bounded = self.magnitude().is_finite() && other.magnitude().is_finite();
            return if bounded { zero } else { Self::EVERYTHING };
        }
        let products = [
            self.lower * other.lower,
            self.lower * other.upper,
            self.upper * other.lower,
            self.upper * other.upper,
        ];
        if products.iter().any(|product| product.is_nan()) {
            return Self::EVERYTHING;
        }
        let lower = products.iter().copied().fold(f64::INFINITY, f64::min);
        let upper = products.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        Self::new(down(lower), up(upper))
    }
}

impl Div for Interval {
    type Output = Self;

    #[allow(
        clippy::suspicious_arithmetic_impl,
        reason = "a / b is a times an enclosure of 1/b"
    )]
    fn div(self, other: Self) -> Self {
        self * other.reciprocal()
    }
}

impl Number for Interval {
    fn constant(value: f64) -> Self {
        Self::point(value)
    }

    fn between(lower: f64, upper: f64) -> Self {
        Self::new(lower, upper)
    }

    fn elementary(self, function: Elementary) -> Self {
        self.taylor_coefficients(function, 1)[0]
    }

    fn bivariate(self, other: Self, function: Bivariate) -> Self {
        elementary::bivariate(self, other, function)
    }
}

impl Arithmetic for Interval {
    fn unknown() -> Self {
        Self::EVERYTHING
    }

    fn range(self) -> Interval {
        self
    }

    fn within(range: Interval) -> Self {
        range
    }

    fn reciprocal(self) -> Self {
        if self.lower <= 0.0 && 0.0 <= self.upper {
            return Self::EVERYTHING;
        }
        Self::new(down(1.0 / self.upper), up(1.0 / self.lower))
    }

    fn taylor_coefficients(self, function: Elementary, count: usize) -> Coefficients<Self> {
        elementary::taylor_coefficients(function, count, self)
    }
}
