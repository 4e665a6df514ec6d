//! The functions that a model's formulas may use.

use super::interval::Interval;
use std::ops::{Add, Div, Mul, Neg, Sub};
use std::sync::LazyLock;

/// Taylor coefficients that are looked at, at most.
pub const MOST_COEFFICIENTS: usize = 12;

/// The coefficients of a power series, the lowest first.
pub type Coefficients<T> = [T; MOST_COEFFICIENTS];

/// Numbers, or sets of numbers, that a model's formulas can be evaluated on.
pub trait Arithmetic:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// The number `value`, exactly.
    fn constant(value: f64) -> Self;

    /// 1/x; without bound where x may be zero.
    fn reciprocal(self) -> Self;

    /// f^(n)(x) / n! for n = 0 to `count` - 1; what follows is zero.
    fn taylor_coefficients(self, function: Elementary, count: usize) -> Coefficients<Self>;

    /// sin x, `x` in rad.
    fn sin(self) -> Self {
        self.taylor_coefficients(Elementary::Sin, 1)[0]
    }

    /// cos x, `x` in rad.
    fn cos(self) -> Self {
        self.taylor_coefficients(Elementary::Cos, 1)[0]
    }

    /// sin(x)/x, 1 at 0; `x` in rad.
    fn sinc(self) -> Self {
        self.taylor_coefficients(Elementary::Sinc, 1)[0]
    }
}

/// Functions whose Taylor coefficients are known everywhere.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Elementary {
    /// sin x.
    Sin,
    /// cos x.
    Cos,
    /// sin(x)/x, 1 at 0.
    Sinc,
}

impl Elementary {
    /// Enclosures of f^(n)(x) / n! over `x`, n = 0 to `count` - 1.
    pub(super) fn taylor_coefficients(self, count: usize, x: Interval) -> Coefficients<Interval> {
        let mut coefficients = [Interval::point(0.0); MOST_COEFFICIENTS];
        if self == Self::Sinc {
            for (n, place) in coefficients.iter_mut().enumerate().take(count) {
                *place = sinc_coefficient(n, x);
            }
            return coefficients;
        }
        let (sin, cos) = (wave(x, 0.5, f64::sin), wave(x, 0.0, f64::cos));
        // The derivatives of sin; those of cos begin one later.
        let derivatives = [sin, cos, -sin, -cos];
        let first = if self == Self::Sin { 0 } else { 1 };
        for (n, place) in coefficients.iter_mut().enumerate().take(count) {
            *place = derivatives[(first + n) % 4] * TABLES.reciprocal_factorials[n];
        }
        coefficients
    }
}

/// The library's sine and cosine are taken to be within this many units in the last place. Those
/// in use are below one.
const LIBRARY_ULPS: usize = 4;

/// sin or cos over `x`, with its extrema (-1)^i at (i + `phase`) pi.
fn wave(x: Interval, phase: f64, function: fn(f64) -> f64) -> Interval {
    const FAR: f64 = 1e3;
    // The extrema are counted in rounded numbers, one too many when in doubt.
    const DOUBT: f64 = 1e-9;
    let whole = Interval::new(-1.0, 1.0);
    if x.magnitude() > FAR || x.magnitude().is_nan() {
        return whole;
    }
    let before = (x.lower / std::f64::consts::PI - phase - DOUBT).floor();
    let last = (x.upper / std::f64::consts::PI - phase + DOUBT).floor();
    let ends = widened(function(x.lower)).hull(widened(function(x.upper)));
    let extremum = |i: f64| Interval::point(if i % 2.0 == 0.0 { 1.0 } else { -1.0 });
    let range = match last - before {
        0.0 => ends,
        1.0 => ends.hull(extremum(last)),
        _ => whole,
    };
    range.common(whole)
}

fn widened(value: f64) -> Interval {
    let (mut lower, mut upper) = (value, value);
    for _ in 0..LIBRARY_ULPS {
        (lower, upper) = (lower.next_down(), upper.next_up());
    }
    Interval::new(lower, upper)
}

fn reciprocal_factorial(n: usize) -> Interval {
    (2..=n).fold(Interval::point(1.0), |product, i| {
        product * Interval::point(i as f64).reciprocal()
    })
}

/// Powers of x that are summed.
const POWERS: usize = 14;

/// Constants of the series, worked out once.
struct Tables {
    /// 1/n!.
    reciprocal_factorials: Coefficients<Interval>,
    /// Of sinc^(n)(x) / n!, the coefficients of x^(n % 2), x^(n % 2 + 2), ...
    sinc: Coefficients<[Interval; POWERS]>,
    /// 1 / (n! (m + 1)!) with the highest of these powers, m: a bound of the terms left out, per
    /// |x|^(m + 1).
    rest: Coefficients<Interval>,
    /// 1 / ((n + 1) n!), the largest |sinc^(n)| / n!.
    largest: Coefficients<Interval>,
}

static TABLES: LazyLock<Tables> = LazyLock::new(|| Tables {
    reciprocal_factorials: std::array::from_fn(reciprocal_factorial),
    sinc: std::array::from_fn(sinc_series),
    rest: std::array::from_fn(|n| reciprocal_factorial(n) * reciprocal_factorial(highest(n) + 1)),
    largest: std::array::from_fn(|n| {
        Interval::point((n + 1) as f64).reciprocal() * reciprocal_factorial(n)
    }),
});

fn highest(n: usize) -> usize {
    n % 2 + 2 * (POWERS - 1)
}

/// The coefficients of sinc^(n)(x) / n! = sum over 2k >= n of
/// (-1)^k binomial(2k, n) x^(2k-n) / (2k+1)!.
fn sinc_series(n: usize) -> [Interval; POWERS] {
    let mut coefficient = lowest_coefficient(n);
    std::array::from_fn(|i| {
        if i > 0 {
            // With m = 2k - n, that of x^m from that of x^(m-2).
            let m = n % 2 + 2 * i;
            let ratio = Interval::point((m + n - 1) as f64)
                * Interval::point(((m + n + 1) * m * (m - 1)) as f64).reciprocal();
            coefficient = -(coefficient * ratio);
        }
        coefficient
    })
}

/// sinc^(n)(x) / n!. The j-th derivative of sinc, the integral of s^j cos^(j)(s x) over s from 0
/// to 1, is bounded by 1/(j+1), which bounds the terms left out.
fn sinc_coefficient(n: usize, x: Interval) -> Interval {
    let square = x.square();
    let even = TABLES.sinc[n]
        .iter()
        .rev()
        .fold(Interval::point(0.0), |sum, coefficient| {
            sum * square + *coefficient
        });
    let sum = if n.is_multiple_of(2) { even } else { even * x };
    let largest = Interval::point(x.magnitude());
    let power = (0..=highest(n)).fold(Interval::point(1.0), |power, _| power * largest);
    let rest = (power * TABLES.rest[n]).upper;
    let bound = TABLES.largest[n].upper;
    (sum + Interval::new(-rest, rest)).common(Interval::new(-bound, bound))
}

/// The coefficient of x^(n % 2): (-1)^k binomial(2k, n) / (2k+1)! with 2k = n or n + 1.
fn lowest_coefficient(n: usize) -> Interval {
    let (k, binomial) = if n.is_multiple_of(2) {
        (n / 2, 1.0)
    } else {
        (n.div_ceil(2), (n + 1) as f64)
    };
    let size = Interval::point(binomial) * reciprocal_factorial(2 * k + 1);
    if k.is_multiple_of(2) { size } else { -size }
}
