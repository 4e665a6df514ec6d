//! What a plant's formulas are evaluated on: numbers, numbers with derivatives, sets of numbers.

mod dual;
mod trigonometry;

pub use dual::Dual;

use core::ops::{Add, Div, Mul, Neg, Sub};
use nalgebra::ComplexField;
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

    /// The value of an elementary function; not a number where the function has none.
    fn elementary(self, function: Elementary) -> Self;

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
}

/// Functions beyond the four operations that every [`Number`] has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Elementary {
    /// sin x.
    Sin,
    /// cos x.
    Cos,
    /// sin(x)/x, 1 at 0.
    Sinc,
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
                    Elementary::Sinc => sinc(self, sin_cos(self).0),
                    Elementary::Atan => ComplexField::atan(self),
                    Elementary::Exp => ComplexField::exp(self),
                    Elementary::Ln => ComplexField::ln(self),
                    Elementary::Sqrt => ComplexField::sqrt(self),
                    Elementary::Tanh => ComplexField::tanh(self),
                }
            }

            #[inline(always)]
            fn sin_cos(self) -> (Self, Self) {
                sin_cos(self)
            }

            #[inline(always)]
            fn sin_cos_sinc(self) -> (Self, Self, Self) {
                let (sin, cos) = sin_cos(self);
                (sin, cos, sinc(self, sin))
            }
        }
    };
}

impl_number!(f32);
impl_number!(f64);

/// sin(x)/x, 1 at x = 0.
#[inline(always)]
fn sinc<T: crate::Scalar>(x: T, sin_x: T) -> T {
    if x == T::zero() { T::one() } else { sin_x / x }
}
