//! sinc, sinhc and their derivatives: enclosed by their power series and a bound of what is left out.

use super::elementary::{Arithmetic, Coefficients, hyperbolic};
use super::interval::Interval;
use std::sync::LazyLock;

/// 1/n!.
fn reciprocal_factorial(n: usize) -> Interval {
    (2..=n).fold(Interval::point(1.0), |product, i| {
        product * Interval::point(i as f64).reciprocal()
    })
}

/// Powers of x that are summed.
const POWERS: usize = 14;

/// Constants of the series, worked out once.
pub(super) struct Tables {
    /// 1/n!.
    pub reciprocal_factorials: Coefficients<Interval>,
    /// Of sinc^(n)(x) / n!, the coefficients of x^(n % 2), x^(n % 2 + 2), ...
    sinc: Coefficients<[Interval; POWERS]>,
    /// 1 / (n! (m + 1)!) with the highest of these powers, m: a bound of the terms left out, per
    /// |x|^(m + 1).
    rest: Coefficients<Interval>,
    /// 1 / ((n + 1) n!), the largest |sinc^(n)| / n!.
    largest: Coefficients<Interval>,
}

pub(super) static TABLES: LazyLock<Tables> = LazyLock::new(|| Tables {
    reciprocal_factorials: std::array::from_fn(reciprocal_factorial),
    sinc: std::array::from_fn(sinc_series),
    rest: std::array::from_fn(|n| reciprocal_factorial(n) * reciprocal_factorial(highest(n) + 1)),
    largest: std::array::from_fn(|n| {
        Interval::point((n + 1) as f64).reciprocal() * reciprocal_factorial(n)
    }),
});

/// The highest power of x that is summed for sinc^(n).
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

/// sinhc^(n)(x) / n!: the series of sinc without its signs. The j-th derivative of sinhc, the integral of
/// s^j cosh^(j)(s x) over s from 0 to 1, is at most cosh x in size, which bounds the terms left out.
pub(super) fn sinhc_coefficient(n: usize, x: Interval) -> Interval {
    let square = x.square();
    let size = |c: &Interval| if c.upper < 0.0 { -*c } else { *c };
    let even = TABLES.sinc[n]
        .iter()
        .rev()
        .fold(Interval::point(0.0), |sum, coefficient| {
            sum * square + size(coefficient)
        });
    let sum = if n.is_multiple_of(2) { even } else { even * x };
    let largest = Interval::point(x.magnitude());
    let rest = (power(largest, highest(n) + 1) * TABLES.rest[n] * hyperbolic(largest).1).upper;
    sum + Interval::new(-rest, rest)
}

/// x^n, of x >= 0.
fn power(x: Interval, n: usize) -> Interval {
    let half = if n > 1 {
        power(x, n / 2)
    } else {
        Interval::point(1.0)
    };
    if n.is_multiple_of(2) {
        half * half
    } else {
        half * half * x
    }
}

/// sinc^(n)(x) / n!. The j-th derivative of sinc, the integral of s^j cos^(j)(s x) over s from 0
/// to 1, is bounded by 1/(j+1), which bounds the terms left out.
pub(super) fn sinc_coefficient(n: usize, x: Interval) -> Interval {
    let square = x.square();
    let even = TABLES.sinc[n]
        .iter()
        .rev()
        .fold(Interval::point(0.0), |sum, coefficient| {
            sum * square + *coefficient
        });
    let sum = if n.is_multiple_of(2) { even } else { even * x };
    let largest = Interval::point(x.magnitude());
    let rest = (power(largest, highest(n) + 1) * TABLES.rest[n]).upper;
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
