//! Taylor models of order two over a box.

use super::elementary::{self, Arithmetic, Coefficients, MOST_COEFFICIENTS};
use super::interval::Interval;
use lpvmpc::{Bivariate, Elementary, Number};
use std::ops::{Add, Div, Mul, Neg, Sub};

/// A quantity over the box -1 <= z_i <= 1: at every z its value is within `error` of
/// `middle` + sum of [`slopes`](Self::slopes) z_i + sum over i <= j of [`squares`](Self::squares) z_i z_j (Taylor model:
/// Makino and Berz, Taylor models and other validated functional inclusion methods, 2003). What
/// it knows of z makes enclosures converge with the third power of the box's width, where
/// intervals converge with the width.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TaylorModel<const D: usize> {
    /// The value at z = 0, up to the error.
    pub middle: f64,
    slopes: [f64; D],
    squares: [[f64; D]; D],
    /// The largest distance from the true value, rounding included; infinite when unknown.
    pub error: f64,
    /// Otherwise the slopes and squares are zero: known without looking at each of them.
    varies: bool,
}

/// Relative error of one rounding.
const UNIT: f64 = f64::EPSILON / 2.0;
/// More than the absolute error of a few dozen roundings in the subnormal range.
const TINY: f64 = 1e-290;
/// Makes a sum of up to 256 positive terms an upper bound in spite of its own rounding, and a difference of two
/// such sums that is at least half of each: a model of 16 variables has 153 coefficients.
const UPWARDS: f64 = 1.0 + 256.0 * f64::EPSILON;
/// Coefficients are finite, with room for their rounding, where their sizes are below it.
const LARGEST: f64 = 1e300;
/// No coefficient of a sum or product takes more roundings.
const ROUNDINGS: f64 = 16.0 * UNIT;

/// Bounds of the polynomial's parts over the box.
struct Sizes {
    middle: f64,
    slopes: f64,
    squares: f64,
}

impl Sizes {
    fn sum(&self) -> f64 {
        self.middle + self.slopes + self.squares
    }
}

impl<const D: usize> TaylorModel<D> {
    /// `middle` + `half_width` z_`symbol`.
    pub fn symbol(middle: f64, half_width: f64, symbol: usize) -> Self {
        let mut model = Self::constant(middle);
        model.slopes[symbol] = half_width;
        model.varies = true;
        model
    }

    /// Its linear dependence on z.
    pub fn slopes(&self) -> &[f64; D] {
        &self.slopes
    }

    /// Its quadratic dependence on z; the part below the diagonal is zero.
    pub fn squares(&self) -> &[[f64; D]; D] {
        &self.squares
    }

    /// All its values over the box.
    pub fn range(self) -> Interval {
        let Sizes {
            slopes, squares, ..
        } = self.sizes();
        // z_i^2 is 1/2, give or take 1/2.
        let diagonal = (0..D).map(|i| 0.5 * self.squares[i][i]);
        let (shift, saved) = diagonal.fold((0.0, 0.0), |(sum, size): (f64, f64), half| {
            (sum + half, size + half.abs())
        });
        let rounding = ROUNDINGS * (self.middle.abs() + squares);
        let radius = ((slopes + (squares - saved).max(0.0) + self.error) + rounding) * UPWARDS;
        Interval::around(self.middle + shift, radius)
    }

    fn sizes(&self) -> Sizes {
        let mut sizes = Sizes {
            middle: self.middle.abs(),
            slopes: 0.0,
            squares: 0.0,
        };
        if !self.varies {
            return sizes;
        }
        for i in 0..D {
            sizes.slopes += self.slopes[i].abs();
            for square in &self.squares[i][i..] {
                sizes.squares += square.abs();
            }
        }
        sizes
    }

    fn is_zero(&self) -> bool {
        self.middle == 0.0 && self.error == 0.0 && !self.varies
    }

