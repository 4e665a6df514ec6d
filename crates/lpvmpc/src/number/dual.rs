//! Dual numbers: values that carry their derivatives (automatic differentiation, forward mode).

use super::{Bivariate, Choice, Elementary, Number, choice};
use crate::model::Scalar;
use core::ops::{Add, Div, Mul, Neg, Sub};
use nalgebra::{SVector, convert};

/// A value with its derivatives with respect to `D` variables, exact to rounding.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dual<T, const D: usize> {
    /// The value.
    pub value: T,
    /// Its derivatives.
    pub slopes: [T; D],
}

impl<T: Scalar, const D: usize> Dual<T, D> {
    /// A number that depends on none of the variables.
    #[inline(always)]
    pub fn fixed(value: T) -> Self {
        Self {
            value,
            slopes: [T::zero(); D],
        }
    }

    /// The variables themselves at these values: variable i has the derivative 1 with respect to
    /// itself.
    pub fn variables(values: &SVector<T, D>) -> SVector<Self, D> {
        SVector::from_fn(|i, _| {
            let mut variable = Self::fixed(values[i]);
            variable.slopes[i] = T::one();
            variable
        })
    }

    /// The chain rule: this `value` of a function with that `slope` at the number.
    #[inline(always)]
    fn through(self, value: T, slope: T) -> Self {
        Self {
            value,
            slopes: self.slopes.map(|own| own * slope),
        }
    }

    /// The slopes of a result: `slope` of those of both operands.
    #[inline(always)]
    fn combine(self, other: Self, value: T, slope: impl Fn(T, T) -> T) -> Self {
        let mut slopes = self.slopes;
        for (own, other) in slopes.iter_mut().zip(other.slopes) {
            *own = slope(*own, other);
        }
        Self { value, slopes }
    }
}

impl<T: Scalar, const D: usize> Add for Dual<T, D> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.combine(other, self.value + other.value, |a, b| a + b)
    }
}

impl<T: Scalar, const D: usize> Sub for Dual<T, D> {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.combine(other, self.value - other.value, |a, b| a - b)
    }
}

impl<T: Scalar, const D: usize> Mul for Dual<T, D> {
    type Output = Self;

    #[allow(
        clippy::suspicious_arithmetic_impl,
        reason = "the slope of a product is a sum"
    )]
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        let (own, factor) = (self.value, other.value);
        self.combine(other, own * factor, |a, b| a * factor + own * b)
    }
}

impl<T: Scalar, const D: usize> Div for Dual<T, D> {
    type Output = Self;

    #[inline(always)]
    fn div(self, other: Self) -> Self {
        let inverse = T::one() / other.value;
        let quotient = self.value / other.value;
        self.combine(other, quotient, |a, b| (a - quotient * b) * inverse)
    }
}

impl<T: Scalar, const D: usize> Neg for Dual<T, D> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        self.through(-self.value, -T::one())
    }
}

impl<T: Scalar + Number, const D: usize> Number for Dual<T, D> {
    #[inline(always)]
    fn constant(value: f64) -> Self {
        Self::fixed(<T as Number>::constant(value))
    }

    #[inline(always)]
    fn elementary(self, function: Elementary) -> Self {
        let x = self.value;
        let value = x.elementary(function);
        let slope = match function {
            Elementary::Sin => x.elementary(Elementary::Cos),
            Elementary::Cos => -x.elementary(Elementary::Sin),
            Elementary::Sinc => sinc_slope(x, value, Elementary::Cos),
            Elementary::Sinhc => sinc_slope(x, value, Elementary::Cosh),
            Elementary::Atan => T::one() / (T::one() + x * x),
            Elementary::Exp => value,
            Elementary::Ln => T::one() / x,
            Elementary::Sqrt => T::one() / (value + value),
            Elementary::Tanh => T::one() - value * value,
            Elementary::Asin => T::one() / root(one_minus_square(x)),
            Elementary::Acos => -T::one() / root(one_minus_square(x)),
            Elementary::Sinh => x.elementary(Elementary::Cosh),
            Elementary::Cosh => x.elementary(Elementary::Sinh),
            Elementary::Asinh => T::one() / root(T::one() + x * x),
            Elementary::Acosh => T::one() / (root(x - T::one()) * root(x + T::one())),
            Elementary::Atanh => T::one() / one_minus_square(x),
            Elementary::ExpM1 => value + T::one(),
            Elementary::Ln1p => T::one() / (T::one() + x),
            Elementary::Abs if x < T::zero() => -T::one(),
            Elementary::Abs => T::one(),
            Elementary::Sign | Elementary::Floor => return Self::fixed(value),
        };
        self.through(value, slope)
    }

