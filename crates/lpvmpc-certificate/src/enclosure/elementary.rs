//! Enclosures of the functions that a plant's formulas may use.

use super::interval::Interval;
use super::sinc::{TABLES, sinc_coefficient, sinhc_coefficient};
use lpvmpc::{Bivariate, Elementary, Number};

/// Taylor coefficients that are looked at, at most.
pub const MOST_COEFFICIENTS: usize = 12;

/// The coefficients of a power series, the lowest first.
pub type Coefficients<T> = [T; MOST_COEFFICIENTS];

/// Numbers, or sets of numbers, whose functions have Taylor coefficients that can be enclosed.
pub trait Arithmetic: Number {
    /// What is not known at all.
    fn unknown() -> Self;

    /// All its values; of a series, at its beginning.
    fn range(self) -> Interval;

    /// 1/x; without bound where x may be zero.
    fn reciprocal(self) -> Self;

    /// What is only known to be in this range, as the slope of a kink is: of a series, the beginning alone.
    fn within(range: Interval) -> Self;

    /// Self + a b.
    fn plus_product(self, a: &Self, b: &Self) -> Self {
        self + *a * *b
    }

    /// f^(n)(x) / n! for n = 0 to `count` - 1; what follows is zero.
    fn taylor_coefficients(self, function: Elementary, count: usize) -> Coefficients<Self>;
}

/// A function of two numbers. What jumps is not known.
pub(super) fn bivariate<T: Arithmetic>(x: T, y: T, function: Bivariate) -> T {
    match function {
        Bivariate::Power => (y * x.ln()).exp(),
        Bivariate::Atan2 => angle(x, y),
        Bivariate::Max => (x + y + (x - y).elementary(Elementary::Abs)) * T::constant(0.5),
        Bivariate::Min => (x + y - (x - y).elementary(Elementary::Abs)) * T::constant(0.5),
        Bivariate::MeanSign => mean_sign(x, y),
        Bivariate::Less | Bivariate::LessOrEqual | Bivariate::Equal | Bivariate::IfElseZero => {
            T::unknown()
        }
    }
}

/// (|x| - |y|)/(x - y).
fn mean_sign<T: Arithmetic>(x: T, y: T) -> T {
    let sides = [x.range(), y.range()];
    let above = sides.map(|side| side.lower >= 0.0);
    let below = sides.map(|side| side.upper <= 0.0);
    match (above, below) {
        // Where both are zero, any number from -1 to 1 is a slope between them.
        ([true, true], _) => T::constant(1.0),
        (_, [true, true]) => T::constant(-1.0),
        _ if sides[0].lower > 0.0 && sides[1].upper < 0.0 => (x + y) / (x - y),
        _ if sides[0].upper < 0.0 && sides[1].lower > 0.0 => (x + y) / (y - x),
        _ => T::within(mean_signs(sides)),
    }
}

/// The same over ranges. As a slope of a convex function it rises with both.
fn mean_signs([x, y]: [Interval; 2]) -> Interval {
    let at = |x: f64, y: f64, sign: f64| {
        let (x, y) = (Interval::point(x), Interval::point(y));
        let size = absolute(x) + absolute(y);
        let mean = (x + y) * size.reciprocal();
        let all = Interval::new(-1.0, 1.0);
        match mean.lower.is_finite() && mean.upper.is_finite() {
            true => mean.common(all),
            false => Interval::point(sign),
        }
    };
    Interval::new(
        at(x.lower, y.lower, -1.0).lower,
        at(x.upper, y.upper, 1.0).upper,
    )
}

/// |x|.
fn absolute(x: Interval) -> Interval {
    if x.lower >= 0.0 {
        x
    } else if x.upper <= 0.0 {
        -x
    } else {
        Interval::new(0.0, x.magnitude())
    }
}

/// The angle of the point (`x`, `y`) with y its first coordinate: in the three half-planes where it
/// does not jump.
fn angle<T: Arithmetic>(x: T, y: T) -> T {
    let (above, ahead) = (x.range(), y.range());
    let right_angle = || {
        let half = T::constant(1.0).atan();
        half + half
    };
    // Divided by the larger one, as long as there is a choice.
    let steep = above.lower.max(-above.upper) > ahead.magnitude();
    if ahead.lower > 0.0 && !steep {
        (x / y).atan()
    } else if above.lower > 0.0 {
        right_angle() - (y / x).atan()
    } else if above.upper < 0.0 {
        -right_angle() - (y / x).atan()
    } else {
        T::unknown()
    }
}

