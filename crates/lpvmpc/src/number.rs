//! What a plant's formulas are evaluated on: numbers, numbers with derivatives, sets of numbers.

mod dual;
mod trigonometry;

pub use dual::{Dual, SincSlope};

use core::ops::{Add, Div, Mul, Neg, Sub};
use nalgebra::{ComplexField, RealField};
use trigonometry::sin_cos;

/// What a plant's formulas are evaluated on: `f32` and `f64`, [`Dual`] numbers for derivatives, and
/// enclosures such as the intervals and Taylor models of `lpvmpc-certificate` for proofs.
///
/// Formulas over any `Number` cannot branch on values, since a set of numbers may lie on both sides.
pub trait Number:
    nalgebra::Scalar
    + Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// The number `value`, as exactly as this kind of number has it.
    fn constant(value: f64) -> Self;

    /// A number of which no more is known than that it lies from `lower` to `upper`. Numbers that are no sets take
    /// the middle.
    #[inline(always)]
    fn between(lower: f64, upper: f64) -> Self {
        Self::constant(0.5 * lower + 0.5 * upper)
    }

    /// The value of an elementary function; not a number where the function has none.
    fn elementary(self, function: Elementary) -> Self;

    /// The value of a function of this number and `other`; not a number where the function has none.
    fn bivariate(self, other: Self, function: Bivariate) -> Self;

    /// sin x and cos x, `x` in rad.
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        (
            self.elementary(Elementary::Sin),
            self.elementary(Elementary::Cos),
        )
    }

    /// sin x, cos x and sin(x)/x, `x` in rad: cheaper together.
    #[inline(always)]
    fn sin_cos_sinc(self) -> (Self, Self, Self) {
        let (sin, cos) = self.sin_cos();
        (sin, cos, self.elementary(Elementary::Sinc))
    }

    /// sin x, `x` in rad.
    #[inline(always)]
    fn sin(self) -> Self {
        self.elementary(Elementary::Sin)
    }

    /// cos x, `x` in rad.
    #[inline(always)]
    fn cos(self) -> Self {
        self.elementary(Elementary::Cos)
    }

    /// tan x, `x` in rad.
    #[inline(always)]
    fn tan(self) -> Self {
        let (sin, cos) = self.sin_cos();
        sin / cos
    }

    /// sin(x)/x, 1 at 0; `x` in rad.
    #[inline(always)]
    fn sinc(self) -> Self {
        self.elementary(Elementary::Sinc)
    }

    /// arctan x, rad.
    #[inline(always)]
    fn atan(self) -> Self {
        self.elementary(Elementary::Atan)
    }

    /// e^x.
    #[inline(always)]
    fn exp(self) -> Self {
        self.elementary(Elementary::Exp)
    }

    /// The natural logarithm of x > 0.
    #[inline(always)]
    fn ln(self) -> Self {
        self.elementary(Elementary::Ln)
    }

    /// The square root of x >= 0; differentiable for x > 0.
    #[inline(always)]
    fn sqrt(self) -> Self {
        self.elementary(Elementary::Sqrt)
    }

    /// tanh x.
    #[inline(always)]
    fn tanh(self) -> Self {
        self.elementary(Elementary::Tanh)
    }

    /// The angle of the point (`x`, self) from the first axis, in rad from -pi to pi.
    #[inline(always)]
    fn atan2(self, x: Self) -> Self {
        self.bivariate(x, Bivariate::Atan2)
    }

    /// x^`exponent` for x > 0.
    #[inline(always)]
    fn powf(self, exponent: Self) -> Self {
        self.bivariate(exponent, Bivariate::Power)
    }

    /// x^`exponent` by multiplication, for any x; 1/x^|exponent| for an exponent below 0.
    fn powi(self, exponent: i32) -> Self {
        let one = Self::constant(1.0);
        let mut rest = exponent.unsigned_abs();
        let mut square = self;
        let mut product = None;
        while rest > 0 {
            if rest % 2 == 1 {
                product = Some(product.map_or(square, |product| product * square));
            }
            rest /= 2;
            if rest > 0 {
                square = square * square;
            }
        }
        let power = product.unwrap_or(one);
        if exponent < 0 { one / power } else { power }
    }
}

/// Functions beyond the four operations that every [`Number`] has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Elementary {
    /// sin x.
    Sin,
    /// cos x.
    Cos,
    /// sin(x)/x, 1 at 0.
    Sinc,
    /// sinh(x)/x, 1 at 0.
    Sinhc,
    /// arctan x.
    Atan,
    /// e^x.
    Exp,
    /// ln x.
    Ln,
    /// The square root of x.
    Sqrt,
    /// tanh x.
    Tanh,
    /// arcsin x, rad, for |x| <= 1; differentiable for |x| < 1.
    Asin,
    /// arccos x, rad, for |x| <= 1; differentiable for |x| < 1.
    Acos,
    /// sinh x.
    Sinh,
    /// cosh x.
    Cosh,
    /// The inverse of sinh.
    Asinh,
    /// The inverse of cosh, for x >= 1; differentiable for x > 1.
    Acosh,
    /// The inverse of tanh, for |x| < 1.
    Atanh,
    /// e^x - 1, exact for small x, too.
    ExpM1,
    /// ln(1 + x) for x > -1, exact for small x, too.
    Ln1p,
    /// |x|; at 0 with the derivative 1.
    Abs,
    /// -1, 0 or 1; the derivative is 0. No proof: it jumps.
    Sign,
    /// The largest whole number that is not above x; the derivative is 0. No proof: it jumps.
    Floor,
}

