//! Affine forms over a box.

use super::elementary::{Arithmetic, Coefficients, Elementary, MOST_COEFFICIENTS};
use super::interval::Interval;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// A quantity over the box -1 <= z_i <= 1: at every z its value is within `error` of
/// `middle` + sum of `slopes[i]` z_i (affine arithmetic with one common error term; de Figueiredo
/// and Stolfi 2004). What it knows of z makes enclosures converge with the square of the box's
/// width, where intervals converge with the width.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Affine<const D: usize> {
    /// The value at z = 0, up to the error.
    pub middle: f64,
    /// Its dependence on z.
    pub slopes: [f64; D],
    /// The largest distance from the true value, rounding included; infinite when unknown.
    pub error: f64,
}

/// Relative error of one rounding.
const UNIT: f64 = f64::EPSILON / 2.0;
/// More than the absolute error of a few dozen roundings in the subnormal range.
const TINY: f64 = 1e-290;
/// Makes a sum of a few dozen positive terms an upper bound in spite of its own rounding.
const UPWARDS: f64 = 1.0 + 64.0 * f64::EPSILON;

impl<const D: usize> Affine<D> {
    /// `middle` + `half_width` z_`symbol`.
    pub fn symbol(middle: f64, half_width: f64, symbol: usize) -> Self {
        let mut form = Self::constant(middle);
        form.slopes[symbol] = half_width;
        form
    }

    /// All its values over the box.
    pub fn range(self) -> Interval {
        let radius = (self.deviation() + self.error) * UPWARDS;
        Interval::around(self.middle, radius)
    }

    /// The largest deviation from `middle`, without the error.
    fn deviation(&self) -> f64 {
        self.slopes.iter().map(|slope| slope.abs()).sum()
    }

    fn is_zero(&self) -> bool {
        self.middle == 0.0 && self.error == 0.0 && self.slopes == [0.0; D]
    }

    /// The form with the errors `terms`, and the roundings of its `middle` and `slopes`, each of
    /// at most three operations.
    fn rounded(middle: f64, slopes: [f64; D], terms: f64) -> Self {
        let form = Self {
            middle,
            slopes,
            error: 0.0,
        };
        let size = middle.abs() + form.deviation();
        let error = (terms + 4.0 * UNIT * size) * UPWARDS + TINY;
        Self {
            // A NaN anywhere is an unknown.
            error: if error.is_nan() { f64::INFINITY } else { error },
            ..form
        }
    }
}

impl<const D: usize> From<Interval> for Affine<D> {
    fn from(interval: Interval) -> Self {
        let mut form = Self::constant(interval.middle());
        form.error = interval.radius();
        if interval.lower == interval.upper {
            form.error = 0.0;
        }
        if !(form.middle.is_finite() && form.error.is_finite()) {
            form.middle = 0.0;
            form.error = f64::INFINITY;
        }
        form
    }
}

impl<const D: usize> Add for Affine<D> {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        if self.is_zero() {
            return other;
        }
        if other.is_zero() {
            return self;
        }
        let slopes = std::array::from_fn(|i| self.slopes[i] + other.slopes[i]);
        Self::rounded(self.middle + other.middle, slopes, self.error + other.error)
    }
}

impl<const D: usize> Neg for Affine<D> {
    type Output = Self;

    fn neg(self) -> Self {
        Self {
            middle: -self.middle,
            slopes: self.slopes.map(|slope| -slope),
            error: self.error,
        }
    }
}

impl<const D: usize> Sub for Affine<D> {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl<const D: usize> Mul for Affine<D> {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        if self.is_zero() || other.is_zero() {
            return Self::constant(0.0);
        }
        let (a, b) = (self.middle, other.middle);
        let slopes: [f64; D] = std::array::from_fn(|i| a * other.slopes[i] + b * self.slopes[i]);
        let (da, db) = (self.deviation(), other.deviation());
        // z_i^2 is 1/2, give or take 1/2.
        let squares: [f64; D] = std::array::from_fn(|i| 0.5 * self.slopes[i] * other.slopes[i]);
        let (shift, saved): (f64, f64) = (
            squares.iter().sum(),
            squares.iter().map(|square| square.abs()).sum(),
        );
        // The rounding of a sum of two products that cancel is that of the products.
        let cancelled = a.abs() * db + b.abs() * da;
        let terms = (da * db * UPWARDS - saved).max(0.0)
            + self.error * (b.abs() + db + other.error)
            + other.error * (a.abs() + da)
            + 8.0 * UNIT * (cancelled + da * db);
        Self::rounded(a * b + shift, slopes, terms + 4.0 * UNIT * (a * b).abs())
    }
}

impl<const D: usize> Div for Affine<D> {
    type Output = Self;

    #[allow(
        clippy::suspicious_arithmetic_impl,
        reason = "a / b is a times an enclosure of 1/b"
    )]
    fn div(self, other: Self) -> Self {
        self * other.reciprocal()
    }
}

impl<const D: usize> Arithmetic for Affine<D> {
    fn constant(value: f64) -> Self {
        Self {
            middle: value,
            slopes: [0.0; D],
            error: 0.0,
        }
    }

    /// 1/x = 1/c - (x - c)/c^2 + (x - c)^2/(c^2 x).
    fn reciprocal(self) -> Self {
        let centre = Interval::point(self.middle);
        let inverse = centre.reciprocal();
        let slope = -(inverse.square());
        let curvature = inverse.square() * self.range().reciprocal();
        self.expansion(inverse, slope, curvature)
    }

    fn taylor_coefficients(self, function: Elementary, count: usize) -> Coefficients<Self> {
        let centre = function.taylor_coefficients(count + 1, Interval::point(self.middle));
        let range = function.taylor_coefficients(count + 2, self.range());
        let mut coefficients = [Self::constant(0.0); MOST_COEFFICIENTS];
        for (n, place) in coefficients.iter_mut().enumerate().take(count) {
            let slope = Interval::point((n + 1) as f64) * centre[n + 1];
            // (f^(n)/n!)''/2 = (n+1)(n+2)/2 f^(n+2)/(n+2)!.
            let curvature = Interval::point(((n + 1) * (n + 2)) as f64 / 2.0) * range[n + 2];
            *place = self.expansion(centre[n], slope, curvature);
        }
        coefficients
    }
}

impl<const D: usize> Affine<D> {
    /// value + slope (x - c) + curvature (x - c)^2 with c = `middle`.
    fn expansion(self, value: Interval, slope: Interval, curvature: Interval) -> Self {
        let deviation = Self {
            middle: 0.0,
            ..self
        };
        let square = Interval::new(0.0, deviation.range().square().upper);
        Self::from(value) + Self::from(slope) * deviation + Self::from(curvature * square)
    }
}
