//! Numbers with their derivatives by the parameters: forward differentiation, exact to rounding.

#![allow(
    clippy::suspicious_arithmetic_impl,
    reason = "the rules of product and quotient mix the operators"
)]

use std::ops::{Add, Div, Mul, Neg, Sub};

/// Parameters of a model, at most.
pub const PARAMETERS: usize = 9;

/// A value and its derivative by each parameter.
#[derive(Clone, Copy)]
pub struct Dual {
    pub value: f64,
    pub slopes: [f64; PARAMETERS],
}

impl Dual {
    pub fn parameter(value: f64, index: usize) -> Self {
        let mut slopes = [0.0; PARAMETERS];
        slopes[index] = 1.0;
        Self { value, slopes }
    }

    /// f of this number, where f has this value and this slope.
    fn through(self, value: f64, slope: f64) -> Self {
        Self {
            value,
            slopes: self.slopes.map(|one| slope * one),
        }
    }

    pub fn exp(self) -> Self {
        self.through(self.value.exp(), self.value.exp())
    }

    pub fn ln(self) -> Self {
        self.through(self.value.ln(), 1.0 / self.value)
    }

    pub fn sqrt(self) -> Self {
        self.through(self.value.sqrt(), 0.5 / self.value.sqrt())
    }

    pub fn sin(self) -> Self {
        self.through(self.value.sin(), self.value.cos())
    }

    pub fn cos(self) -> Self {
        self.through(self.value.cos(), -self.value.sin())
    }

    pub fn atan(self) -> Self {
        self.through(self.value.atan(), 1.0 / (1.0 + self.value * self.value))
    }
}

impl From<f64> for Dual {
    fn from(value: f64) -> Self {
        Self {
            value,
            slopes: [0.0; PARAMETERS],
        }
    }
}

impl Neg for Dual {
    type Output = Self;
    fn neg(self) -> Self {
        self.through(-self.value, -1.0)
    }
}

impl<T: Into<Self>> Add<T> for Dual {
    type Output = Self;
    fn add(self, other: T) -> Self {
        let other = other.into();
        Self {
            value: self.value + other.value,
            slopes: std::array::from_fn(|i| self.slopes[i] + other.slopes[i]),
        }
    }
}

impl<T: Into<Self>> Sub<T> for Dual {
    type Output = Self;
    fn sub(self, other: T) -> Self {
        let other = other.into();
        Self {
            value: self.value - other.value,
            slopes: std::array::from_fn(|i| self.slopes[i] - other.slopes[i]),
        }
    }
}

impl<T: Into<Self>> Mul<T> for Dual {
    type Output = Self;
    fn mul(self, other: T) -> Self {
        let other = other.into();
        Self {
            value: self.value * other.value,
            slopes: std::array::from_fn(|i| {
                self.slopes[i] * other.value + self.value * other.slopes[i]
            }),
        }
    }
}

impl<T: Into<Self>> Div<T> for Dual {
    type Output = Self;
    fn div(self, other: T) -> Self {
        let other = other.into();
        let value = self.value / other.value;
        Self {
            value,
            slopes: std::array::from_fn(|i| {
                (self.slopes[i] - value * other.slopes[i]) / other.value
            }),
        }
    }
}