    /// The polynomial with the given coefficients.
    pub(super) fn polynomial(
        middle: f64,
        slope: impl Fn(usize) -> f64,
        square: impl Fn(usize, usize) -> f64,
    ) -> Self {
        let mut model = Self::constant(middle);
        model.varies = true;
        for i in 0..D {
            model.slopes[i] = slope(i);
            for j in i..D {
                model.squares[i][j] = square(i, j);
            }
        }
        model
    }

    /// With the errors `terms`, themselves rounded. No sum of absolute coefficients is above `size`.
    fn within(mut self, terms: f64, size: f64) -> Self {
        let error = terms * UPWARDS + TINY;
        // A NaN anywhere is an unknown, and so is what has overflowed, or nearly: then `size` is one.
        let known = size < LARGEST && !error.is_nan();
        self.error = if known { error } else { f64::INFINITY };
        self
    }
}

impl<const D: usize> From<Interval> for TaylorModel<D> {
    fn from(interval: Interval) -> Self {
        let mut model = Self::constant(interval.middle());
        model.error = interval.radius();
        if interval.lower == interval.upper {
            model.error = 0.0;
        }
        if !(model.middle.is_finite() && model.error.is_finite()) {
            model.middle = 0.0;
            model.error = f64::INFINITY;
        }
        model
    }
}

impl<const D: usize> Add for TaylorModel<D> {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        if self.is_zero() {
            return other;
        }
        if other.is_zero() {
            return self;
        }
        let middle = self.middle + other.middle;
        let sum = match (self.varies, other.varies) {
            (true, true) => Self::polynomial(
                middle,
                |i| self.slopes[i] + other.slopes[i],
                |i, j| self.squares[i][j] + other.squares[i][j],
            ),
            (true, false) => Self { middle, ..self },
            (false, _) => Self { middle, ..other },
        };
        let size = sum.sizes().sum();
        sum.within(self.error + other.error + ROUNDINGS * size, size)
    }
}

impl<const D: usize> Neg for TaylorModel<D> {
    type Output = Self;

    fn neg(self) -> Self {
        let negative = if self.varies {
            Self::polynomial(
                -self.middle,
                |i| -self.slopes[i],
                |i, j| -self.squares[i][j],
            )
        } else {
            Self::constant(-self.middle)
        };
        Self {
            error: self.error,
            ..negative
        }
    }
}

impl<const D: usize> Sub for TaylorModel<D> {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl<const D: usize> Mul for TaylorModel<D> {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        if self.is_zero() || other.is_zero() {
            // What has no bound may have no value, 1/0, and then neither has the product.
            let unknown = !(self.error.is_finite() && other.error.is_finite());
            return Self {
                error: if unknown { f64::INFINITY } else { 0.0 },
                ..Self::constant(0.0)
            };
        }
        let (p, q) = (&self.slopes, &other.slopes);
        let (a, b) = (self.middle, other.middle);
        let scaled = |factor: f64, model: &Self| {
            Self::polynomial(
                a * b,
                |i| factor * model.slopes[i],
                |i, j| factor * model.squares[i][j],
            )
        };
        let product = match (self.varies, other.varies) {
            (true, true) => Self::polynomial(
                a * b,
                |i| a * q[i] + b * p[i],
                |i, j| {
                    let mixed = if i == j {
                        p[i] * q[i]
                    } else {
                        p[i] * q[j] + p[j] * q[i]
                    };
                    a * other.squares[i][j] + b * self.squares[i][j] + mixed
                },
            ),
            (true, false) => scaled(b, &self),
            (false, true) => scaled(a, &other),
            (false, false) => Self::constant(a * b),
        };
        let (a, b) = (self.sizes(), other.sizes());
        // Of order three and four.
        let beyond = a.slopes * b.squares + a.squares * b.slopes + a.squares * b.squares;
        let errors = self.error * (b.sum() + other.error) + other.error * a.sum();
        let size = a.sum() * b.sum();
        product.within(beyond + errors + ROUNDINGS * size, size)
    }
}

impl<const D: usize> Div for TaylorModel<D> {
    type Output = Self;

