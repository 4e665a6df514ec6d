//! Sine and cosine of an angle, at the price of a dozen multiplications.
//!
//! A controller's step asks for about a hundred of them. The library's functions take over a
//! thousand instructions each on a microcontroller without double precision, and 10 kB of its
//! flash, because they reduce any argument to full accuracy; the angles of a plant need next to no reduction.
//! The same polynomials on every target also mean the same numbers on every target.

use crate::model::Scalar;
use nalgebra::convert;

/// Up to this angle (63 degrees) the Taylor polynomials are exact to rounding in `f64`: the
/// first terms left out are below 5e-17 and 3e-18.
const LARGEST: f64 = 1.1;

/// Up to this angle (151 degrees) one quarter turn leaves an angle for the polynomials.
const NEIGHBOURS: f64 = 2.64;

/// (sin x, cos x) for `x` in rad, to rounding up to some thousand turns; the error grows with the
/// argument from there on. NaN for what is not finite.
#[inline(always)]
pub(super) fn sin_cos<T: Scalar>(x: T) -> (T, T) {
    if x.abs() <= convert(LARGEST) {
        polynomials(x)
    } else {
        reduced(x)
    }
}

/// By quarter turns: x = k pi/2 + r with |r| <= pi/4.
#[inline(never)]
fn reduced<T: Scalar>(x: T) -> (T, T) {
    // pi/2 in three parts, of which the first two have so few digits that their products with k
    // are exact (Cody and Waite, Software manual for the elementary functions, 1980).
    const PARTS: [f64; 3] = [
        1.570_312_5,
        4.837_512_969_970_703e-4,
        7.549_789_954_891_882e-8,
    ];
    let [zero, one, two, four]: [T; 4] = [0.0, 1.0, 2.0, 4.0].map(convert);
    // A robot that falls is in the quarters next to the upright one, which need no rounding.
    let near = x.abs() <= convert(NEIGHBOURS);
    let k = if near {
        one.copysign(x)
    } else {
        (x * T::frac_2_pi()).round()
    };
    let r = PARTS.iter().fold(x, |r, part| r - k * convert(*part));
    let (sin, cos) = polynomials(r);
    let quarter = if near {
        k
    } else {
        k - four * (k / four).floor()
    };
    if quarter == one {
        (cos, -sin)
    } else if quarter == zero {
        (sin, cos)
    } else if quarter == two {
        (-sin, -cos)
    } else {
        (-cos, sin)
    }
}

/// Taylor polynomials of degree 17 and 18, evaluated in pairs (Estrin) to shorten the chain of
/// dependent operations.
#[inline(always)]
fn polynomials<T: Scalar>(x: T) -> (T, T) {
    let z = x * x;
    let z2 = z * z;
    let z4 = z2 * z2;
    let pair = |a: f64, b: f64| convert::<f64, T>(a) + convert::<f64, T>(b) * z;
    let sin_low = pair(-1.0 / 6.0, 1.0 / 120.0) + pair(-1.0 / 5_040.0, 1.0 / 362_880.0) * z2;
    let sin_high = pair(-1.0 / 39_916_800.0, 1.0 / 6_227_020_800.0)
        + pair(-1.0 / 1_307_674_368_000.0, 1.0 / 355_687_428_096_000.0) * z2;
    let cos_low = pair(-1.0 / 2.0, 1.0 / 24.0) + pair(-1.0 / 720.0, 1.0 / 40_320.0) * z2;
    let cos_high = pair(-1.0 / 3_628_800.0, 1.0 / 479_001_600.0)
        + (pair(-1.0 / 87_178_291_200.0, 1.0 / 20_922_789_888_000.0)
            + convert::<f64, T>(-1.0 / 6_402_373_705_728_000.0) * z2)
            * z2;
    (
        x + x * z * (sin_low + sin_high * z4),
        T::one() + z * (cos_low + cos_high * z4),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn they_are_the_library_s_to_rounding() {
        // Beyond LARGEST on both sides, through zero and all four quarters, several times.
        for i in -40_000..=40_000 {
            let x = f64::from(i) * 5e-4;
            let (sin, cos) = sin_cos(x);
            assert!(
                (sin - x.sin()).abs() <= 2.0 * f64::EPSILON * x.sin().abs(),
                "sin {x}"
            );
            assert!((cos - x.cos()).abs() <= 2.0 * f64::EPSILON, "cos {x}");
            let (sin, cos) = sin_cos(x as f32);
            let exact = f64::from(x as f32);
            assert!(
                (f64::from(sin) - exact.sin()).abs() <= 1.2e-7,
                "f32 sin {x}"
            );
            assert!(
                (f64::from(cos) - exact.cos()).abs() <= 1.2e-7,
                "f32 cos {x}"
            );
        }
        assert!(sin_cos(f64::NAN).0.is_nan());
    }
}
