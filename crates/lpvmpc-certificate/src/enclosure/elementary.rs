//! Enclosures of the functions that a plant's formulas may use.

use super::interval::Interval;
use lpvmpc::{Elementary, Number};
use std::sync::LazyLock;

/// Taylor coefficients that are looked at, at most.
pub const MOST_COEFFICIENTS: usize = 12;

/// The coefficients of a power series, the lowest first.
pub type Coefficients<T> = [T; MOST_COEFFICIENTS];

/// Numbers, or sets of numbers, whose functions have Taylor coefficients that can be enclosed.
pub trait Arithmetic: Number {
    /// 1/x; without bound where x may be zero.
    fn reciprocal(self) -> Self;

    /// f^(n)(x) / n! for n = 0 to `count` - 1; what follows is zero.
    fn taylor_coefficients(self, function: Elementary, count: usize) -> Coefficients<Self>;
}

/// Enclosures of f^(n)(x) / n! over `x`, n = 0 to `count` - 1; without bound where `x` leaves the
/// domain of f.
pub(super) fn taylor_coefficients(
    function: Elementary,
    count: usize,
    x: Interval,
) -> Coefficients<Interval> {
    let mut coefficients = [Interval::point(0.0); MOST_COEFFICIENTS];
    let places = coefficients.iter_mut().take(count).enumerate();
    match function {
        Elementary::Sin | Elementary::Cos => {
            let (sin, cos) = (wave(x, 0.5, f64::sin), wave(x, 0.0, f64::cos));
            // The derivatives of sin; those of cos begin one later.
            let derivatives = [sin, cos, -sin, -cos];
            let first = if function == Elementary::Sin { 0 } else { 1 };
            for (n, place) in places {
                *place = derivatives[(first + n) % 4] * TABLES.reciprocal_factorials[n];
            }
        }
        Elementary::Sinc => places.for_each(|(n, place)| *place = sinc_coefficient(n, x)),
        Elementary::Exp => {
            let value = rising(x, f64::exp).common(Interval::new(0.0, f64::INFINITY));
            places.for_each(|(n, place)| *place = value * TABLES.reciprocal_factorials[n]);
        }
        Elementary::Atan => recursion(places, atan_value(x), |n, known| atan_next(x, n, known)),
        Elementary::Tanh => {
            let value = rising(x, f64::tanh).common(Interval::new(-1.0, 1.0));
            recursion(places, value, tanh_next);
        }
        Elementary::Ln | Elementary::Sqrt if x.lower <= 0.0 => {
            coefficients[..count].fill(Interval::EVERYTHING);
        }
        Elementary::Ln => recursion(places, rising(x, f64::ln), |n, known| ln_next(x, n, known)),
        Elementary::Sqrt => {
            let value = rising(x, f64::sqrt);
            recursion(places, value, |n, known| sqrt_next(x, n, known));
        }
    }
    coefficients
}

/// The first coefficient is `value`; `next` makes coefficient n from those before.
fn recursion<'a>(
    places: impl Iterator<Item = (usize, &'a mut Interval)>,
    value: Interval,
    next: impl Fn(usize, &[Interval]) -> Interval,
) {
    let mut known = Vec::with_capacity(MOST_COEFFICIENTS);
    for (n, place) in places {
        let coefficient = if n == 0 { value } else { next(n, &known) };
        known.push(coefficient);
        *place = coefficient;
    }
}

/// ln: (-1)^(n+1) / (n x^n).
fn ln_next(x: Interval, n: usize, known: &[Interval]) -> Interval {
    if n == 1 {
        return x.reciprocal();
    }
    let ratio = whole(n - 1) * whole(n).reciprocal();
    -(known[n - 1] * ratio * x.reciprocal())
}

/// sqrt: binomial(1/2, n) x^(1/2 - n).
fn sqrt_next(x: Interval, n: usize, known: &[Interval]) -> Interval {
    let factor = Interval::point(1.5 - n as f64) * whole(n).reciprocal();
    known[n - 1] * factor * x.reciprocal()
}

/// tanh: h' = 1 - h^2.
fn tanh_next(n: usize, known: &[Interval]) -> Interval {
    let squared = (0..n).fold(Interval::point(0.0), |sum, j| {
        sum + known[j] * known[n - 1 - j]
    });
    let constant = Interval::point(if n == 1 { 1.0 } else { 0.0 });
    (constant - squared) * whole(n).reciprocal()
}

fn atan_value(x: Interval) -> Interval {
    let right_angle = widened(std::f64::consts::FRAC_PI_2).upper;
    rising(x, f64::atan).common(Interval::new(-right_angle, right_angle))
}

/// arctan: (1 + x^2) h' + 2 x t h' + t^2 h' = 1 along x + t; no coefficient is larger than 1/n.
fn atan_next(x: Interval, n: usize, known: &[Interval]) -> Interval {
    let scale = (Interval::point(1.0) + x.square()).reciprocal();
    let bound = whole(n).reciprocal();
    // The coefficient of t^(k) in h'.
    let slope = |k: usize| whole(k + 1) * known[k + 1];
    let rest = match n {
        1 => Interval::point(1.0),
        2 => -(Interval::point(2.0) * x * slope(0)),
        _ => -(Interval::point(2.0) * x * slope(n - 2) + slope(n - 3)),
    };
    (rest * scale * bound).common(Interval::new(-bound.upper, bound.upper))
}

fn whole(n: usize) -> Interval {
    Interval::point(n as f64)
}

/// A function that rises over the whole of `x`.
fn rising(x: Interval, function: fn(f64) -> f64) -> Interval {
    let (lower, upper) = (widened(function(x.lower)), widened(function(x.upper)));
    if lower.lower.is_nan() || upper.upper.is_nan() {
        return Interval::EVERYTHING;
    }
    lower.hull(upper)
}

/// The library's functions are taken to be within this many units in the last place. Those in use
/// are within two.
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