    #[allow(
        clippy::suspicious_arithmetic_impl,
        reason = "a / b is a times an enclosure of 1/b"
    )]
    fn div(self, other: Self) -> Self {
        self * other.reciprocal()
    }
}

impl<const D: usize> Number for TaylorModel<D> {
    fn constant(value: f64) -> Self {
        Self {
            middle: value,
            slopes: [0.0; D],
            squares: [[0.0; D]; D],
            error: 0.0,
            varies: false,
        }
    }

    fn between(lower: f64, upper: f64) -> Self {
        Self::from(Interval::new(lower, upper))
    }

    fn elementary(self, function: Elementary) -> Self {
        self.taylor_coefficients(function, 1)[0]
    }

    fn bivariate(self, other: Self, function: Bivariate) -> Self {
        elementary::bivariate(self, other, function)
    }
}

impl<const D: usize> Arithmetic for TaylorModel<D> {
    fn unknown() -> Self {
        Self::from(Interval::EVERYTHING)
    }

    fn range(self) -> Interval {
        self.range()
    }

    fn within(range: Interval) -> Self {
        Self::from(range)
    }

    /// Most entries of a plant's matrices are zero.
    fn plus_product(self, a: &Self, b: &Self) -> Self {
        let nothing = |zero: &Self, other: &Self| zero.is_zero() && other.error.is_finite();
        if nothing(a, b) || nothing(b, a) {
            return self;
        }
        self + *a * *b
    }

    /// 1/x = 1/c - (x - c)/c^2 + (x - c)^2/c^3 - (x - c)^3/(c^3 x).
    fn reciprocal(self) -> Self {
        let inverse = Interval::point(self.middle).reciprocal();
        let square = inverse.square();
        let cube = square * inverse;
        self.expansion([inverse, -square, cube, -(cube * self.range().reciprocal())])
    }

    fn taylor_coefficients(self, function: Elementary, count: usize) -> Coefficients<Self> {
        let centre =
            elementary::taylor_coefficients(function, count + 2, Interval::point(self.middle));
        let range = elementary::taylor_coefficients(function, count + 3, self.range());
        let mut coefficients = [Self::constant(0.0); MOST_COEFFICIENTS];
        for (n, place) in coefficients.iter_mut().enumerate().take(count) {
            // (f^(n)/n!)^(m)/m! = binomial(n+m, m) f^(n+m)/(n+m)!.
            let binomials = [
                1,
                n + 1,
                (n + 1) * (n + 2) / 2,
                (n + 1) * (n + 2) * (n + 3) / 6,
            ];
            let times =
                |m: usize, derivative: Interval| Interval::point(binomials[m] as f64) * derivative;
            *place = self.expansion([
                centre[n],
                times(1, centre[n + 1]),
                times(2, centre[n + 2]),
                times(3, range[n + 3]),
            ]);
            // Over a kink there are no further derivatives, but there is a value.
            if !place.error.is_finite() {
                *place = Self::from(range[n]);
            }
        }
        coefficients
    }
}

impl<const D: usize> TaylorModel<D> {
    /// The sum of `terms[m]` (x - c)^m, m = 0 to 3, with c = `middle`.
    fn expansion(self, terms: [Interval; 4]) -> Self {
        let deviation = Self {
            middle: 0.0,
            ..self
        };
        let [value, slope, curvature, rest] = terms;
        // With R = max |x - c|, (x - c)^3 is 3/4 R^2 (x - c), give or take R^3/4.
        let radius = Interval::point(deviation.range().magnitude());
        let square = radius.square();
        let sign = Interval::new(-1.0, 1.0);
        let middle = Interval::point(rest.middle());
        let slope = slope + middle * square * Interval::point(0.75);
        let cube = square * radius * sign;
        let rest = (middle * Interval::point(0.25) + Interval::point(rest.radius()) * sign) * cube;
        let [value, slope, curvature] = [value, slope, curvature].map(Self::from);
        value + deviation * (slope + deviation * curvature) + Self::from(rest)
    }
}