    #[inline(always)]
    fn bivariate(self, other: Self, function: Bivariate) -> Self {
        let (x, y) = (self.value, other.value);
        let value = x.bivariate(y, function);
        let (by_x, by_y) = match function {
            Bivariate::Atan2 => {
                let square = x * x + y * y;
                (y / square, -x / square)
            }
            Bivariate::Power => {
                let lower = x.bivariate(y - T::one(), Bivariate::Power);
                (y * lower, value * x.elementary(Elementary::Ln))
            }
            Bivariate::MeanSign => {
                let size = x.abs() + y.abs();
                let by = |v: T| match size == T::zero() {
                    true => size,
                    false => (T::one() - value * v.elementary(Elementary::Sign)) / size,
                };
                (by(x), by(y))
            }
            _ => {
                return match choice(x, y, function) {
                    Some(Choice::First) => self,
                    Some(Choice::Second) => other,
                    Some(Choice::One | Choice::Zero) | None => Self::fixed(value),
                };
            }
        };
        // What does not vary counts for nothing, even where the derivative by it does not exist: that
        // of x^2 by the exponent at x < 0.
        let part = |slope: T, by: T| {
            if slope == T::zero() {
                slope
            } else {
                slope * by
            }
        };
        self.combine(other, value, |a, b| part(a, by_x) + part(b, by_y))
    }

    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = Number::sin_cos(self.value);
        (self.through(sin, cos), self.through(cos, -sin))
    }
}

fn root<T: Number>(x: T) -> T {
    x.elementary(Elementary::Sqrt)
}

/// 1 - x^2, exact near |x| = 1, too.
fn one_minus_square<T: Scalar>(x: T) -> T {
    (T::one() - x) * (T::one() + x)
}

/// How d/dx sin(x)/x is worked out: (cos x - sinc x)/x, and by its series where that difference would lose its
/// digits. Of sinh(x)/x the same with cosh, and the sizes of the factors.
#[derive(Clone, Copy, Debug)]
pub struct SincSlope;

impl SincSlope {
    /// Up to this |x|, in rad, the series is used.
    pub const SMALL: f64 = 0.3;
    /// (-1)^k 2k / (2k+1)!, the last first: the factors of powers of x^2 in the slope over x. What is left out is below
    /// 1e-17 of the slope.
    pub const SERIES: [f64; 7] = [
        -1.0 / 93_405_312_000.0,
        1.0 / 518_918_400.0,
        -1.0 / 3_991_680.0,
        1.0 / 45_360.0,
        -1.0 / 840.0,
        1.0 / 30.0,
        -1.0 / 3.0,
    ];
}

/// d/dx sin(x)/x at `x`, where sin(x)/x is `sinc` and `cos` the cosine; or of sinh(x)/x the same with cosh.
fn sinc_slope<T: Scalar + Number>(x: T, sinc: T, cos: Elementary) -> T {
    if x.abs() > convert(SincSlope::SMALL) {
        return (x.elementary(cos) - sinc) / x;
    }
    let square = x * x;
    let sum = { SincSlope::SERIES.iter() }.fold(T::zero(), |sum, coefficient| {
        let hyperbolic = cos == Elementary::Cosh;
        let coefficient = if hyperbolic {
            coefficient.abs()
        } else {
            *coefficient
        };
        sum * square + convert(coefficient)
    });
    sum * x
}
