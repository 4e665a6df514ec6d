//! Power series in time.

use super::elementary::{Arithmetic, Coefficients, bivariate};
use super::interval::Interval;
use lpvmpc::{Bivariate, Elementary, Number};
use std::ops::{Add, Div, Mul, Neg, Sub};

/// Coefficients that a [`Series`] can hold: more is not needed in one step.
pub(super) const CAPACITY: usize = 9;

/// The first coefficients of a power series in time, c_0 + c_1 t + c_2 t^2 + ... (Taylor
/// arithmetic; Moore, Methods and Applications of Interval Analysis, 1979).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Series<T> {
    coefficients: [T; CAPACITY],
    /// How many coefficients are known.
    known: usize,
    /// From here on they are zero.
    length: usize,
}

impl<T: Arithmetic> Series<T> {
    /// The series with these coefficients and unknown others.
    pub fn new(coefficients: impl ExactSizeIterator<Item = T>) -> Self {
        let mut series = Self::constant(0.0);
        series.known = coefficients.len();
        series.length = series.known;
        for (place, coefficient) in series.coefficients.iter_mut().zip(coefficients) {
            *place = coefficient;
        }
        series
    }

    /// What does not change over time.
    pub fn fixed(value: T) -> Self {
        let mut coefficients = [T::constant(0.0); CAPACITY];
        coefficients[0] = value;
        Self {
            coefficients,
            known: CAPACITY,
            length: 1,
        }
    }

    pub fn coefficient(&self, k: usize) -> T {
        self.coefficients[k]
    }

    fn build(known: usize, length: usize, mut coefficient: impl FnMut(&Self, usize) -> T) -> Self {
        let mut series = Self::constant(0.0);
        series.known = known;
        series.length = length.min(known);
        for k in 0..series.length {
            series.coefficients[k] = coefficient(&series, k);
        }
        series
    }
}

impl<T: Arithmetic> Add for Series<T> {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        let known = self.known.min(other.known);
        Self::build(known, self.length.max(other.length), |_, k| {
            self.coefficients[k] + other.coefficients[k]
        })
    }
}

impl<T: Arithmetic> Neg for Series<T> {
    type Output = Self;

    fn neg(self) -> Self {
        Self::build(self.known, self.length, |_, k| -self.coefficients[k])
    }
}

impl<T: Arithmetic> Sub for Series<T> {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl<T: Arithmetic> Mul for Series<T> {
    type Output = Self;

    #[allow(
        clippy::suspicious_arithmetic_impl,
        reason = "a product of series is a sum of products"
    )]
    fn mul(self, other: Self) -> Self {
        let known = self.known.min(other.known);
        let length = (self.length + other.length).saturating_sub(1);
        Self::build(known, length, |_, k| {
            let first = (k + 1).saturating_sub(other.length);
            let last = (k + 1).min(self.length);
            (first..last).fold(T::constant(0.0), |sum, j| {
                sum + self.coefficients[j] * other.coefficients[k - j]
            })
        })
    }
}

impl<T: Arithmetic> Div for Series<T> {
    type Output = Self;

    #[allow(
        clippy::suspicious_arithmetic_impl,
        reason = "a / b is a times an enclosure of 1/b"
    )]
    fn div(self, other: Self) -> Self {
        self * other.reciprocal()
    }
}

impl<T: Arithmetic> Number for Series<T> {
    fn constant(value: f64) -> Self {
        Self::fixed(T::constant(value))
    }

    fn between(lower: f64, upper: f64) -> Self {
        Self::fixed(T::between(lower, upper))
    }

    fn elementary(self, function: Elementary) -> Self {
        self.taylor_coefficients(function, 1)[0]
    }

    fn bivariate(self, other: Self, function: Bivariate) -> Self {
        bivariate(self, other, function)
    }
}

impl<T: Arithmetic> Arithmetic for Series<T> {
    fn unknown() -> Self {
        Self::new([T::unknown(); CAPACITY].into_iter())
    }

    fn range(self) -> Interval {
        self.coefficients[0].range()
    }

    /// r x = 1, coefficient by coefficient.
    fn reciprocal(self) -> Self {
        let inverse = self.coefficients[0].reciprocal();
        let length = if self.length == 1 { 1 } else { self.known };
        Self::build(self.known, length, |r, k| {
            if k == 0 {
                return inverse;
            }
            let last = (k + 1).min(self.length);
            let sum = (1..last).fold(T::constant(0.0), |sum, j| {
                sum + self.coefficients[j] * r.coefficients[k - j]
            });
            -(inverse * sum)
        })
    }

    /// Taylor's formula at the first coefficient, by Horner's rule in what follows it.
    fn taylor_coefficients(self, function: Elementary, count: usize) -> Coefficients<Self> {
        let orders = if self.length == 1 { 1 } else { self.known };
        let at = self.coefficients[0].taylor_coefficients(function, count + orders - 1);
        let mut rest = self;
        rest.coefficients[0] = T::constant(0.0);
        let expansion = |n: usize| {
            (0..orders).rev().fold(Self::constant(0.0), |sum, m| {
                // (f^(n)/n!)^(m)/m! = binomial(n+m, n) f^(n+m)/(n+m)!.
                let binomial = (1..=m).fold(1, |product, i| product * (n + i) / i);
                let mut next = sum * rest;
                let term = if binomial == 1 {
                    at[n + m]
                } else {
                    T::constant(binomial as f64) * at[n + m]
                };
                next.coefficients[0] = next.coefficients[0] + term;
                next.length = next.length.max(1);
                next
            })
        };
        std::array::from_fn(|n| {
            if n < count {
                expansion(n)
            } else {
                Self::constant(0.0)
            }
        })
    }
}