/// Functions of two numbers, x and y, that every [`Number`] has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Bivariate {
    /// The angle of the point (y, x), whose first coordinate is y, in rad: arctan(x/y) for y > 0.
    Atan2,
    /// x^y for x > 0; plain numbers also have it where a power of x <= 0 exists.
    Power,
    /// The smaller one; of equal ones, x.
    Min,
    /// The larger one; of equal ones, x.
    Max,
    /// (|x| - |y|)/(x - y), from -1 to 1: the mean sign of the numbers between x and y; 0 where both are. What is known of
    /// the derivative of |x| at its kink is made of it.
    MeanSign,
    /// 1 where x < y, else 0; the derivative is 0. No proof: it jumps.
    Less,
    /// 1 where x <= y, else 0; the derivative is 0. No proof: it jumps.
    LessOrEqual,
    /// 1 where x = y, else 0; the derivative is 0. No proof: it jumps.
    Equal,
    /// y where x is not 0, else 0, whatever y is. No proof: it jumps.
    IfElseZero,
}

macro_rules! impl_number {
    ($float:ty) => {
        impl Number for $float {
            #[inline(always)]
            fn constant(value: f64) -> Self {
                value as $float
            }

            #[inline(always)]
            fn elementary(self, function: Elementary) -> Self {
                match function {
                    Elementary::Sin => sin_cos(self).0,
                    Elementary::Cos => sin_cos(self).1,
                    Elementary::Sinc => over_itself(self, sin_cos(self).0),
                    Elementary::Sinhc => over_itself(self, ComplexField::sinh(self)),
                    Elementary::Atan => ComplexField::atan(self),
                    Elementary::Exp => ComplexField::exp(self),
                    Elementary::Ln => ComplexField::ln(self),
                    Elementary::Sqrt => ComplexField::sqrt(self),
                    Elementary::Tanh => ComplexField::tanh(self),
                    Elementary::Asin => ComplexField::asin(self),
                    Elementary::Acos => ComplexField::acos(self),
                    Elementary::Sinh => ComplexField::sinh(self),
                    Elementary::Cosh => ComplexField::cosh(self),
                    Elementary::Asinh => ComplexField::asinh(self),
                    Elementary::Acosh => ComplexField::acosh(self),
                    Elementary::Atanh => ComplexField::atanh(self),
                    Elementary::ExpM1 => ComplexField::exp_m1(self),
                    Elementary::Ln1p => ComplexField::ln_1p(self),
                    Elementary::Abs => ComplexField::abs(self),
                    Elementary::Sign => sign(self),
                    Elementary::Floor => ComplexField::floor(self),
                }
            }

            #[inline(always)]
            fn bivariate(self, other: Self, function: Bivariate) -> Self {
                match function {
                    Bivariate::Atan2 => RealField::atan2(self, other),
                    Bivariate::Power => ComplexField::powf(self, other),
                    Bivariate::MeanSign => {
                        let size = ComplexField::abs(self) + ComplexField::abs(other);
                        if size == 0.0 {
                            0.0
                        } else {
                            (self + other) / size
                        }
                    }
                    _ => choice(self, other, function).map_or(Self::NAN, |choice| match choice {
                        Choice::First => self,
                        Choice::Second => other,
                        Choice::One => 1.0,
                        Choice::Zero => 0.0,
                    }),
                }
            }

            #[inline(always)]
            fn sin_cos(self) -> (Self, Self) {
                sin_cos(self)
            }

            #[inline(always)]
            fn sin_cos_sinc(self) -> (Self, Self, Self) {
                let (sin, cos) = sin_cos(self);
                (sin, cos, over_itself(self, sin))
            }
        }
    };
}

impl_number!(f32);
impl_number!(f64);

/// What a function that chooses comes to.
#[derive(Clone, Copy)]
enum Choice {
    /// x.
    First,
    /// y.
    Second,
    One,
    Zero,
}

/// What `function` chooses at `x` and `y`; `None` where it is none that chooses, or where a NaN
/// decides.
#[inline(always)]
fn choice<T: PartialOrd + Number>(x: T, y: T, function: Bivariate) -> Option<Choice> {
    let truth = |holds: bool| if holds { Choice::One } else { Choice::Zero };
    if function == Bivariate::IfElseZero {
        let order = x.partial_cmp(&T::constant(0.0))?;
        return Some(if order.is_eq() {
            Choice::Zero
        } else {
            Choice::Second
        });
    }
    let order = x.partial_cmp(&y)?;
    match function {
        Bivariate::Min if order.is_le() => Some(Choice::First),
        Bivariate::Max if order.is_ge() => Some(Choice::First),
        Bivariate::Min | Bivariate::Max => Some(Choice::Second),
        Bivariate::Less => Some(truth(order.is_lt())),
        Bivariate::LessOrEqual => Some(truth(order.is_le())),
        Bivariate::Equal => Some(truth(order.is_eq())),
        Bivariate::Atan2 | Bivariate::Power | Bivariate::MeanSign | Bivariate::IfElseZero => None,
    }
}

/// -1, 0 or 1; NaN of NaN.
#[inline(always)]
fn sign<T: crate::Scalar>(x: T) -> T {
    if x > T::zero() {
        T::one()
    } else if x < T::zero() {
        -T::one()
    } else {
        // 0, or NaN.
        x
    }
}

/// `value`/x of sin x or sinh x, 1 at x = 0.
#[inline(always)]
fn over_itself<T: crate::Scalar>(x: T, value: T) -> T {
    if x == T::zero() { T::one() } else { value / x }
}
