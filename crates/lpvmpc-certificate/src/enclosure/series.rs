//! Power series in time.

use super::elementary::{Arithmetic, Coefficients, bivariate};
use super::interval::Interval;
use lpvmpc::{Bivariate, Elementary, Number};
use std::ops::{Add, Div, Mul, Neg, Sub};

/// Coefficients that a [`Series`] can hold: more is not needed in one step.
pub(super) const CAPACITY: usize = 7;

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

    /// `value` + `slope` t, of which the first `known` coefficients count.
    pub fn line(value: T, slope: T, known: usize) -> Self {
        let mut series = Self::fixed(value);
        series.coefficients[1] = slope;
        series.known = known;
        series.length = 2;
        series
    }

    pub fn coefficient(&self, k: usize) -> &T {
        &self.coefficients[k]
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
                sum.plus_product(&self.coefficients[j], &other.coefficients[k - j])
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
        self.expansion(&self.at_the_beginning(function, 1), 0)
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

    fn within(range: Interval) -> Self {
        let mut series = Self::unknown();
        series.coefficients[0] = T::within(range);
        series
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
                sum.plus_product(&self.coefficients[j], &r.coefficients[k - j])
            });
            -(inverse * sum)
        })
    }

    fn taylor_coefficients(self, function: Elementary, count: usize) -> Coefficients<Self> {
        let at = self.at_the_beginning(function, count);
        std::array::from_fn(|n| match n < count {
            true => self.expansion(&at, n),
            false => Self::constant(0.0),
        })
    }
}

impl<T: Arithmetic> Series<T> {
    /// Orders of a function of the series that are not zero.
    fn orders(&self) -> usize {
        if self.length == 1 { 1 } else { self.known }
    }

    /// f^(n)(c_0) / n! as far as the first `count` functions f^(n)/n! of the series need them.
    fn at_the_beginning(&self, function: Elementary, count: usize) -> Coefficients<T> {
        self.coefficients[0].taylor_coefficients(function, count + self.orders() - 1)
    }

    /// f^(n)/n! of the series: Taylor's formula at its first coefficient, by Horner's rule in what
    /// follows it.
    fn expansion(&self, at: &Coefficients<T>, n: usize) -> Self {
        let orders = self.orders();
        let mut sum = Self::constant(0.0);
        sum.known = self.known;
        sum.length = orders;
        for m in (0..orders).rev() {
            // What follows the first coefficient begins with t: of the sum, which is still to be
            // multiplied m times by it, no later coefficients count. From the last to the first, since
            // each needs the earlier ones as they were.
            for k in (1..orders - m).rev() {
                let first = (k + 1).saturating_sub(self.length);
                sum.coefficients[k] = (first..k).fold(T::constant(0.0), |total, j| {
                    total.plus_product(&sum.coefficients[j], &self.coefficients[k - j])
                });
            }
            // (f^(n)/n!)^(m)/m! = binomial(n+m, n) f^(n+m)/(n+m)!.
            let binomial = (1..=m).fold(1, |product, i| product * (n + i) / i);
            sum.coefficients[0] = match binomial {
                1 => at[n + m],
                _ => T::constant(binomial as f64) * at[n + m],
            };
        }
        sum
    }
}