/// Enclosures of f^(n)(x) / n! over `x`, n = 0 to `count` - 1; without bound where `x` leaves the
/// domain of f.
pub(super) fn taylor_coefficients(
    function: Elementary,
    count: usize,
    x: Interval,
) -> Coefficients<Interval> {
    let mut coefficients = [Interval::point(0.0); MOST_COEFFICIENTS];
    // What has no bound may have no value, and then neither has a bounded function of it.
    if x == Interval::EVERYTHING {
        coefficients[..count].fill(Interval::EVERYTHING);
        return coefficients;
    }
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
        Elementary::Sinhc => places.for_each(|(n, place)| *place = sinhc_coefficient(n, x)),
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
        Elementary::Sinh | Elementary::Cosh => {
            let (sinh, cosh) = hyperbolic(x);
            let derivatives = [sinh, cosh];
            let first = if function == Elementary::Sinh { 0 } else { 1 };
            for (n, place) in places {
                *place = derivatives[(first + n) % 2] * TABLES.reciprocal_factorials[n];
            }
        }
        Elementary::ExpM1 => {
            coefficients = taylor_coefficients(Elementary::Exp, count, x);
            coefficients[0] = coefficients[0] - Interval::point(1.0);
        }
        Elementary::Ln1p => {
            coefficients = taylor_coefficients(Elementary::Ln, count, x + Interval::point(1.0));
        }
        Elementary::Asin
        | Elementary::Acos
        | Elementary::Asinh
        | Elementary::Acosh
        | Elementary::Atanh => match Inverse::of(function, x) {
            Some(inverse) => recursion(places, inverse.value, |n, known| inverse.next(n, known)),
            None => coefficients[..count].fill(Interval::EVERYTHING),
        },
        Elementary::Abs => {
            let kink = x.lower < 0.0 && 0.0 < x.upper;
            for (n, place) in places {
                *place = match n {
                    0 => absolute(x),
                    1 if kink => Interval::new(-1.0, 1.0),
                    1 if x.lower >= 0.0 => Interval::point(1.0),
                    1 => Interval::point(-1.0),
                    _ if kink => Interval::EVERYTHING,
                    _ => Interval::point(0.0),
                };
            }
        }
        // They jump.
        Elementary::Sign | Elementary::Floor => {
            coefficients[..count].fill(Interval::EVERYTHING);
        }
    }
    coefficients
}

/// (sinh x, cosh x).
pub(super) fn hyperbolic(x: Interval) -> (Interval, Interval) {
    let half = Interval::point(0.5);
    let at = |x: f64| {
        let (up, down) = (
            rising(Interval::point(x), f64::exp),
            rising(Interval::point(-x), f64::exp),
        );
        (half * (up - down), half * (up + down))
    };
    let (lower, upper) = (at(x.lower), at(x.upper));
    let ends = lower.1.hull(upper.1);
    let one = Interval::point(1.0);
    let contains_zero = x.lower <= 0.0 && 0.0 <= x.upper;
    let cosh = if contains_zero { ends.hull(one) } else { ends };
    let sinh = lower.0.hull(upper.0);
    (sinh, cosh.common(Interval::new(1.0, f64::INFINITY)))
}

/// An inverse function h whose derivative is algebraic: with q = 1 - x^2, 1 + x^2 or x^2 - 1,
/// h' = 1/q (arctanh), or h' = 1/sqrt(q) up to its sign (the others).
struct Inverse {
    x: Interval,
    value: Interval,
    /// 1/q.
    over_q: Interval,
    /// h'.
    slope: Interval,
    /// Of h' = 1/q, two more than of the others.
    order: f64,
    /// 1 where q = 1 - x^2, else -1.
    sign: f64,
}

impl Inverse {
    /// `None` where `x` leaves the open domain.
    fn of(function: Elementary, x: Interval) -> Option<Self> {
        let one = Interval::point(1.0);
        let square = x.square();
        let (q, sign) = match function {
            Elementary::Asinh => (one + square, -1.0),
            Elementary::Acosh if x.lower > 1.0 => (square - one, -1.0),
            Elementary::Asin | Elementary::Acos | Elementary::Atanh => (one - square, 1.0),
            _ => return None,
        };
        if q.lower <= 0.0 {
            return None;
        }
        let value = match function {
            Elementary::Asin => rising(x, f64::asin),
            Elementary::Acos => rising(Interval::new(-x.upper, -x.lower), |x| (-x).acos()),
            // By the logarithm: the library's own have no known error.
            Elementary::Asinh => at_ends(x, asinh),
            Elementary::Acosh => at_ends(x, |x| logarithm(x + (x.square() - one).square_root())),
            _ => at_ends(x, |x| {
                logarithm((one + x) * (one - x).reciprocal()) * Interval::point(0.5)
            }),
        };
        let over_q = q.reciprocal();
        let (slope, order) = match function {
            Elementary::Atanh => (over_q, 2.0),
            Elementary::Acos => (-q.square_root().reciprocal(), 1.0),
            _ => (q.square_root().reciprocal(), 1.0),
        };
        Some(Self {
            x,
            value,
            over_q,
            slope,
            order,
            sign,
        })
    }

    /// From q h'' = sign x order h', with d_k = (k + 1) h_(k+1):
    /// q (k + 1) d_(k+1) = sign ((2 k + order) x d_k + (k - 1 + order) d_(k-1)).
    fn next(&self, n: usize, known: &[Interval]) -> Interval {
        let d = |k: usize| whole(k + 1) * known[k + 1];
        let slope = match n {
            1 => self.slope,
            _ => {
                let k = n - 2;
                let factor = |value: f64| Interval::point(self.sign * value);
                let mut sum = factor(2.0 * k as f64 + self.order) * self.x * d(k);
                if k > 0 {
                    sum = sum + factor(k as f64 - 1.0 + self.order) * d(k - 1);
                }
                sum * self.over_q * whole(k + 1).reciprocal()
            }
        };
        slope * whole(n).reciprocal()
    }
}

/// A function that rises over the whole of `x`, from enclosures at its ends.
fn at_ends(x: Interval, function: impl Fn(Interval) -> Interval) -> Interval {
    function(Interval::point(x.lower)).hull(function(Interval::point(x.upper)))
}

fn logarithm(x: Interval) -> Interval {
    if x.lower > 0.0 {
        rising(x, f64::ln)
    } else {
        Interval::EVERYTHING
    }
}

/// The inverse of sinh at a point.
fn asinh(x: Interval) -> Interval {
    let value = |x: Interval| logarithm(x + (x.square() + Interval::point(1.0)).square_root());
    // Of x < 0 the sum would cancel out.
    if x.upper < 0.0 { -value(-x) } else { value(x) }
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
